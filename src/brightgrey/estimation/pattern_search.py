"""Generalised pattern search within bounds (Torczon 1997, doi:10.1137/S1052623493250780), many starts side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Searched", "pattern_search"]

Array = NDArray[np.float64]
_FIRST = 0.25  # mesh at the beginning, of the range
_LAST = 1e-6  # mesh at which a search has ended, of the range


class Searched(NamedTuple):
    """Ends of the searches.

    Attributes
    ----------
    values : ndarray, shape (n, starts)
    costs : ndarray, shape (starts,)
    converged : bool ndarray, shape (starts,)
        The mesh became as fine as it gets, before the limit of iterations.
    iterations, evaluations : int ndarray, shape (starts,)
    """

    values: Array
    costs: Array
    converged: NDArray[np.bool_]
    iterations: NDArray[np.int64]
    evaluations: NDArray[np.int64]


def pattern_search(
    cost_many: Callable[[Array], Array],
    begins: Array,
    low: Array,
    high: Array,
    iterations: int = 500,
    evaluations: int | None = None,
) -> Searched:
    """Minimise a cost from several starts.

    In every iteration all 2n neighbours on the mesh are polled. The best one becomes the new point and the mesh
    doubles if it is better than the point; otherwise the mesh is halved.

    Parameters
    ----------
    cost_many : callable
        From parameter sets, shape (n, K), to their costs, shape (K,).
    begins : ndarray, shape (n, starts)
    low, high : ndarray, shape (n,)
    iterations : int
        Limit for each start.
    evaluations : int, optional
        Limit of costs for each start.

    Returns
    -------
    Searched
    """
    n, starts = begins.shape
    width = high - low
    points = np.clip(begins, low[:, None], high[:, None])
    costs = np.asarray(cost_many(points), float).copy()
    mesh = np.full(starts, _FIRST)
    spent, used = np.zeros(starts, np.int64), np.ones(starts, np.int64)
    directions = np.hstack([np.eye(n), -np.eye(n)])[:, :, None]
    limit = np.inf if evaluations is None else evaluations
    while True:
        active = np.flatnonzero((mesh >= _LAST) & (spent < iterations) & (used + 2 * n <= limit) & (n > 0))
        if not active.size:
            break
        here = points[:, active]
        polled = here[:, None, :] + directions * mesh[active] * width[:, None, None]
        polled = np.clip(polled, low[:, None, None], high[:, None, None])
        found = np.asarray(cost_many(polled.reshape(n, -1)), float).reshape(2 * n, active.size)
        best = np.argmin(found, axis=0)
        columns = np.arange(active.size)
        better = found[best, columns] < costs[active]
        points[:, active] = np.where(better, polled[:, best, columns], here)
        costs[active] = np.where(better, found[best, columns], costs[active])
        mesh[active] = np.where(better, np.minimum(2.0 * mesh[active], 1.0), 0.5 * mesh[active])
        spent[active] += 1
        used[active] += 2 * n
    return Searched(points, costs, mesh < _LAST, spent, used)
