"""Sum of squares of many parameter sets: the cost without what only derivatives need."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.pattern_search import CostMany
from brightgrey.estimation.problem import Problem, initial_state, predict_many
from brightgrey.kit import assemble
from brightgrey.simulation import Settings

__all__ = ["cost_function"]

Array = NDArray[np.float64]


def cost_function(problem: Problem, search: Search, settings: Settings) -> CostMany:
    """Weighted sum of squared residuals of K points in the searched scale; infinite where a simulation diverged.

    What does not depend on the parameters, the initial state above all, is worked out once.

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
    middle = dict(zip(search.names, search.start.tolist(), strict=True)) | dict(search.fixed)
    system = assemble(problem.structure, middle, settings.f_tanh)
    initial: list[Mapping[str, float]] = [
        dict(zip(system.state_names, initial_state(r, system).tolist(), strict=True)) for r in problem.recordings
    ]

    def cost(theta: Array) -> Array:
        values = dict(zip(search.names, search.outward(theta), strict=True))
        values |= {name: np.full(theta.shape[1], value) for name, value in search.fixed.items()}
        total = np.zeros(theta.shape[1])
        for r, start in zip(problem.recordings, initial, strict=True):
            y = predict_many(problem.structure, values, r, settings, initial=start, threads=problem.threads)
            for out, weight in enumerate(problem.weights):
                apart = y[out] - r.y[out][:, None]
                total += weight**2 * np.einsum("ij,ij->j", apart, apart)
        return np.where(np.isfinite(total), total, np.inf)

    return cost
