"""Generalised pattern search, many of them side by side (paper section 3.1, step 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brightgrey.errors import SettingsError

__all__ = ["CostMany", "PatternEnd", "pattern_search"]

Array = NDArray[np.float64]
CostMany = Callable[[Array], Array]
"""Costs, shape (K,), of K points, shape (n, K); what is not a number counts as infinite."""
Reason = Literal["mesh", "iterations", "evaluations"]

_GROW, _SHRINK = 2.0, 0.5
_FIRST = 0.25  # first mesh, of the range: the poll then reaches half way from the middle to the bounds
_LARGEST = 1.0  # a longer step leaves the range from anywhere
_LAST = 1e-6  # mesh at which a search has converged


@dataclass(frozen=True)
class PatternEnd:
    """Where a search ended.

    Attributes
    ----------
    values : tuple of float
        Best point, in the scale of the search.
    cost : float
        Infinite if no point had a finite one.
    mesh : float
        Last mesh, of the range.
    iterations, evaluations : int
        Polls, and points at which the cost was asked for.
    reason : {'mesh', 'iterations', 'evaluations'}
        ``mesh``: converged, the mesh has shrunk to its smallest. The others are limits.
    """

    values: tuple[float, ...]
    cost: float
    mesh: float
    iterations: int
    evaluations: int
    reason: Reason


def pattern_search(
    cost_many: CostMany,
    begins: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    *,
    iterations: int = 500,
    evaluations: int | None = None,
    mesh: float = _FIRST,
    smallest: float = _LAST,
) -> tuple[PatternEnd, ...]:
    """Minimise from several begins, each on its own, with all their polls in one batch.

    A poll looks from the best point one mesh width forth and back along every coordinate (positive basis 2N) and
    goes to the best of these points if that is better than where it stands. Then the mesh doubles, otherwise
    it halves. A point beyond a bound is put onto it. Polls are complete: with the simulations side by side the points
    after the first success cost next to nothing (Torczon 1997, doi:10.1137/S1052623493250780; bounds: Lewis and
    Torczon 1999, doi:10.1137/S1052623496300507).

    Parameters
    ----------
    cost_many : callable
        ``cost_many(points)`` with shape (n, K) gives K costs. A cost may not depend on its neighbours, then no
        search depends on the others.
    begins : array_like, shape (n, starts) or (n,)
        Put into the bounds where they lie outside.
    low, high : array_like, shape (n,)
        Finite. The mesh is measured in high - low, coordinate by coordinate; one without width is not moved.
    iterations : int
        Most polls of a search; the paper's limit is 500.
    evaluations : int, optional
        Most points of a search; a poll that would need more is not begun.
    mesh, smallest : float
        First and last mesh, as parts of the range.

    Returns
    -------
    tuple of PatternEnd
        In the order of `begins`.

    Raises
    ------
    SettingsError
        For shapes that do not fit, bounds that are not finite or crossed, or limits below 1.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    point = np.array(begins, float)
    point = point[:, None] if point.ndim == 1 else point
    _check(point, low, high, iterations, evaluations, mesh, smallest)
    point = np.clip(point, low[:, None], high[:, None])
    starts = point.shape[1]
    cost = _finite(cost_many(point)) if starts else np.zeros(0)
    spent, polls = np.ones(starts, int), np.zeros(starts, int)
    width = np.full(starts, mesh if np.any(low < high) else 0.0)
    most = np.iinfo(np.int64).max if evaluations is None else evaluations
    reasons: list[Reason] = ["mesh"] * starts
    active = np.arange(starts)
    while active.size:
        points, wanted = _poll(point[:, active], width[active], low, high)
        counts = wanted.sum(axis=0)
        stop = _stops(width[active], polls[active], spent[active] + counts, smallest, iterations, most)
        for i, reason in zip(active, stop, strict=True):
            reasons[i] = reason or "mesh"
        keep = np.array([reason is None for reason in stop])
        active, points, wanted = active[keep], points[:, :, keep], wanted[:, keep]
        if active.size:
            where, found = _best(cost_many, points, wanted)
            better = found < cost[active]
            point[:, active[better]], cost[active[better]] = where[:, better], found[better]
            width[active] = np.where(better, np.minimum(_GROW * width[active], _LARGEST), _SHRINK * width[active])
            polls[active] += 1
            spent[active] += counts[keep]
    numbers = (point.T.tolist(), cost.tolist(), width.tolist(), polls.tolist(), spent.tolist(), reasons)
    return tuple(PatternEnd(tuple(values), *rest) for values, *rest in zip(*numbers, strict=True))


def _best(cost_many: CostMany, points: Array, wanted: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Best point, shape (n, searches), and cost, shape (searches,), of each search's poll."""
    polled = np.full(wanted.shape, np.inf)
    if wanted.any():
        polled[wanted] = _finite(cost_many(np.ascontiguousarray(points[:, wanted])))
    best = polled.argmin(axis=0)
    each = np.arange(len(best))
    return points[:, best, each], polled[best, each]


def _poll(point: Array, width: Array, low: Array, high: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Points of one poll, shape (n, 2n, searches), and which of them are away from where the search stands."""
    n = len(low)
    directions = np.hstack([np.eye(n), -np.eye(n)]) * (high - low)[:, None]
    points = point[:, None, :] + directions[:, :, None] * width
    points = np.clip(points, low[:, None, None], high[:, None, None])
    return points, np.any(points != point[:, None, :], axis=0)


def _stops(
    width: Array, polls: NDArray[np.int64], needed: NDArray[np.int64], smallest: float, iterations: int, most: int
) -> list[Reason | None]:
    """Why each search ends before its next poll; None if it does not."""
    return [
        "mesh" if w < smallest else "iterations" if p >= iterations else "evaluations" if e > most else None
        for w, p, e in zip(width, polls, needed, strict=True)
    ]


def _finite(cost: ArrayLike) -> Array:
    cost = np.asarray(cost, float)
    return np.where(np.isnan(cost), np.inf, cost)


def _check(
    point: Array, low: Array, high: Array, iterations: int, evaluations: int | None, mesh: float, smallest: float
) -> None:
    if point.ndim != 2 or low.shape != high.shape or low.shape != (len(point),):
        raise SettingsError(f"begins {point.shape}, low {low.shape} and high {high.shape} do not fit together")
    if not (np.isfinite(low).all() and np.isfinite(high).all() and np.all(low <= high) and np.isfinite(point).all()):
        raise SettingsError("a pattern search needs finite begins and bounds with low <= high")
    if iterations < 1 or (evaluations is not None and evaluations < 1):
        raise SettingsError(f"iterations {iterations} and evaluations {evaluations}: at least 1 of each is needed")
    if not 0.0 < smallest <= mesh <= _LARGEST:
        raise SettingsError(f"mesh {mesh:g} and smallest {smallest:g}: 0 < smallest <= mesh <= {_LARGEST:g} is needed")
