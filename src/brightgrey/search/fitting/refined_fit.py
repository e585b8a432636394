"""Refined fits: those of the table at level ``accurate``, polished in the whitened cost of a round."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import INERTIA, STIFFNESS
from brightgrey.estimation.noise.error_floor import error_variances
from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, evaluate
from brightgrey.estimation.optimisation.levenberg_marquardt import NormalEquations, levenberg_marquardt_step
from brightgrey.estimation.optimisation.options import LM_DEFAULTS
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.segments import segment_lengths
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Placed, Structure, slowest_resonance
from brightgrey.search import adequacy
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.fitting.warm_start import handed_down
from brightgrey.search.lattice import complexity, minimal_supermodels
from brightgrey.search.parallel import in_dependency_order, in_order
from brightgrey.search.policy import BORDER, REFINEMENT
from brightgrey.search.task import IdentificationTask

__all__ = [
    "Refined",
    "RefinedFits",
    "ResidualFilter",
    "accurate",
    "refine",
    "residual_and_jacobian",
    "stands_for",
    "whitening_by",
]


@dataclass(frozen=True)
class Refined:
    """A structure at level ``accurate``."""

    structure: Structure
    values: Mapping[str, float]  #: SI, those that were estimated first.
    deviance: float  #: Whitened sum of squared residuals, noise of variance 1, with the share of the error floor.
    cost: float  #: Weighted sum of squared residuals.
    free: int  #: Number of estimated parameters.
    at_bound: tuple[str, ...]  #: Parameters at a bound.
    finished: bool  #: False if it was given up as hopeless.
    spent: SimulationCount

    def runaway(self, effect: str, task: IdentificationTask) -> bool:
        """True for masses or a gap of which a parameter has run to a bound that the user did not set.

        As a wall, an inert mass that has vanished, or without damping, they follow what they do not stand for.
        """
        placed = next((p for p in self.structure.placed if stands_for(p, effect)), None)
        if placed is None or not (placed.effect.masses or placed.effect.has_hard_limit):
            return False
        last = placed.effect.masses
        ran = {n for n in self.at_bound if n not in task.bounds}
        of_last = [q.symbol for q in placed.effect.parameters if not last or q.dimension in (INERTIA, STIFFNESS)]
        return bool(ran & {placed.parameter(symbol) for symbol in of_last})

    def swings_slowly(self, task: IdentificationTask) -> bool:
        """True if the slowest mode of the masses, undamped, swings less than twice in the longest recording.

        That follows any drift, so no start has such a mode. One mass has none.
        """
        longest = max(float(r.t[-1] - r.t[0]) for r in task.recordings)
        return slowest_resonance(self.structure, self.values) * longest < 2.0 * (2.0 * np.pi)


def stands_for(placed: Placed, effect: str) -> bool:
    """Return True if a placed effect is `effect`, or brings at least as many masses."""
    asked = Placed.parse(effect)
    return placed.effect.masses >= asked.effect.masses > 0 if asked.effect.masses else placed == asked


def accurate(task: IdentificationTask) -> IdentificationTask:
    """The task at level ``accurate``."""
    return replace(task, settings=replace(task.settings, level="accurate"))


def residual_and_jacobian(
    task: IdentificationTask, structure: Structure, values: Mapping[str, float]
) -> tuple[Array, Array, tuple[int, ...]]:
    """Weighted residuals and their Jacobian at level ``accurate``, and its columns of parameters not at a bound."""
    problem, space = task.problem_and_space(structure)
    start = np.clip([values.get(n, v) for n, v in zip(space.names, space.start, strict=True)], space.low, space.high)
    residual, jacobian = evaluate(problem, space, accurate(task).settings, space.to_scaled(start))
    return residual, jacobian, tuple(np.flatnonzero(space.active_bounds(start) == 0).tolist())


def whitening_by(task: IdentificationTask, structure: Structure, values: Mapping[str, float]) -> Whitening:
    """Whitening by the residuals of a fit, with the error floor of simulation and sensor."""
    residual, jacobian, inside = residual_and_jacobian(task, structure, values)
    lengths = segment_lengths(task.recordings)
    floor = error_variances(task.recordings, task.problem(structure).weights).ravel()
    return Whitening.of(residual, jacobian[:, list(inside)], lengths, floor.tolist())


class ResidualFilter(Protocol):
    """Choice of what the sum of squares of a fit counts of its residuals: whitened ones, or some of them."""

    @property
    def floor_deviance(self) -> float:
        """Expected sum of squares of the errors of simulation and sensor."""

    def whiten(self, residuals: Array) -> Array:
        """Counted part of residuals, shape (residuals,), or of their Jacobian, shape (residuals, P)."""


def refine(
    task: IdentificationTask,
    structure: Structure,
    values: Mapping[str, float],
    whitening: ResidualFilter,
    hopeless: float,
    material_growth: float = 0.0,
) -> Refined:
    """Fit from `values` in the whitened cost until the next step would lower it by less than chance can tell.

    Parameters
    ----------
    task : IdentificationTask
    structure : Structure
    values : mapping of str to float
        SI.
    whitening : ResidualFilter
    hopeless : float
        Deviance above which the exact value does not matter: one step is predicted, but not taken.
    material_growth : float
        Growth of the deviance, as a part of it, that does not matter; a small part of it is not worth a step either.
    """
    problem, space = task.problem_and_space(structure)
    settings = accurate(task).settings
    start = np.clip([values.get(n, v) for n, v in zip(space.names, space.start, strict=True)], space.low, space.high)
    theta, damping = space.to_scaled(start), LM_DEFAULTS.initial_damping
    residual, jacobian = evaluate(problem, space, settings, theta)
    simulations, finished, scale, last = 1 + len(theta), True, np.zeros(len(theta)), np.inf
    for turn in range(REFINEMENT.iterations):
        white, slopes = whitening.whiten(residual), whitening.whiten(jacobian)
        cost = float(white @ white)
        normal = NormalEquations(np.array([cost]), (white @ slopes)[None, :], (slopes.T @ slopes)[None, :, :])
        scale = np.maximum(LM_DEFAULTS.scale_decay * scale, np.diag(normal.curvature[0]))
        factors = np.array([LM_DEFAULTS.probe_damping, *(damping * f for f in LM_DEFAULTS.damping_factors)])
        steps = _steps(theta, normal, scale, factors, space)
        gain = -(2.0 * steps @ normal.gradient[0] + np.einsum("sp,pq,sq->s", steps, normal.curvature[0], steps))
        enough = max(REFINEMENT.negligible, max(REFINEMENT.relative, REFINEMENT.of_material * material_growth) * cost)
        if gain.max(initial=0.0) < enough or last - cost < 0.1 * enough:
            break
        if cost - gain.max() > hopeless:
            cost, finished = cost - float(gain.max()), False
            break
        if turn == REFINEMENT.iterations - 1:
            break
        best, reached = 1 + REFINEMENT.first_factor, np.inf
        if turn and gain[best] <= LM_DEFAULTS.racing.same_cost * cost:  # near the optimum one step will do
            found, slopes = evaluate(problem, space, settings, theta + steps[best])
            simulations, reached = simulations + 1 + len(theta), float(np.square(whitening.whiten(found)).sum())
        if not cost - reached >= REFINEMENT.predicted * max(gain[best], 0.0):
            tried = space.from_scaled((theta + steps[1:]).T)
            costs = np.square(whitening.whiten(problem.residuals(space.named(tried), settings))).sum(axis=0)
            best = 1 + int(np.argmin(costs))
            simulations += tried.shape[1]
            if not costs[best - 1] < cost:
                break
            found, slopes = evaluate(problem, space, settings, theta + steps[best])
            simulations += 1 + len(theta)
        last, theta, residual, jacobian = cost, space.recentred(theta + steps[best]), found, slopes
        damping = float(np.clip(factors[best], LM_DEFAULTS.min_damping, LM_DEFAULTS.max_damping))
    end = space.from_scaled(theta[:, None])[:, 0]
    sides = zip(space.names, space.active_bounds(end), strict=True)
    bound = [n for n, side in sides if side and n in structure.parameters]
    return Refined(
        structure,
        dict(zip(space.names, end.tolist(), strict=True)) | dict(space.fixed),
        cost + whitening.floor_deviance,
        float(residual @ residual),
        len(space.names),
        tuple(bound),
        finished,
        problem.count(simulations),
    )


def _refine_from_larger(
    task: IdentificationTask,
    own: Refined,
    larger: Refined,
    whitening: ResidualFilter,
    hopeless: float,
    material_growth: float,
) -> Refined | None:
    """Fit anew from the optimum of a larger structure, if that leaves less as it is; None if it does not.

    The larger one may hardly use what it has more. The other parameters as in `refine`.
    """
    problem, space = task.problem_and_space(own.structure)
    starts = handed_down(larger.values, None, larger.structure, own.structure, space)
    given = [[values.get(n, v) for n, v in zip(space.names, space.start, strict=True)] for values in starts]
    tried = np.clip(np.array(given).T, space.low[:, None], space.high[:, None])
    residuals = problem.residuals(space.named(tried), accurate(task).settings)
    deviances = np.square(whitening.whiten(residuals)).sum(axis=0) + whitening.floor_deviance
    best = int(np.argmin(deviances))
    if not deviances[best] < own.deviance - REFINEMENT.negligible:
        return None
    values = {**own.values, **dict(zip(space.names, tried[:, best].tolist(), strict=True))}
    return refine(task, own.structure, values, whitening, hopeless, material_growth)


def _steps(theta: Array, normal: NormalEquations, scale: Array, factors: Array, space: ParameterSpace) -> Array:
    """Steps of one fit with several damping factors, shape (factors, P)."""
    if not len(theta):
        return np.zeros((len(factors), 0))
    longest = np.where(space.log, LM_DEFAULTS.max_log_step, LM_DEFAULTS.max_linear_step)
    many = (len(factors), 1)
    every = normal.of(np.zeros(len(factors), int))
    low, high = space.box
    return levenberg_marquardt_step(
        np.tile(theta, many), every, np.tile(scale, many), factors, low, high, longest, LM_DEFAULTS
    )


class RefinedFits:
    """Refined fits of the structures of a table, made when they are asked for and again when the table has better ones.

    Parameters
    ----------
    task : IdentificationTask
        That of the table.
    fits : FitTable
    executor : Executor
    """

    def __init__(self, task: IdentificationTask, fits: FitTable, executor: Executor) -> None:
        self.fits, self.task, self._executor = fits, task, executor
        self._refined: dict[Structure, tuple[float, Refined]] = {}
        self._beyond: dict[Structure, Refined] = {}
        self._jacobians: dict[Structure, tuple[Refined, tuple[Array, Array, tuple[int, ...]]]] = {}
        self._starts: dict[Structure, Mapping[str, float]] = {}
        self._handed: set[tuple[Structure, Structure, float]] = set()
        self._whitening: Whitening | None = None
        self.model_error = False

    @property
    def whitening(self) -> Whitening:
        """Whitening of the present round."""
        if self._whitening is None:
            raise RuntimeError("begin_round comes first")
        return self._whitening

    @property
    def material_growth(self) -> float:
        """Growth of a deviance in this round, as a part of it, that does not matter."""
        return adequacy.material_growth(model_error=self.model_error)

    def begin_round(self, reference: Structure, *, model_error: bool = False) -> None:
        """Whiten by the residuals of a structure from now on; all deviances are new.

        With model error no optimum is the truth. Deviances need not be as exact then, and optima are not handed down.
        """
        self.model_error = model_error
        known = self._refined.get(reference)
        values = known[1].values if known else self.fits.done[reference].values
        self._whitening = whitening_by(self.task, reference, values)
        self._starts = {s: r.values for s, (_, r) in self._refined.items()}
        self._refined.clear()
        self._beyond.clear()
        self._handed.clear()

    def adopt(self, refined: Refined) -> None:
        """Keep a refined fit of a structure that has no place in the table, until the round ends."""
        self._beyond[refined.structure] = refined

    def all(self, threshold: Callable[[float], float]) -> dict[Structure, Refined]:
        """Refined fits of all structures of the table but those that have redundant effects in the whitened cost, too.

        Parameters
        ----------
        threshold : callable
            Of the least deviance: what exceeds it by several times as much does not matter.
        """
        stale = [f for s, f in self.fits.done.items() if not f.redundant_effects and self._is_stale(f)]
        if not self._refined:
            self._refine([min(stale, key=lambda f: f.cost)], np.inf)
        least = min(r.deviance for _, r in self._refined.values())
        hopeless = least + BORDER.far * threshold(least)
        self._refine([f for f in stale if self._is_stale(f)], hopeless)
        if not self.model_error:
            self._hand_down(hopeless)
            self._refine_redundant(least, hopeless)
        return {s: r for s, (_, r) in self._refined.items()}

    def of(self, structure: Structure) -> Refined:
        """Refined fit of a structure, which is fitted if it is neither adopted nor in the table."""
        if structure in self._beyond:
            return self._beyond[structure]
        if structure not in self.fits.done:
            self.fits.add([structure], self._executor)
        fitted = self.fits.done[structure]
        if self._is_stale(fitted) or not self._refined[structure][1].finished:
            self._refine([fitted], np.inf)
        return self._refined[structure][1]

    def of_all(self, structures: Sequence[Structure]) -> list[Refined]:
        """Refined fits of structures, made in parallel."""
        self.fits.add([s for s in structures if s not in self.fits.done], self._executor)
        known = [self.fits.done[s] for s in dict.fromkeys(structures)]
        self._refine([f for f in known if self._is_stale(f) or not self._refined[f.structure][1].finished], np.inf)
        return [self._refined[s][1] for s in structures]

    def optimum(self, structure: Structure) -> OptimumWithJacobian:
        """Refined fit with its weighted residuals and their Jacobian."""
        refined = self.of(structure)
        space = self.task.problem_and_space(structure)[1]
        residual, jacobian, _ = self.jacobian(structure)
        values = np.array([refined.values[name] for name in space.names])
        return OptimumWithJacobian(values, float(residual @ residual), True, 0, 0, residual, jacobian)

    def jacobian(self, structure: Structure) -> tuple[Array, Array, tuple[int, ...]]:
        """Weighted residuals and their Jacobian, and its columns of parameters that are not at a bound."""
        refined = self.of(structure)
        known = self._jacobians.get(structure)
        if known is None or known[0] is not refined:
            found = residual_and_jacobian(self.task, structure, refined.values)
            known = self._jacobians[structure] = refined, found
        return known[1]

    def _is_stale(self, fitted: StructureFit) -> bool:
        known = self._refined.get(fitted.structure)
        return known is None or known[0] > fitted.cost

    def _refine_redundant(self, least: float, hopeless: float) -> None:
        """Fit structures with effects that explain nothing in the plain cost: they may in the whitened one.

        That matters where more is left without them than chance explains.
        """
        asked, enough = [], least + adequacy.gained_by_chance(1)
        for s, f in self.fits.done.items():
            if f.equals in self._refined and s not in self._refined:
                without = self._refined[f.equals][1]
                offer = s, f.equals, without.deviance
                if without.finished and without.deviance > enough and offer not in self._handed:
                    asked.append((f, without, self._starts.get(s, {**f.values, **without.values})))
                    self._handed.add(offer)
        calls = [(self.task, f.structure, v, self.whitening, hopeless, self.material_growth) for f, _, v in asked]
        for (f, without, _), found in zip(asked, in_order(self._executor, refine, calls), strict=True):
            if found.deviance < without.deviance - adequacy.gained_by_chance(found.free - without.free):
                self._refined[f.structure] = f.cost, found

    def _hand_down(self, hopeless: float) -> None:
        """Fit structures anew from the optima of larger ones, where those leave less without what they have more.

        The optimum of the plain cost from which a structure began may lie far from that of the whitened one.
        """
        falling = sorted(self._refined, key=complexity, reverse=True)
        around = {s: minimal_supermodels(s, falling) for s in falling}

        def call(s: Structure) -> tuple[Any, ...] | None:
            own = self._refined[s][1]
            larger = min((self._refined[t][1] for t in around[s]), key=lambda r: r.deviance, default=own)
            offer = s, larger.structure, larger.deviance
            if offer in self._handed or larger.deviance > own.deviance - REFINEMENT.negligible:
                return None
            self._handed.add(offer)
            return _refine_from_larger, self.task, own, larger, self.whitening, hopeless, self.material_growth

        def take(s: Structure, found: Refined | None) -> None:
            cost, known = self._refined[s]
            if found is not None and found.deviance < known.deviance:
                self._refined[s] = cost, found

        in_dependency_order(self._executor, falling, around.__getitem__, call, take)

    def _refine(self, fitted: Sequence[StructureFit], hopeless: float) -> None:
        calls = []
        for f in fitted:
            known = self._refined.get(f.structure)
            if known is None:
                start = self._starts.get(f.structure, f.values)
            else:  # a better one of the table, or where it was given up
                start = f.values if self._is_stale(f) else known[1].values
            calls.append((self.task, f.structure, start, self.whitening, hopeless, self.material_growth))
        for f, found in zip(fitted, in_order(self._executor, refine, calls), strict=True):
            known = self._refined.get(f.structure)
            if known is None or not known[1].finished or found.deviance < known[1].deviance:
                self._refined[f.structure] = f.cost, found
            else:
                self._refined[f.structure] = f.cost, known[1]
