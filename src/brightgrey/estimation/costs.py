"""Sum of squares of many parameter sets: the cost without what only derivatives need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.pattern_search import CostMany
from brightgrey.estimation.problem import Problem, predict_many
from brightgrey.simulation import Settings

__all__ = ["cost_function"]

Array = NDArray[np.float64]


def cost_function(problem: Problem, search: Search, settings: Settings) -> CostMany:
    """Weighted sum of squared residuals of K points in the searched scale; infinite where a simulation diverged.

    Parameters
    ----------
    problem : Problem
    search : Search
        Gives the searched scale and the fixed parameters.
    settings : Settings

    Returns
    -------
    callable
        ``cost(theta)`` with theta of shape (n, K) gives shape (K,).
    """

    def cost(theta: Array) -> Array:
        values = search.named(search.outward(theta))
        total = np.zeros(theta.shape[1])
        for r, onset in zip(problem.recordings, problem.onsets, strict=True):
            y = predict_many(problem.structure, values, r, settings, onset=onset, threads=problem.threads)
            for out, weight in enumerate(problem.weights):
                apart = y[out] - r.y[out][:, None]
                total += weight**2 * np.einsum("ij,ij->j", apart, apart)
        return np.where(np.isfinite(total), total, np.inf)

    return cost
