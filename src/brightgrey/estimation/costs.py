"""Sum of squares of many parameter sets: the cost without what only derivatives need."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.onset import Onset
from brightgrey.estimation.pattern_search import CostMany
from brightgrey.estimation.problem import Problem, predict_many, systems
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, squares

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
        ``cost(theta, most)`` with theta of shape (n, K) gives shape (K,); infinite, too, where the sum reaches `most`,
        shape (K,): the simulation is then given up.
    """

    def cost(theta: Array, most: Array) -> Array:
        values = search.named(search.outward(theta))
        total = np.zeros(theta.shape[1])
        for r, onset in zip(problem.recordings, problem.onsets, strict=True):
            total = _added(problem, values, r, onset, settings, total, most)
        return total

    return cost


def _added(
    problem: Problem,
    values: Mapping[str, Array],
    recording: Recording,
    onset: Onset,
    settings: Settings,
    spent: Array,
    most: Array,
) -> Array:
    """Costs `spent` so far with those of one more recording, shape (K,)."""
    r, weights = recording, problem.weights**2
    if any(signal.kind == "velocity-differenced" for signal in r.outputs):
        y = predict_many(problem.structure, values, r, settings, onset=onset, threads=problem.threads)
        apart = y - r.y[:, :, None]
        total = spent + np.einsum("o,oik,oik->k", weights, apart, apart)
        return np.where(total < most, total, np.inf)
    system, x0 = systems(problem.structure, values, r, settings, onset=onset)
    return squares(system, r.u, r.dt, x0, settings, r.y, weights, spent=spent, most=most, threads=problem.threads)
