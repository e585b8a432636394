"""Generalised pattern search, many of them side by side (paper section 3.1, step 4)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError

__all__ = ["CostMany", "PatternEnd", "pattern_search"]

CostMany = Callable[[Array, Array], Array]
"""Costs, shape (K,), of K points, shape (n, K), each of interest only below its limit, shape (K,): from there on it may
be given as infinite. What is not a number counts as infinite."""
Reason = Literal["mesh", "stalled", "iterations", "evaluations"]

_GROW, _SHRINK = 2.0, 0.5
_IN_SUCCESSION = 2  # successes after which the mesh grows: after each of them, every other poll would fail
_MOVES = (2, 4, 8, 16)  # successes whose way together is tried once more
_BLOCK = 16  # points asked for at once: as many as are simulated side by side
_FIRST = 0.25  # first mesh, of the range: the poll then reaches half way from the middle to the bounds
_LARGEST = 1.0  # a longer step leaves the range from anywhere
_LAST = 1e-6  # mesh at which a search has converged
_GAIN = 0.01  # part of the cost that `patience` polls have to be worth


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
    reason : {'mesh', 'stalled', 'iterations', 'evaluations'}
        ``mesh``: converged, the mesh has shrunk to its smallest. ``stalled``: hardly anything was gained any more. The
        others are limits.
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
    patience: int | None = None,
    mesh: float = _FIRST,
    smallest: float = _LAST,
) -> tuple[PatternEnd, ...]:
    """Minimise from several begins, each on its own, with all their polls in one batch.

    A poll looks from the best point one mesh width forth and back along every coordinate (positive basis 2N), and
    beside that to where the way of the last 2, 4, 8 and 16 successes leads if it is gone once more (pattern moves,
    which follow a bent valley). Points are asked for in blocks of 16, which are simulated side by side, the moves
    first, then on along the direction that succeeded last; the search goes to the best point of the first block
    that holds a better one than where it stands. After two successes in succession the mesh doubles, after a
    failure it halves. A point beyond a bound is put onto it (Hooke and Jeeves 1961, doi:10.1145/321062.321069;
    Torczon 1997, doi:10.1137/S1052623493250780; bounds: Lewis and Torczon 1999, doi:10.1137/S1052623496300507).

    Parameters
    ----------
    cost_many : callable
        ``cost_many(points, most)`` with shapes (n, K) and (K,) gives K costs; only those below `most` matter. A cost
        may not depend on its neighbours, then no search depends on the others.
    begins : array_like, shape (n, starts) or (n,)
        Put into the bounds where they lie outside.
    low, high : array_like, shape (n,)
        Finite. The mesh is measured in high - low, coordinate by coordinate; one without width is not moved.
    iterations : int
        Most polls of a search; the paper's limit is 500.
    evaluations : int, optional
        Most points of a search; a poll that would need more is not begun.
    patience : int, optional
        A search ends, too, where so many polls together have lowered the cost by less than a hundredth.
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
    begin = np.array(begins, float)
    begin = begin[:, None] if begin.ndim == 1 else begin
    _check(begin, low, high, iterations, evaluations, patience, mesh, smallest)
    begin = np.clip(begin, low[:, None], high[:, None])
    starts = begin.shape[1]
    first = _finite(cost_many(begin, np.full(starts, np.inf))) if starts else np.zeros(0)
    width = mesh if np.any(low < high) else 0.0
    walks = [_Walk(x, cost, width) for x, cost in zip(begin.T, first.tolist(), strict=True)]
    basis = np.hstack([np.eye(len(low)), -np.eye(len(low))]) * (high - low)[:, None]
    limits = _Limits(iterations, evaluations or np.iinfo(np.int64).max, patience, smallest)
    active = walks
    while active:
        active = [walk for walk in active if walk.asked or walk.begins(basis, low, high, limits)]
        blocks = [walk.asked.popleft() if walk.asked else np.zeros((len(low), 0)) for walk in active]
        costs = np.zeros(0)
        if any(block.size for block in blocks):
            most = np.concatenate([np.full(b.shape[1], w.cost) for w, b in zip(active, blocks, strict=True)])
            costs = _finite(cost_many(np.concatenate(blocks, axis=1), most))
        at = 0
        for walk, block in zip(active, blocks, strict=True):
            walk.take(block, costs[at : at + block.shape[1]])
            at += block.shape[1]
    return tuple(walk.end() for walk in walks)


@dataclass(frozen=True)
class _Limits:
    """Where a search ends."""

    iterations: int
    evaluations: int
    patience: int | None
    smallest: float


class _Walk:
    """One search on its way."""

    def __init__(self, begin: Array, cost: float, width: float) -> None:
        self.point, self.cost, self.width = begin, cost, width
        self.way = deque([begin], maxlen=max(_MOVES) + 1)  # where its last successes were
        self.course = [cost]  # after every poll
        self.asked: deque[Array] = deque()  # blocks of the poll under way
        self.spent, self.row, self.failed = 1, 0, False
        self.reason: Reason = "mesh"

    def begins(self, basis: Array, low: Array, high: Array, limits: _Limits) -> bool:
        """Begin the next poll; if it is not begun, why stands in `reason`."""
        points = self._poll(basis, low, high)
        if not self._goes_on(points.shape[1], limits):
            return False
        self.asked.extend(points[:, at : at + _BLOCK] for at in range(0, points.shape[1], _BLOCK))
        return True

    def _poll(self, basis: Array, low: Array, high: Array) -> Array:
        """Points of the next poll away from where the search stands, shape (n, K), the most promising first."""
        last = self.point - self.way[-2] if len(self.way) > 1 else np.zeros_like(self.point)
        along = np.argsort(-(basis.T @ (last / (high - low + (high == low)) ** 2)), kind="stable")
        points = self.point[:, None] + basis[:, along] * self.width
        moves = [2.0 * self.point - self.way[-1 - back] for back in _MOVES if back < len(self.way)]
        if moves and not self.failed:  # after a failure they have been tried
            points = np.column_stack([*moves, points])
        points = np.minimum(np.maximum(points, low[:, None]), high[:, None])
        return np.asarray(points[:, np.any(points != self.point[:, None], axis=0)])

    def _goes_on(self, needed: int, limits: _Limits) -> bool:
        """Whether the next poll, with so many points, is begun; if not, why stands in `reason`."""
        done, patience = len(self.course) - 1, limits.patience
        if self.width < limits.smallest:
            self.reason = "mesh"
        elif patience is not None and done >= patience and self.cost > (1.0 - _GAIN) * self.course[done - patience]:
            self.reason = "stalled"
        elif done >= limits.iterations:
            self.reason = "iterations"
        elif self.spent + needed > limits.evaluations:
            self.reason = "evaluations"
        else:
            return True
        return False

    def take(self, points: Array, costs: Array) -> None:
        """Go to the best of a block if it is better; that ends the poll, and so does a last block that holds none."""
        self.spent += points.shape[1]
        best = int(costs.argmin()) if costs.size else 0
        if costs.size and costs[best] < self.cost:
            self.asked.clear()
            self.point, self.cost, self.failed = points[:, best].copy(), float(costs[best]), False
            self.way.append(self.point)
            self.row += 1
            if self.row == _IN_SUCCESSION:
                self.width, self.row = min(_GROW * self.width, _LARGEST), 0
        elif not self.asked:
            self.failed = True
            self.width, self.row = _SHRINK * self.width, 0
        if not self.asked:
            self.course.append(self.cost)

    def end(self) -> PatternEnd:
        """Where it ended."""
        values, polls = tuple(self.point.tolist()), len(self.course) - 1
        return PatternEnd(values, self.cost, self.width, polls, self.spent, self.reason)


def _finite(cost: ArrayLike) -> Array:
    cost = np.asarray(cost, float)
    return np.where(np.isnan(cost), np.inf, cost)


def _check(
    point: Array,
    low: Array,
    high: Array,
    iterations: int,
    evaluations: int | None,
    patience: int | None,
    mesh: float,
    smallest: float,
) -> None:
    if point.ndim != 2 or low.shape != high.shape or low.shape != (len(point),):
        raise SettingsError(f"begins {point.shape}, low {low.shape} and high {high.shape} do not fit together")
    if not (np.isfinite(low).all() and np.isfinite(high).all() and np.all(low <= high) and np.isfinite(point).all()):
        raise SettingsError("a pattern search needs finite begins and bounds with low <= high")
    for name, limit in (("iterations", iterations), ("evaluations", evaluations), ("patience", patience)):
        if limit is not None and limit < 1:
            raise SettingsError(f"{name} {limit}: at least 1 is needed")
    if not 0.0 < smallest <= mesh <= _LARGEST:
        raise SettingsError(f"mesh {mesh:g} and smallest {smallest:g}: 0 < smallest <= mesh <= {_LARGEST:g} is needed")
