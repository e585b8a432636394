"""Detectability: which size of an effect the recordings would have shown beside a structure that lacks it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import INERTIA
from brightgrey.kit import Placed, Structure
from brightgrey.numerics.distributions import ncx2
from brightgrey.search.adequacy import Round
from brightgrey.search.fitting.fixed_size_fit import fit_at_fixed_size
from brightgrey.search.fitting.refined_fit import RefinedFits, accurate, refine
from brightgrey.search.lattice import has
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask
from brightgrey.search.verdicts import ReasonKind

__all__ = ["Detectability", "Obstacle", "power", "relevant_sizes"]


def power(noncentrality: float, parameters: int, critical: float) -> float:
    """Probability that a likelihood ratio of that noncentrality exceeds a critical value (Wald 1943)."""
    return float(ncx2.sf(critical, max(parameters, 1), max(noncentrality, 1e-12)))


def relevant_sizes(task: IdentificationTask, values: Mapping[str, float], effect: str) -> list[dict[str, float]]:
    """Least sizes of `effect` that matter beside a model, by parameter; two of opposite sign if it has both.

    Parameters
    ----------
    task : IdentificationTask
        What it fixes is taken as it is.
    values : mapping of str to float
        Of the model without the effect, SI.
    effect : str

    Returns
    -------
    list of dict of str to float
        SI; empty if the effect declares no size.
    """
    placed = Placed.parse(effect)
    if placed.effect.relevant_size is None:
        return []
    sizes = placed.relevant_size(task.scales, values)
    sizes |= {name: value for name, value in task.fixed.items() if name in sizes}
    for parameter in placed.effect.parameters:
        name = placed.parameter(parameter.symbol)
        if parameter.size and name in sizes and name not in task.fixed:
            low, high = task.bounds.get(name) or parameter.bounds(task.scales)
            both = (sizes[name], -sizes[name])
            return [{**sizes, name: value} for value in both if low <= value <= high] or [sizes]
    return [sizes]


@dataclass(frozen=True)
class Obstacle:
    """Obstacle to refuting an effect: its kind, the size that was tested, and the other effect that masks it."""

    kind: ReasonKind
    size: Mapping[str, float] = field(default_factory=dict)
    other: str = ""


@dataclass(frozen=True)
class Detectability:
    """Power analysis of effects beside structures, by their refined fits in one round."""

    refined: RefinedFits
    circumstances: Round
    executor: Executor

    def with_effect(self, structure: Structure, effect: str) -> Structure:
        """`structure` with an effect, and with what that requires."""
        lattice = self.circumstances.lattice
        return lattice.structure(lattice.mask(structure) | 1 << lattice.index(effect) | lattice.required_by(effect))

    def missing(self, structure: Structure, effect: str) -> list[str]:
        """Effects that `effect` requires and `structure` lacks, each after what it requires itself."""
        lattice = self.circumstances.lattice
        missing = lattice.required_by(effect) & ~lattice.mask(structure)
        return [str(p) for i, p in enumerate(lattice.atoms) if missing >> i & 1]

    def can_be_added(self, structure: Structure, effect: str) -> bool:
        """Return True if a structure of the lattice has `effect` beside `structure`, and nothing else."""
        lattice = self.circumstances.lattice
        allowed = lattice.everything >> lattice.index(effect) & 1
        return bool(allowed) and not has(structure, effect) and not self.missing(structure, effect)

    def critical(self, structure: Structure, big: Structure) -> float:
        """Deviance by which `big` has to be better than `structure` to be called for."""
        free = [len(self.refined.task.space(s, nuisances=True).names) for s in (structure, big)]
        return self.threshold(structure, free[1] - free[0], big.masses - structure.masses)

    def threshold(self, structure: Structure, parameters: int, masses: int = 0, *, among: int = 1) -> float:
        """Deviance by which a fit with more has to be better than `structure`; see :meth:`.Round.chance`."""
        material = self.circumstances.material_growth * self.refined.of(structure).deviance
        return max(self.circumstances.chance(parameters, masses, among=among), material, self.circumstances.error_floor)

    def gain(self, structure: Structure, effect: str) -> float:
        """Part of the whitened residual's RMS that `effect` explains beside `structure`."""
        big = self.with_effect(structure, effect)
        ratio = self.refined.of(big).deviance / self.refined.of(structure).deviance
        return float(1.0 - np.sqrt(min(ratio, 1.0)))

    def tells(self, structure: Structure, effect: str) -> bool:
        """Return True if `effect` explains more beside `structure` than chance does, however little."""
        big = self.with_effect(structure, effect)
        small, large = self.refined.of(structure), self.refined.of(big)
        chance = self.circumstances.chance(large.free - small.free, big.masses - structure.masses)
        return small.deviance - large.deviance > chance

    def refutation(self, structure: Structure, effect: str) -> Obstacle | Callable[[], bool]:
        """Test if the recordings refute `effect` at the least size that matters, beside `structure`.

        First, the effect has to be detectable at that size by its power, with any other effect present. The power holds
        for small changes, and friction bends far more. So, second, the effect is held at that size, all else is fitted
        again, and the fit has to be significantly worse. With hard limits that fit may miss its optimum, so a free fit
        that is no worse at such a size counts as an obstacle.

        Returns
        -------
        Obstacle or callable
            The obstacle to a test; or a function that waits for the fits and returns True if the effect is refuted.
        """
        big = self.with_effect(structure, effect)
        sizes = self.relevant_sizes(structure, effect)
        if not sizes:
            return Obstacle("no relevant size")
        if self.fits_at_relevant_size(structure, effect):
            return Obstacle("fits at relevant size")
        for size in sizes:
            masks = self.hidden_by(structure, effect, size)
            if masks is not None:
                return Obstacle("masked", size, masks[0]) if masks else Obstacle("not detectable", size)
        task, own = self.refined.task, self.refined.of(structure)
        values, refits = {**task.default_start(big), **own.values}, []
        for size in sizes:
            moved = {name: value for name, value in size.items() if name in structure.parameters}
            held = {name: value for name, value in size.items() if name not in moved}
            rival = self.refined.fits.done[structure].cost
            call = (self.refined.fits.task, task, big, values, moved, held, rival)
            refits.append(self.executor.submit(fit_at_fixed_size, *call, self.refined.whitening))
        worst = self.no_worse_than(structure)
        return lambda: all(refit.result().deviance > worst for refit in refits)

    def relevant_sizes(self, structure: Structure, effect: str) -> list[dict[str, float]]:
        """Least sizes of `effect` that matter beside `structure`, to which it can be added."""
        return relevant_sizes(self.refined.task, self.refined.of(structure).values, effect)

    def hidden_by(self, structure: Structure, effect: str, size: Mapping[str, float]) -> tuple[str, ...] | None:
        """Obstacle to detecting `effect` of a size beside `structure`.

        Returns the other effect that masks it, an empty tuple if its power is too small, or None if it is detectable.
        """
        big, task = self.with_effect(structure, effect), self.refined.task
        residual, jacobian, _ = self.refined.jacobian(structure)
        problem = task.problem(big)
        start = {part.name: part.start for part in problem.nuisances}
        values = {**start, **task.default_start(big), **self.refined.of(structure).values, **size}
        names = (*big.parameters, *start)
        moved = problem.residuals({n: np.array([values[n]]) for n in names}, accurate(task).settings)[:, 0]
        change = np.asarray(moved - residual)
        if not self._is_detectable(structure, big, jacobian, change):
            return ()
        confounder = self._confounder(structure, effect, change)
        return None if confounder is None else (confounder,)

    def detection_limit(
        self, structure: Structure, effect: str, size: Mapping[str, float]
    ) -> Mapping[str, float] | None:
        """Size of `effect` that would be found beside `structure` by its power: `size`, doubled until it is.

        None if it is beyond its bounds, or if nothing is its size.
        """
        placed, task = Placed.parse(effect), self.refined.task
        parameter = next((q for q in placed.effect.parameters if q.size), None)
        if parameter is None:
            return None
        name = placed.parameter(parameter.symbol)
        low, high = task.bounds.get(name) or parameter.bounds(task.scales)
        grown = dict(size)
        while name not in task.fixed and low <= grown[name] <= high:
            if self.hidden_by(structure, effect, grown) is None:
                return grown
            grown[name] *= 2.0
        return None

    def fits_at_relevant_size(self, structure: Structure, effect: str) -> bool:
        """Return True if the fit with `effect` beside `structure` has it at a size that matters and is no worse.

        Only effects whose size is a single number are tested.
        """
        big, sizes = self.with_effect(structure, effect), self.relevant_sizes(structure, effect)
        if not sizes or len(sizes[0]) != 1:
            return False
        ((name, value),) = sizes[0].items()
        free = self.refined.of(big)
        return abs(free.values[name]) >= abs(value) and free.deviance <= self.no_worse_than(structure)

    def runs_away(self, structures: Sequence[Structure], effect: str) -> bool:
        """Return True if the last mass or a gap of a structure runs to a bound, or may.

        It may if the fit is no worse with the load at its largest. A spring to a wall and a drift look like a mass that
        is too heavy to move.
        """
        if any(self.refined.of(s).runaway(effect, self.refined.task) for s in structures):
            return True
        if not Placed.parse(effect).effect.masses:
            return False
        heaviest = {s: task for s in structures if (task := self._with_largest_load(s)) is not None}
        whitening = self.refined.whitening
        calls = [(task, s, self.refined.of(s).values, whitening, np.inf) for s, task in heaviest.items()]
        ends = in_order(self.executor, refine, calls)
        return any(end.deviance <= self.no_worse_than(end.structure) for end in ends)

    def _with_largest_load(self, structure: Structure) -> IdentificationTask | None:
        """The task with the last inertia at its largest; None if the user says how large that is."""
        placed, task = structure.placed[0], self.refined.task
        space = task.space(structure)
        load = next((placed.parameter(q.symbol) for q in placed.effect.parameters[::-1] if q.dimension == INERTIA), "")
        if load in task.bounds or load not in space.names:
            return None
        return replace(task, fixed={**task.fixed, load: float(space.high[space.names.index(load)])})

    def no_worse_than(self, structure: Structure) -> float:
        """Deviance up to which a fit is no worse than that of `structure`."""
        return self.refined.of(structure).deviance + self.circumstances.by_chance()

    def _is_detectable(self, structure: Structure, big: Structure, jacobian: Array, change: Array) -> bool:
        """Return True if a change of the residuals would be detected, as far as the Jacobian does not explain it."""
        size, _ = self.refined.whitening.explain(jacobian, change)
        free = [len(self.refined.task.space(s, nuisances=True).names) for s in (structure, big)]
        return power(size, free[1] - free[0], self.critical(structure, big)) >= SELECTION.min_power

    def _confounder(self, structure: Structure, effect: str, change: Array) -> str | None:
        """Other effect beside which `change`, that of `effect`, would not be found; None if there is none.

        Without a reversal, Coulomb friction and gravity may cancel: neither is needed then, and both may be there.
        """
        big = self.with_effect(structure, effect)
        for other in map(str, self.circumstances.lattice.atoms):
            if other == effect or not self.can_be_added(structure, other):
                continue
            beside = self.with_effect(structure, other)
            _, jacobian, _ = self.refined.jacobian(beside)
            _, steps = self.refined.whitening.explain(jacobian, change)
            if not self._is_detectable(structure, big, jacobian, change) and self._is_allowed(
                structure, beside, -steps
            ):
                return other
        return None

    def _is_allowed(self, structure: Structure, big: Structure, steps: Array) -> bool:
        """Return True if small `steps`, shape (P,), keep the effects of `big` beyond `structure` within their bounds.

        Nuisances that both structures estimate are not tested.
        """
        space, values = self.refined.task.space(big, nuisances=True), self.refined.of(big).values
        value = np.array([values[name] for name in space.names])
        moved = value + space.scale_derivative(value) * steps
        slack = SELECTION.bound_slack * (space.high - space.low)
        inside = (moved >= space.low - slack) & (moved <= space.high + slack)
        return bool(np.all(inside | np.isin(space.names, list(self.refined.of(structure).values))))
