"""Bounded least squares on the simulation error: all starts side by side, derivatives in the same simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.levenberg_marquardt import NormalEquations, levenberg_marquardt_step
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = [
    "SAME_OPTIMUM_RTOL",
    "Optimum",
    "OptimumWithJacobian",
    "evaluate",
    "fit_many",
    "fit_to_convergence",
    "neighbours",
    "normal_equations",
    "polish",
]

_STEP = 1e-6  # of a forward difference, in the searched scale
_FIRST_DAMPING = 1e-2
_LAST_DIGITS = 1e-7  # tolerance of the final descent
_FACTORS = (0.03, 0.3, 3.0, 30.0)  # of the last damping, that are tried
_LEAST, _MOST = 1e-9, 1e12  # damping
_FADING = 0.5  # per round, of what the damping is relative to where the derivatives have become smaller
_CAP_LOG, _CAP_LINEAR = 2.0, 0.5  # longest step of a parameter: e^2 times, half of the range
_HARDLY, _LITTLE = 1e-6, 0.1  # damping of the step that promises most; part of the tolerance that is not worth it
_MUCH = 3.0  # times the tolerance: what is worth it of more damped steps; at bounds the least damped may be a bad one
_QUIET = 2  # rounds in which the cost may fall by less than the tolerance
_EARLY, _PATIENCE = 4, 8  # rounds before a start has to promise to arrive at all, and soon
_WATCHED = 4  # rounds whose descent is counted on to go on
_AHEAD = 10  # rounds of such descent within which a start has to reach the best one
_EVERY = 4  # rounds between two looks for starts that have met
_SAME_COST, _SAME_PLACE = 1e-2, 1e-3  # relative to the cost: two starts that have met
SAME_OPTIMUM_RTOL = 5e-3
"""Relative to the cost: two starts that have come to the same optimum."""


class OptimumWithJacobian(NamedTuple):
    """Where a descent ended.

    Attributes
    ----------
    values : ndarray, shape (P,)
        SI.
    cost : float
        Sum of squared weighted residuals.
    converged : bool
    evaluations : int
        Batches of simulations.
    simulations : int
        Parameter sets that were simulated.
    residual : ndarray, shape (residuals,)
    jacobian : ndarray, shape (residuals, P)
        Of the residuals by the parameters in the searched scale.
    """

    values: Array
    cost: float
    converged: bool
    evaluations: int
    simulations: int
    residual: Array
    jacobian: Array


class Optimum(NamedTuple):
    """Where one of many descents ended.

    Attributes
    ----------
    values : ndarray, shape (P,)
        SI.
    cost : float
    converged : bool
    evaluations : int
        Batches of simulations.
    simulations : int
        Parameter sets that were simulated.
    curvature : ndarray, shape (P, P)
        J' J there, by the parameters in the searched scale.
    """

    values: Array
    cost: float
    converged: bool
    evaluations: int
    simulations: int
    curvature: Array


def neighbours(theta: Array, search: ParameterSpace) -> tuple[Array, Array]:
    """Steps of the forward differences, away from the nearer bound, and SI values of start and neighbours.

    For `theta` of shape (S, P): shapes (S, P) and (P, S, 1 + P).
    """
    low, high = search.box
    steps = np.where(theta + _STEP <= high, _STEP, -_STEP)
    steps = np.where((steps < 0) & (theta - _STEP < low), _STEP, steps)
    count = theta.shape[1]
    sets = np.repeat(theta.T[:, :, None], 1 + count, axis=2)
    for i in range(count):
        sets[i, :, 1 + i] += steps[:, i]
    log = search.log[:, None, None]
    return steps, np.where(log, np.exp(np.where(log, sets, 0.0)), sets * search.width[:, None, None])


def evaluate(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, theta: Array
) -> tuple[Array, Array]:
    """Residuals, shape (residuals,), and Jacobian, shape (residuals, P), at `theta` (searched scale).

    The parameter set itself leads, its neighbours take the same steps, all in one call.
    """
    steps, sets = neighbours(theta[None, :], search)
    r = problem.residuals(search.named(sets[:, 0, :]), settings, group=1 + len(theta))
    return r[:, 0], (r[:, 1:] - r[:, :1]) / steps[0]


def normal_equations(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, theta: Array
) -> NormalEquations:
    """Cost, gradient and J' J at `theta`, shape (S, P), of all starts in one call of the simulation."""
    starts, count = theta.shape
    steps, sets = neighbours(theta, search)
    total = problem.normal_products(search.named(sets.reshape(count, starts * (1 + count))), settings, 1.0 / steps)
    total = np.tril(total) + np.tril(total, -1).transpose(0, 2, 1)
    return NormalEquations(total[:, 0, 0], total[:, 1:, 0], total[:, 1:, 1:])


@dataclass
class _Batch:
    """Starts that are still on their way: their numbers, where they are and how they got there."""

    number: NDArray[np.int64]
    theta: Array
    normal: NormalEquations
    scale: Array
    damped: Array
    quiet: NDArray[np.int64]
    history: Array
    simulations: NDArray[np.int64]

    @classmethod
    def at(cls, theta: Array, first: NormalEquations) -> _Batch:
        """All starts at `theta`, shape (S, P)."""
        starts = len(theta)
        return cls(
            np.arange(starts),
            theta,
            first,
            np.einsum("sii->si", first.curvature).copy(),
            np.full(starts, _FIRST_DAMPING),
            np.zeros(starts, np.int64),
            np.repeat(first.cost[:, None], _WATCHED, axis=1),
            np.full(starts, 1 + theta.shape[1]),
        )

    def keep(self, which: NDArray[np.bool_]) -> _Batch:
        """Those of some starts."""
        rest = (getattr(self, f) for f in ("scale", "damped", "quiet", "history", "simulations"))
        return _Batch(self.number[which], self.theta[which], self.normal.of(which), *(a[which] for a in rest))


def fit_many(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    begins: Array,
    *,
    limit: int = 50,
    tolerance: float = 1e-4,
    cost_to_beat: float | None = None,
    stop_when: Callable[[Array], bool] | None = None,
    min_agreeing: int = 1,
) -> list[Optimum]:
    """Least squares from many starts side by side.

    Parameters
    ----------
    problem : SimulationErrorProblem
    search : ParameterSpace
    settings : Settings
    begins : ndarray, shape (P, S)
        SI.
    limit : int
        Rounds. In each, some dampings are tried for every start that is still on its way, and the derivatives
        are taken where the best of them leads.
    tolerance : float
        A start has converged when its cost falls by less than this part of itself, twice in succession.
    rival : float, optional
        Least cost known so far (infinite if there is none). With it, starts compete: those that meet a better one
        are ended, and so are those that would not reach the best one if they went on falling as they do.
        An end then depends on the other starts.
    content : callable, optional
        ``content(residual)``, residuals of the best start if it has converged: if true, all others are ended.
    needed : int
        So many starts have to have come to the least cost before that is asked.

    Returns
    -------
    list of End
        In the order of `begins`.
    """
    low, high = search.box
    theta = np.clip(search.to_scaled(begins).T, low, high)
    field = _Batch.at(theta, normal_equations(problem, search, settings, theta))
    if not len(search.names):
        return [_end(search, field, i, True, 1) for i in range(len(theta))]
    ends: dict[int, Optimum] = {}
    for turn in range(1, limit + 1):
        field = _round(problem, search, settings, field, tolerance)
        converged = field.quiet >= _QUIET
        going = ~converged
        if cost_to_beat is not None and turn >= _EARLY:
            ahead = limit - turn if turn < _PATIENCE else _AHEAD
            least = min([cost_to_beat, float(field.normal.cost.min()), *(end.cost for end in ends.values())])
            going &= ~_hopeless(field, least, ahead)
        if cost_to_beat is not None and turn % _EVERY == 0:
            going &= ~_met(field)
        if stop_when is not None:
            best = _settled(field, converged, list(ends.values()), min_agreeing)
            if best is not None:
                values = search.from_scaled(field.theta[best])[:, None]
                field.simulations[best] += 1
                if stop_when(problem.residuals(search.named(values), settings)[:, 0]):
                    going[:] = False
        for i in np.flatnonzero(~going).tolist():
            ends[int(field.number[i])] = _end(search, field, i, bool(converged[i]), turn)
        field = field.keep(going)
        if not len(field.number):
            break
    for i, number in enumerate(field.number.tolist()):
        ends[number] = _end(search, field, i, False, limit)
    return [ends[i] for i in range(len(theta))]


def _end(search: ParameterSpace, field: _Batch, i: int, converged: bool, turns: int) -> Optimum:
    cost, simulations = float(field.normal.cost[i]), int(field.simulations[i])
    return Optimum(
        search.from_scaled(field.theta[i]), cost, converged, 1 + 2 * turns, simulations, field.normal.curvature[i]
    )


def _round(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, field: _Batch, tolerance: float
) -> _Batch:
    """One step of every start with the best of some dampings."""
    low, high = search.box
    cap = np.where(search.log, _CAP_LOG, _CAP_LINEAR)
    factors = np.array(_FACTORS)
    starts, count = field.theta.shape
    each = np.repeat(np.arange(starts), 1 + len(factors))
    damped = np.column_stack([np.full(starts, _HARDLY), field.damped[:, None] * factors])
    changes = levenberg_marquardt_step(
        field.theta[each], field.normal.of(each), field.scale[each], damped.ravel(), low, high, cap
    )
    changes = changes.reshape(starts, -1, count)
    promised = _promise(field.normal, changes)
    enough = tolerance * field.normal.cost
    done = (promised[:, 0] < _LITTLE * enough) & (promised[:, 1:].max(axis=1) < _MUCH * enough)
    tried = field.theta[:, None] + changes[:, 1:]
    costs = np.full(tried.shape[:2], np.inf)
    if not done.all():
        outward = search.from_scaled(tried[~done].reshape(-1, count).T)
        costs[~done] = problem.costs(search.named(outward), settings).reshape(-1, len(factors))
    best = costs.argmin(axis=1)
    row = np.arange(len(best))
    better = costs[row, best] < field.normal.cost
    theta = np.where(better[:, None], tried[row, best], field.theta)
    now = field.normal
    if better.any():
        fresh = normal_equations(problem, search, settings, theta[better])
        now = NormalEquations(*(_with(old, better, new) for old, new in zip(now, fresh, strict=True)))
    fall = field.normal.cost - now.cost
    return _Batch(
        field.number,
        theta,
        now,
        np.maximum(_FADING * field.scale, np.einsum("sii->si", now.curvature)),
        np.clip(field.damped * np.where(better, factors[best], _FACTORS[-1] ** 2), _LEAST, _MOST),
        np.where(done, _QUIET, np.where(fall > tolerance * field.normal.cost, 0, field.quiet + 1)),
        np.hstack([field.history[:, 1:], now.cost[:, None]]),
        field.simulations + np.where(done, 0, len(factors)) + np.where(better, 1 + count, 0),
    )


def _promise(normal: NormalEquations, changes: Array) -> Array:
    """Fall of the cost, shape (S, D), that the quadratic picture promises for steps `changes`, shape (S, D, P)."""
    slope = 2.0 * normal.gradient[:, None] + changes @ normal.curvature
    return np.asarray(-(slope * changes).sum(axis=2))


def _with(old: Array, where: NDArray[np.bool_], new: Array) -> Array:
    out = old.copy()
    out[where] = new
    return out


def _hopeless(field: _Batch, least: float, ahead: int) -> NDArray[np.bool_]:
    """Starts that would not reach the least cost in `ahead` rounds if they went on falling as in the last ones."""
    cost = np.maximum(field.normal.cost, 1e-300)
    fall = np.log(np.maximum(field.history[:, 0], cost) / cost) / (_WATCHED - 1)
    return np.asarray(np.log(cost / max(least, 1e-300)) > ahead * fall + _SAME_COST)


def _settled(field: _Batch, converged: NDArray[np.bool_], ended: Sequence[Optimum], needed: int) -> int | None:
    """Start that has converged to the least cost, if as many as `needed` have come to it."""
    here = field.normal.cost
    costs = np.array([*here, *(end.cost for end in ended)])
    best = int(here.argmin())
    agree = int(np.sum(costs <= (1.0 + SAME_OPTIMUM_RTOL) * costs.min()))
    return (
        best if converged[best] and here[best] <= (1.0 + SAME_OPTIMUM_RTOL) * costs.min() and agree >= needed else None
    )


def _met(field: _Batch) -> NDArray[np.bool_]:
    """Starts from which a better one differs by less than the recording can show."""
    out = np.zeros(len(field.number), bool)
    order = np.argsort(field.normal.cost, kind="stable")
    for rank, i in enumerate(order):
        for j in order[:rank]:
            if out[j] or field.normal.cost[i] > (1.0 + _SAME_COST) * field.normal.cost[j]:
                continue
            apart = field.theta[i] - field.theta[j]
            if apart @ field.normal.curvature[j] @ apart <= _SAME_PLACE * field.normal.cost[j]:
                out[i] = True
                break
    return out


def fit_to_convergence(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, start: Array, *, limit: int = 50
) -> OptimumWithJacobian:
    """Least squares from `start`, shape (P,), SI values, to the last digits that the simulation gives."""
    end = polish(problem, search, settings, start, limit=limit)
    residual, jacobian = evaluate(problem, search, settings, search.to_scaled(end.values))
    return OptimumWithJacobian(*end[:4], end.simulations + 1 + len(end.values), residual, jacobian)


def polish(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    start: Array,
    *,
    limit: int = 50,
    tolerance: float = _LAST_DIGITS,
) -> Optimum:
    """:func:`descend` without residual and Jacobian, to `tolerance` of the cost."""
    (end,) = fit_many(problem, search, settings, start[:, None], limit=limit, tolerance=tolerance)
    return end
