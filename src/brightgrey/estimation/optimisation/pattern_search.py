"""Generalised pattern search, many searches at once (paper section 3.1, step 4)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.estimation.optimisation.options import PATTERN_SEARCH_DEFAULTS, PatternSearchOptions

__all__ = ["CostMany", "PatternSearchResult", "pattern_search"]

CostMany = Callable[[Array, Array], Array]
"""Costs, shape (K,), of K points, shape (n, K), and upper limits, shape (K,).

A cost at or above its limit may be given as infinite. What is not a number counts as infinite.
"""
Reason = Literal["mesh", "stalled", "iterations", "evaluations"]


@dataclass(frozen=True)
class PatternSearchResult:
    """Result of one pattern search."""

    values: tuple[float, ...]  #: Best point, in the scale of the search.
    cost: float  #: Infinite if no point had a finite one.
    mesh: float  #: Last mesh, as part of the range.
    #: Polls, and evaluated points.
    iterations: int
    evaluations: int
    #: ``mesh``: converged, the mesh has shrunk to its smallest. ``stalled``: hardly anything was gained any more. The
    #: others are limits, one of 'mesh', 'stalled', 'iterations', 'evaluations'.
    reason: Reason


def pattern_search(
    cost_many: CostMany,
    starts: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    *,
    iterations: int | None = None,
    evaluations: int | None = None,
    patience: int | None = None,
    options: PatternSearchOptions = PATTERN_SEARCH_DEFAULTS,
) -> tuple[PatternSearchResult, ...]:
    """Minimise from several starts independently, with the polls of all searches in one batch.

    A poll tries one mesh width forth and back along every coordinate from the best point (positive basis 2N). Before
    these, it tries the joint step of the last 2, 4, 8 and 16 successes once more (pattern moves, which follow a bent
    valley). Points are evaluated in blocks of 16, the moves first, then along the direction that succeeded last. The
    search goes to the best point of the first block that holds a better one.

    After two successes in succession the mesh doubles, after a failure it halves. A point beyond a bound is moved onto
    it (Hooke and Jeeves 1961, doi:10.1145/321062.321069; Torczon 1997, doi:10.1137/S1052623493250780; bounds: Lewis and
    Torczon 1999, doi:10.1137/S1052623496300507).

    Parameters
    ----------
    cost_many : callable
        ``cost_many(points, upper_limits)`` with shapes (n, K) and (K,) gives K costs. A cost may not depend on the
        other points; then no search depends on the others.
    starts : array_like, shape (n, starts) or (n,)
        Clipped to the bounds.
    low, high : array_like, shape (n,)
        Finite. The mesh is measured in high - low, coordinate by coordinate; one without width is not moved.
    iterations : int, optional
        Largest number of polls of a search; by default that of the options, 500.
    evaluations : int, optional
        Largest number of points of a search; a poll that would need more is not begun.
    patience : int, optional
        A search also ends when so many polls together have lowered the cost by less than a hundredth.
    options : PatternSearchOptions

    Returns
    -------
    tuple of PatternSearchResult
        In the order of `starts`.

    Raises
    ------
    SettingsError
        If shapes do not fit, bounds are not finite or crossed, or limits are below 1.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    points = np.array(starts, float)
    points = points[:, None] if points.ndim == 1 else points
    limits = _Limits(options.max_iterations if iterations is None else iterations, evaluations, patience)
    _refuse_wrong_arguments(points, low, high, limits, options)
    points = np.clip(points, low[:, None], high[:, None])
    unlimited = np.full(points.shape[1], np.inf)
    first = _nan_to_inf(cost_many(points, unlimited)) if points.shape[1] else np.zeros(0)
    mesh = options.first_mesh if np.any(low < high) else 0.0
    searches = [_PatternSearchState(x, cost, mesh, options) for x, cost in zip(points.T, first.tolist(), strict=True)]
    basis = np.hstack([np.eye(len(low)), -np.eye(len(low))]) * (high - low)[:, None]
    active = searches
    while active:
        active = [search for search in active if search.pending or search.start_poll(basis, low, high, limits)]
        blocks = [search.pending.popleft() if search.pending else np.zeros((len(low), 0)) for search in active]
        costs = np.zeros(0)
        if any(block.size for block in blocks):
            upper_limits = [np.full(b.shape[1], s.cost) for s, b in zip(active, blocks, strict=True)]
            costs = _nan_to_inf(cost_many(np.concatenate(blocks, axis=1), np.concatenate(upper_limits)))
        first_point = 0
        for search, block in zip(active, blocks, strict=True):
            search.accept(block, costs[first_point : first_point + block.shape[1]])
            first_point += block.shape[1]
    return tuple(search.result() for search in searches)


@dataclass(frozen=True)
class _Limits:
    """Limits of each search."""

    iterations: int
    evaluations: int | None
    patience: int | None


class _PatternSearchState:
    """State of one search: its best point, its mesh, its last successes, and the blocks of its poll."""

    def __init__(self, start: Array, cost: float, mesh: float, options: PatternSearchOptions) -> None:
        self.point, self.cost, self.mesh, self.options = start, cost, mesh, options
        self.successes = deque([start], maxlen=max(options.moves) + 1)
        self.costs = [cost]  # after every poll
        self.pending: deque[Array] = deque()
        self.evaluations, self.in_succession, self.failed = 1, 0, False
        self.reason: Reason = "mesh"

    def start_poll(self, basis: Array, low: Array, high: Array, limits: _Limits) -> bool:
        """Prepare the blocks of the next poll; returns False if the search ends, for `reason`."""
        points = self._poll(basis, low, high)
        if not self._continues(points.shape[1], limits):
            return False
        block = self.options.block
        self.pending.extend(points[:, first : first + block] for first in range(0, points.shape[1], block))
        return True

    def _poll(self, basis: Array, low: Array, high: Array) -> Array:
        """Points of the next poll, shape (n, K), the most promising first; without the best point itself."""
        last = self.point - self.successes[-2] if len(self.successes) > 1 else np.zeros_like(self.point)
        along = np.argsort(-(basis.T @ (last / (high - low + (high == low)) ** 2)), kind="stable")
        points = self.point[:, None] + basis[:, along] * self.mesh
        backs = [back for back in self.options.moves if back < len(self.successes)]
        moves = [2.0 * self.point - self.successes[-1 - back] for back in backs]
        if moves and not self.failed:  # after a failure they have been tried
            points = np.column_stack([*moves, points])
        points = np.minimum(np.maximum(points, low[:, None]), high[:, None])
        return np.asarray(points[:, np.any(points != self.point[:, None], axis=0)])

    def _continues(self, points: int, limits: _Limits) -> bool:
        """Check the limits before a poll with so many points; sets `reason` if the search ends."""
        done, patience, decrease = len(self.costs) - 1, limits.patience, self.options.stall_decrease
        if self.mesh < self.options.last_mesh:
            self.reason = "mesh"
        elif patience is not None and done >= patience and self.cost > (1.0 - decrease) * self.costs[done - patience]:
            self.reason = "stalled"
        elif done >= limits.iterations:
            self.reason = "iterations"
        elif limits.evaluations is not None and self.evaluations + points > limits.evaluations:
            self.reason = "evaluations"
        else:
            return True
        return False

    def accept(self, points: Array, costs: Array) -> None:
        """Move to the best point of a block if it is better, which ends the poll; so does a last block without one."""
        self.evaluations += points.shape[1]
        best = int(costs.argmin()) if costs.size else 0
        if costs.size and costs[best] < self.cost:
            self.pending.clear()
            self.point, self.cost, self.failed = points[:, best].copy(), float(costs[best]), False
            self.successes.append(self.point)
            self.in_succession += 1
            if self.in_succession == self.options.successes:
                self.mesh, self.in_succession = min(self.options.expansion * self.mesh, self.options.max_mesh), 0
        elif not self.pending:
            self.failed = True
            self.mesh, self.in_succession = self.options.contraction * self.mesh, 0
        if not self.pending:
            self.costs.append(self.cost)

    def result(self) -> PatternSearchResult:
        """Best point, and why the search ended."""
        values, polls = tuple(self.point.tolist()), len(self.costs) - 1
        return PatternSearchResult(values, self.cost, self.mesh, polls, self.evaluations, self.reason)


def _nan_to_inf(cost: ArrayLike) -> Array:
    cost = np.asarray(cost, float)
    return np.where(np.isnan(cost), np.inf, cost)


def _refuse_wrong_arguments(
    point: Array, low: Array, high: Array, limits: _Limits, options: PatternSearchOptions
) -> None:
    if point.ndim != 2 or low.shape != high.shape or low.shape != (len(point),):
        raise SettingsError(f"starts {point.shape}, low {low.shape} and high {high.shape} do not fit together")
    if not (np.isfinite(low).all() and np.isfinite(high).all() and np.all(low <= high) and np.isfinite(point).all()):
        raise SettingsError("a pattern search needs finite starts and bounds with low <= high")
    for name in ("iterations", "evaluations", "patience"):
        limit = getattr(limits, name)
        if limit is not None and limit < 1:
            raise SettingsError(f"{name} {limit}: at least 1 is needed")
    first, last, largest = options.first_mesh, options.last_mesh, options.max_mesh
    if not 0.0 < last <= first <= largest:
        raise SettingsError(f"mesh {first:g} and last mesh {last:g}: 0 < last <= mesh <= {largest:g} is needed")
