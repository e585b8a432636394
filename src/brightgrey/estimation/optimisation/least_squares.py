"""Bounded least squares on the simulation error: many starts at once, with derivatives from the same simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, positive
from brightgrey.estimation.optimisation.levenberg_marquardt import NormalEquations, levenberg_marquardt_step
from brightgrey.estimation.optimisation.options import LM_DEFAULTS, LMOptions, RacingOptions
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

SAME_OPTIMUM_RTOL = 5e-3
"""Two starts have reached the same optimum if their costs differ by less than this part."""


class OptimumWithJacobian(NamedTuple):
    """Result of one fit, with residual and Jacobian."""

    values: Array  #: Free parameters, SI, shape (P,).
    cost: float  #: Sum of squared weighted residuals.
    converged: bool
    evaluations: int  #: Batches of simulations.
    simulations: int  #: Simulated parameter sets.
    residual: Array  #: Shape (residuals,).
    jacobian: Array  #: Derivatives of the residuals by the scaled parameters, shape (residuals, P).


class Optimum(NamedTuple):
    """Result of one of many fits."""

    values: Array  #: Free parameters, SI, shape (P,).
    cost: float  #: Sum of squared weighted residuals.
    converged: bool
    evaluations: int  #: Batches of simulations.
    simulations: int  #: Simulated parameter sets.
    curvature: Array  #: J' J by the scaled parameters, shape (P, P).


def neighbours(theta: Array, space: ParameterSpace, step: float = LM_DEFAULTS.difference_step) -> tuple[Array, Array]:
    """Forward differences away from the nearer bound, for `theta` of shape (S, P) in the scaled space.

    Returns
    -------
    ndarray, shape (S, P)
        Steps in the scaled space.
    ndarray, shape (P, S, 1 + P)
        SI values of each start and its neighbours.
    """
    low, high = space.box
    steps = np.where(theta + step <= high, step, -step)
    steps = np.where((steps < 0) & (theta - step < low), step, steps)
    count = theta.shape[1]
    sets = np.repeat(theta.T[:, :, None], 1 + count, axis=2)
    for i in range(count):
        sets[i, :, 1 + i] += steps[:, i]
    log = space.log[:, None, None]
    return steps, np.where(log, np.exp(np.where(log, sets, 0.0)), sets * space.width[:, None, None])


def evaluate(
    problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings, theta: Array
) -> tuple[Array, Array]:
    """Residuals, shape (residuals,), and Jacobian, shape (residuals, P), at `theta`, shape (P,), scaled.

    All parameter sets are simulated in one call, with the steps of the first one.
    """
    steps, sets = neighbours(theta[None, :], space)
    r = problem.residuals(space.named(sets[:, 0, :]), settings, group=1 + len(theta))
    return r[:, 0], (r[:, 1:] - r[:, :1]) / steps[0]


def normal_equations(
    problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings, theta: Array
) -> NormalEquations:
    """Cost, gradient and J' J of all starts `theta`, shape (S, P), scaled, in one call of the simulation."""
    starts, count = theta.shape
    steps, sets = neighbours(theta, space)
    total = problem.normal_products(space.named(sets.reshape(count, starts * (1 + count))), settings, 1.0 / steps)
    total = np.tril(total) + np.tril(total, -1).transpose(0, 2, 1)
    return NormalEquations(total[:, 0, 0], total[:, 1:, 0], total[:, 1:, 1:])


@dataclass
class _Batch:
    """Starts that have not ended: their index, position, normal equations and history; S rows each."""

    index: NDArray[np.int64]
    theta: Array
    normal: NormalEquations
    scale: Array
    damping: Array
    quiet: NDArray[np.int64]
    history: Array
    simulations: NDArray[np.int64]

    @classmethod
    def at(cls, theta: Array, first: NormalEquations, options: LMOptions) -> _Batch:
        """All starts at `theta`, shape (S, P)."""
        starts = len(theta)
        return cls(
            np.arange(starts),
            theta,
            first,
            np.einsum("sii->si", first.curvature).copy(),
            np.full(starts, options.initial_damping),
            np.zeros(starts, np.int64),
            np.repeat(first.cost[:, None], options.racing.observed_rounds, axis=1),
            np.full(starts, 1 + theta.shape[1]),
        )

    def keep(self, which: NDArray[np.bool_]) -> _Batch:
        """Keep the starts of a mask."""
        rest = (getattr(self, f) for f in ("scale", "damping", "quiet", "history", "simulations"))
        return _Batch(self.index[which], self.theta[which], self.normal.of(which), *(a[which] for a in rest))

    def optimum(self, space: ParameterSpace, i: int, converged: bool, rounds: int) -> Optimum:
        """Result of start i after some rounds."""
        values, cost = space.from_scaled(self.theta[i]), float(self.normal.cost[i])
        return Optimum(values, cost, converged, 1 + 2 * rounds, int(self.simulations[i]), self.normal.curvature[i])


def fit_many(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    starts: Array,
    *,
    limit: int = 50,
    tolerance: float = 1e-4,
    cost_to_beat: float | None = None,
    stop_when: Callable[[Array], bool] | None = None,
    min_agreeing: int = 1,
    options: LMOptions = LM_DEFAULTS,
) -> list[Optimum]:
    """Fit from many starts at once by Levenberg-Marquardt with several dampings per round.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    starts : ndarray, shape (P, S)
        SI.
    limit : int
        Largest number of rounds. In each, some dampings are tried for every start, and the derivatives are taken where
        the best of them leads.
    tolerance : float
        A start has converged when its cost falls by less than this part of itself, twice in succession.
    cost_to_beat : float, optional
        Least cost known so far (infinite if there is none). If given, starts compete: those that meet a better one,
        or would not reach the best cost at their rate of descent, are stopped. A result then depends on the other
        starts.
    stop_when : callable, optional
        ``stop_when(residual)`` of the best start if it has converged: if true, all others are stopped.
    min_agreeing : int
        Number of starts that have to reach the least cost before `stop_when` is asked.
    options : LMOptions

    Returns
    -------
    list of Optimum
        In the order of `starts`.
    """
    low, high = space.box
    theta = np.clip(space.recentred(space.to_scaled(starts).T), low, high)
    batch = _Batch.at(theta, normal_equations(problem, space, settings, theta), options)
    if not len(space.names):
        return [batch.optimum(space, i, True, 1) for i in range(len(theta))]
    optima: dict[int, Optimum] = {}
    for turn in range(1, limit + 1):
        batch = _round(problem, space, settings, batch, tolerance, options)
        converged = batch.quiet >= options.quiet_rounds
        active = ~converged
        if cost_to_beat is not None:
            best = min([cost_to_beat, float(batch.normal.cost.min()), *(o.cost for o in optima.values())])
            active &= ~_outraced(batch, best, turn, limit, options.racing)
        leader = _agreed_leader(batch, converged, list(optima.values()), min_agreeing) if stop_when else None
        if stop_when is not None and leader is not None:
            values = space.from_scaled(batch.theta[leader])[:, None]
            batch.simulations[leader] += 1
            active &= not stop_when(problem.residuals(space.named(values), settings)[:, 0])
        for i in np.flatnonzero(~active).tolist():
            optima[int(batch.index[i])] = batch.optimum(space, i, bool(converged[i]), turn)
        batch = batch.keep(active)
        if not len(batch.index):
            break
    for i, index in enumerate(batch.index.tolist()):
        optima[index] = batch.optimum(space, i, False, limit)
    return [optima[i] for i in range(len(theta))]


def _round(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    batch: _Batch,
    tolerance: float,
    options: LMOptions,
) -> _Batch:
    """Take one step of every start with the best of some dampings."""
    factors, count = np.array(options.damping_factors), batch.theta.shape[1]
    steps, done = _damped_steps(space, batch, tolerance, options)
    candidates = space.recentred(batch.theta[:, None] + steps)
    costs = np.full(candidates.shape[:2], np.inf)
    if not done.all():
        values = space.from_scaled(candidates[~done].reshape(-1, count).T)
        costs[~done] = problem.costs(space.named(values), settings).reshape(-1, len(factors))
    best = costs.argmin(axis=1)
    row = np.arange(len(best))
    better = costs[row, best] < batch.normal.cost
    theta = np.where(better[:, None], candidates[row, best], batch.theta)
    normal = batch.normal
    if better.any():
        new = normal_equations(problem, space, settings, theta[better])
        normal = NormalEquations(*(_replaced(a, better, b) for a, b in zip(normal, new, strict=True)))
    decrease = batch.normal.cost - normal.cost
    quiet = np.where(decrease > tolerance * batch.normal.cost, 0, batch.quiet + 1)
    damping = batch.damping * np.where(better, factors[best], factors[-1] ** 2)
    return _Batch(
        batch.index,
        theta,
        normal,
        np.maximum(options.scale_decay * batch.scale, np.einsum("sii->si", normal.curvature)),
        np.clip(damping, options.min_damping, options.max_damping),
        np.where(done, options.quiet_rounds, quiet),
        np.hstack([batch.history[:, 1:], normal.cost[:, None]]),
        batch.simulations + np.where(done, 0, len(factors)) + np.where(better, 1 + count, 0),
    )


def _damped_steps(
    space: ParameterSpace, batch: _Batch, tolerance: float, options: LMOptions
) -> tuple[Array, NDArray[np.bool_]]:
    """Steps, shape (S, dampings, P), and a mask of the starts whose predicted decrease is not worth a simulation."""
    low, high = space.box
    max_step = np.where(space.log, options.max_log_step, options.max_linear_step)
    starts, count = batch.theta.shape
    each = np.repeat(np.arange(starts), 1 + len(options.damping_factors))
    probe = np.full(starts, options.probe_damping)
    damping = np.column_stack([probe, batch.damping[:, None] * np.array(options.damping_factors)]).ravel()
    normal, scale = batch.normal.of(each), batch.scale[each]
    steps = levenberg_marquardt_step(batch.theta[each], normal, scale, damping, low, high, max_step, options)
    steps = steps.reshape(starts, -1, count)
    decrease, enough = _predicted_decrease(batch.normal, steps), tolerance * batch.normal.cost
    by_probe = decrease[:, 0] < options.negligible_decrease * enough
    return steps[:, 1:], by_probe & (decrease[:, 1:].max(axis=1) < options.negligible_damped_decrease * enough)


def _predicted_decrease(normal: NormalEquations, steps: Array) -> Array:
    """Decrease of the cost, shape (S, D), by its quadratic model for steps of shape (S, D, P)."""
    slope = 2.0 * normal.gradient[:, None] + steps @ normal.curvature
    return np.asarray(-(slope * steps).sum(axis=2))


def _replaced(old: Array, where: NDArray[np.bool_], new: Array) -> Array:
    out = old.copy()
    out[where] = new
    return out


def _outraced(batch: _Batch, best: float, turn: int, limit: int, racing: RacingOptions) -> NDArray[np.bool_]:
    """Mask of the starts that lose against the `best` cost, or meet a better start, in this turn."""
    out = np.zeros(len(batch.index), bool)
    if turn >= racing.first_round:
        ahead = limit - turn if turn < racing.patience else racing.horizon
        cost = positive(batch.normal.cost)
        rate = np.log(np.maximum(batch.history[:, 0], cost) / cost) / (racing.observed_rounds - 1)
        out |= np.log(cost / positive(best)) > ahead * rate + racing.same_cost
    if turn % racing.comparison_interval == 0:
        out |= _met(batch, racing)
    return out


def _met(batch: _Batch, racing: RacingOptions) -> NDArray[np.bool_]:
    """Mask of the starts that differ from a better one by less than the recording can show."""
    out = np.zeros(len(batch.index), bool)
    order = np.argsort(batch.normal.cost, kind="stable")
    for rank, i in enumerate(order):
        for j in order[:rank]:
            if out[j] or batch.normal.cost[i] > (1.0 + racing.same_cost) * batch.normal.cost[j]:
                continue
            difference = batch.theta[i] - batch.theta[j]
            if difference @ batch.normal.curvature[j] @ difference <= racing.same_place * batch.normal.cost[j]:
                out[i] = True
                break
    return out


def _agreed_leader(
    batch: _Batch, converged: NDArray[np.bool_], ended: Sequence[Optimum], min_agreeing: int
) -> int | None:
    """Start that has converged to the least cost, if `min_agreeing` starts have reached it; else None."""
    here = batch.normal.cost
    costs = np.array([*here, *(optimum.cost for optimum in ended)])
    leader, same = int(here.argmin()), (1.0 + SAME_OPTIMUM_RTOL) * costs.min()
    agreed = converged[leader] and here[leader] <= same and int(np.sum(costs <= same)) >= min_agreeing
    return leader if agreed else None


def fit_to_convergence(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    start: Array,
    *,
    limit: int = 50,
    tolerance: float = LM_DEFAULTS.final_tolerance,
) -> OptimumWithJacobian:
    """Fit from `start`, shape (P,), SI, with residual and Jacobian; by default to the last digits of the simulation."""
    end = polish(problem, space, settings, start, limit=limit, tolerance=tolerance)
    residual, jacobian = evaluate(problem, space, settings, space.to_scaled(end.values))
    return OptimumWithJacobian(*end[:4], end.simulations + 1 + len(end.values), residual, jacobian)


def polish(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    start: Array,
    *,
    limit: int = 50,
    tolerance: float = LM_DEFAULTS.final_tolerance,
) -> Optimum:
    """Fit from `start`, shape (P,), SI, until the cost falls by less than `tolerance` of itself."""
    (end,) = fit_many(problem, space, settings, start[:, None], limit=limit, tolerance=tolerance)
    return end
