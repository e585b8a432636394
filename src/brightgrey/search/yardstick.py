"""Comparison of nested structures by refined fits in whitened residuals, and the power to detect an effect.

A difference counts if it is more than chance, and more than the trusted accuracy of simulation and sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from brightgrey.arrays import Array, positive
from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.problem.segments import segment_lengths, split_segments
from brightgrey.kit import Placed, Structure, assemble
from brightgrey.search.comparison import Judged, chance_of, power, significance, threshold
from brightgrey.search.criteria import bic
from brightgrey.search.fitting import Fitted
from brightgrey.search.judging import Bench
from brightgrey.search.lattice import added_effects, mass_chain_of, one_larger, one_smaller
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import TRUSTED_ACCURACY, IdentificationTask
from brightgrey.search.verdicts import ReasonKind

__all__ = ["Obstacle", "Yardstick"]


@dataclass(frozen=True)
class Obstacle:
    """Obstacle to refuting an effect: its kind, the size that was tested, and the other effect that masks it."""

    kind: ReasonKind
    size: Mapping[str, float] = field(default_factory=dict)
    other: str = ""


@dataclass
class Yardstick:
    """Tests of nested structures by their refined fits, with one whitening filter for all."""

    bench: Bench
    whitening: Whitening
    known: Mapping[Structure, Fitted]
    misfits: dict[Structure, tuple[Judged, float]] = field(default_factory=dict)  # of the last refit of each
    fews: dict[Structure, tuple[Judged, float]] = field(default_factory=dict)  # independent samples of its residuals

    @classmethod
    def of(
        cls, task: IdentificationTask, fitted: Mapping[Structure, Fitted], executor: Executor, seed: int
    ) -> Yardstick:
        """Comparison with the noise model of the structure that fits best."""
        bench = Bench(task, fitted, executor, seed)
        best = min(fitted.values(), key=lambda f: (f.cost, f.free))
        reference = bench.judge(best.structure)
        lengths = segment_lengths(task.recordings)
        doubt = task.error_floor(task.problem(best.structure).weights, TRUSTED_ACCURACY).ravel() / lengths
        return cls(
            bench, Whitening.of(reference.descent.residual, reference.inside_jacobian, lengths, doubt.tolist()), fitted
        )

    @property
    def doubt(self) -> float:
        """Weighted sum of squares that simulation and sensor may leave even if the model is right: below it all fit."""
        return float(np.dot(self.whitening.lengths, self.whitening.error_floor))

    def left(self, judged: Judged) -> float:
        """Weighted sum of squares that is left to be explained: of each output at least its share of `doubt`."""
        w = self.whitening
        pieces = split_segments(judged.descent.residual, w.lengths)
        return sum(max(float(p @ p), n * d) for p, n, d in zip(pieces, w.lengths, w.error_floor, strict=True))

    def trusted(self, judged: Judged) -> bool:
        """Return True if the residual of every output is within the trusted accuracy."""
        return self.left(judged) <= self.doubt * (1.0 + 1e-12)

    def misfit(self, judged: Judged) -> float:
        """Whitened sum of squares."""
        last, found = self.misfits.get(judged.structure, (None, 0.0))
        if last is not judged:
            found = positive(self.whitening.gls_rss(judged.descent.residual, judged.inside_jacobian))
            self.misfits[judged.structure] = judged, found
        return found

    def criterion(self, judged: Judged) -> float:
        """Bayesian information criterion (Schwarz 1978) of the whitened residuals."""
        return bic(self.misfit(judged), self.whitening.samples, judged.free)

    @property
    def independent(self) -> float:
        """Number of samples that tell a variance as well as the coloured residuals of the best fit do."""
        return self.whitening.effective_samples

    def better(self, big: Judged, small: Judged, tests: int) -> bool:
        """Return True if `big` fits significantly and materially better; `tests` structures are compared with `small`.

        A further mass or gap can absorb any drift. With slow residuals the whitened test takes their fast part
        for evidence, which a drift does not have. So a further mass or gap also has to pass the F test.
        """
        if self.left(small) <= SELECTION.min_rss_ratio * self.left(big):
            return False
        if not self.surely(big, small, tests):
            return False
        return not _has_own_motion(big.structure, small.structure) or self.shows_in_few(big, small)

    def shows_in_few(self, big: Judged, small: Judged) -> bool:
        """Reject `small` in favour of `big` by an F test with the effective number of independent samples.

        The samples are those of the residual of `big`. If its further mass or gap can absorb a drift, the smaller
        number of the residual of `small` is used: under the null hypothesis that residual is the noise.
        """
        ratio, more = self.left(small) / self.left(big), big.free - small.free
        samples = self.independent_in(big)
        if self.follows_drifts(big, small):
            samples = min(samples, self.independent_in(small))
        return chance_of(ratio, more, samples - big.free) <= SELECTION.false_alarm_level

    def follows_drifts(self, big: Judged, small: Judged) -> bool:
        """Return True if `big` has a further mass or gap at a bound of the tool, or oscillating less than once.

        Undamped, as a wall, or on a very soft shaft it can follow any drift. Such parameters of `small` do not count.
        """
        if not _has_own_motion(big.structure, small.structure):
            return False
        return bool(self.ran(big) - self.ran(small)) or self.swings(big) < 1.0 <= self.swings(small)

    def swings(self, judged: Judged) -> float:
        """Undamped oscillations of the slowest mode of the masses in the longest recording."""
        task, structure = self.bench.task, judged.structure
        n = structure.masses
        if n < 2:
            return np.inf
        values = {name: judged.values[name] for name in structure.parameters}
        rates = -assemble(structure, values, task.settings.f_tanh).A[n : 2 * n, :n]  # states are q, q', ...
        square = np.sort(np.linalg.eigvals(rates).real)[1]  # the first is the motion of all together
        longest = max(float(r.t[-1] - r.t[0]) for r in task.recordings)
        return float(np.sqrt(max(square, 0.0)) * longest / (2.0 * np.pi))

    def ran(self, judged: Judged) -> set[str]:
        """Parameters of masses and gaps that have run to a bound which the user did not set."""
        names, bounds = self.bench.task.space(judged.structure, initial=True).names, self.bench.task.bounds
        ran = {name for column, name in enumerate(names) if column not in judged.inside and name not in bounds}
        moving = [mass_chain_of(judged.structure), *(p for p in judged.structure.placed if p.effect.has_hard_limit)]
        return ran & {p.parameter(q.symbol) for p in moving for q in p.effect.parameters}

    def inertias(self, judged: Judged) -> int:
        """Number of masses whose inertia has not run to a bound which the user did not set."""
        ladder = mass_chain_of(judged.structure)
        of_mass = ladder.effect.parameters[0].dimension
        masses = {ladder.parameter(q.symbol) for q in ladder.effect.parameters if q.dimension == of_mass}
        return judged.structure.masses - len(masses & self.ran(judged))

    def independent_in(self, judged: Judged) -> float:
        """Number of samples that tell a variance as well as what `judged` leaves does."""
        last, found = self.fews.get(judged.structure, (None, 0.0))
        if last is not judged:
            whitening = Whitening.of(
                judged.descent.residual, judged.inside_jacobian, self.whitening.lengths, self.whitening.error_floor
            )
            found = whitening.effective_samples
            self.fews[judged.structure] = judged, found
        return found

    def surely(self, big: Judged, small: Judged, tests: int) -> bool:
        """Return True if `big` fits significantly better by the likelihood-ratio test, however little."""
        found = significance(self.misfit(small), self.misfit(big), self.whitening.samples)
        level = _level(tests, big.structure.masses > small.structure.masses)
        return found > threshold(big.free - small.free, level)

    def refutation(self, structure: Structure, effect: str) -> Obstacle | Callable[[], bool]:
        """Test if the recording refutes `effect` at the least size that matters, beside `structure`.

        First, the effect has to be detectable at that size by its power, with any other effect present. The power holds
        for small changes, and friction bends far more. So, second, the effect is held at that size, all else is fitted
        again, and the fit has to be significantly worse. With hard limits that fit may miss its optimum, so a free fit
        that is no worse at such a size counts as an obstacle.

        Returns
        -------
        Obstacle or callable
            The obstacle to a test; or a function that waits for the fits and returns True if the effect is refuted.
        """
        big, judged = self.with_effect(structure, effect), self.bench.judge(structure)
        if big is None:
            return Obstacle("needs further effects")
        sizes = self.least(structure, effect)
        if not sizes:
            return Obstacle("no relevant size")
        if self.fits_as_large(structure, effect):
            return Obstacle("fits at relevant size")
        for least in sizes:
            masks = self.hidden(structure, effect, least)
            if masks is not None:
                return Obstacle("masked", least, masks[0]) if masks else Obstacle("not detectable", least)
        values, refits = {**self.bench.task.default_start(big), **judged.values}, []
        for least in sizes:
            moved = {name: value for name, value in least.items() if name in structure.parameters}
            held = {name: value for name, value in least.items() if name not in moved}
            refits.append(self.bench.held(big, values, moved, held, judged.cost))
        return lambda: all(self.worse(refit(), judged) for refit in refits)

    def least(self, structure: Structure, effect: str) -> list[dict[str, float]]:
        """Least sizes of `effect` that matter beside `structure`, by parameter; two of opposite sign if it has both.

        What is fixed is asked as it is. Empty if the effect takes others as well, or declares no size.
        """
        placed, task = Placed.parse(effect), self.bench.task
        if self.with_effect(structure, effect) is None or placed.effect.relevant_size is None:
            return []
        sizes = placed.relevant_size(task.scales, self.bench.judge(structure).values)
        sizes |= {name: value for name, value in task.fixed.items() if name in sizes}
        for parameter in placed.effect.parameters:
            name = placed.parameter(parameter.symbol)
            if parameter.size and name in sizes and name not in task.fixed:
                low, high = task.bounds.get(name) or parameter.bounds(task.scales)
                both = (sizes[name], -sizes[name])
                return [{**sizes, name: value} for value in both if low <= value <= high] or [sizes]
        return [sizes]

    def hidden(self, structure: Structure, effect: str, least: Mapping[str, float]) -> tuple[str, ...] | None:
        """Obstacle to detecting `effect` of a size beside `structure`.

        Returns the other effect that masks it, an empty tuple if its power is too small, or None if it is detectable.
        """
        big, judged = self.with_effect(structure, effect), self.bench.judge(structure)
        if big is None:
            return ()
        values = {**self.bench.task.default_start(big), **judged.values, **least}
        change = np.asarray(self.bench.outputs(big, [values])[:, 0] - judged.descent.residual)
        size, _ = self.whitening.explain(judged.descent.jacobian, change)
        if not self.visible(structure, effect, size):
            return ()
        veil = self.veil(structure, effect, change)
        return None if veil is None else (veil,)

    def shows_from(self, structure: Structure, effect: str, least: Mapping[str, float]) -> Mapping[str, float] | None:
        """Size of `effect` that would be found beside `structure` by its power: `least`, doubled until it is.

        None if that is beyond its bounds, or if nothing is its size.
        """
        placed, task = Placed.parse(effect), self.bench.task
        size = next((q for q in placed.effect.parameters if q.size), None)
        if size is None or self.with_effect(structure, effect) is None:
            return None
        name = placed.parameter(size.symbol)
        low, high = task.bounds.get(name) or size.bounds(task.scales)
        grown = dict(least)
        while name not in task.fixed and low <= grown[name] <= high:
            if self.hidden(structure, effect, grown) is None:
                return grown
            grown[name] *= 2.0
        return None

    def visible(self, structure: Structure, effect: str, size: float) -> bool:
        """Return True if a change of that squared size, made by `effect`, would be detected beside `structure`."""
        big = self.with_effect(structure, effect)
        if big is None:
            return False
        level = _level(len(one_larger(structure, self.known)), big.masses > structure.masses)
        return power(size, self.known[big].free - self.known[structure].free, level) >= SELECTION.min_power

    def veil(self, structure: Structure, effect: str, change: Array) -> str | None:
        """Other effect beside which `change`, that of `effect`, would not be found; None if there is none.

        Without a reversal, Coulomb friction and gravity may cancel: neither is needed then, and both may be there.
        """
        for big in one_larger(structure, self.known):
            others = added_effects(big, structure)
            if effect in others:
                continue
            judged = self.bench.judge(big)
            size, steps = self.whitening.explain(judged.descent.jacobian, change)
            if not self.visible(structure, effect, size) and self.allowed(structure, judged, -steps):
                return others[0]
        return None

    def allowed(self, structure: Structure, judged: Judged, steps: Array) -> bool:
        """Return True if small `steps`, shape (P,), keep the effects beyond `structure` within their bounds.

        Initial states that both structures estimate are not tested.
        """
        space = self.bench.task.space(judged.structure, initial=True)
        value = np.array([judged.values[name] for name in space.names])
        moved = value + space.scale_derivative(value) * steps
        slack = SELECTION.bound_slack * (space.high - space.low)
        inside = (moved >= space.low - slack) & (moved <= space.high + slack)
        return bool(np.all(inside | np.isin(space.names, list(self.bench.judge(structure).values))))

    def fits_as_large(self, structure: Structure, effect: str) -> bool:
        """Return True if the fit with `effect` beside `structure` has it at a size that matters and is no worse.

        Only effects whose size is a single number are tested.
        """
        big = self.with_effect(structure, effect)
        if big is None:
            return False
        free, sizes = self.bench.judge(big), self.least(structure, effect)
        if not sizes or len(sizes[0]) != 1:
            return False
        ((name, value),) = sizes[0].items()
        return abs(free.values[name]) >= abs(value) and not self.worse(free, self.bench.judge(structure))

    def worse(self, one: Judged, other: Judged) -> bool:
        """Return True if `one` fits significantly worse than `other`, and not within the error floor."""
        if self.trusted(one):
            return False
        return significance(self.misfit(one), self.misfit(other), self.whitening.samples) > threshold(
            1, SELECTION.false_alarm_level
        )

    def with_effect(self, structure: Structure, effect: str) -> Structure | None:
        """Least structure that has `effect` beyond `structure`, one mass or one effect more."""
        for big in one_larger(structure, self.known):
            if effect in added_effects(big, structure):
                return big
        return None

    def without_effect(self, structure: Structure, effect: str) -> Structure | None:
        """`structure` without `effect`; of a ladder, with one mass less."""
        for small in one_smaller(structure, self.known):
            if effect in added_effects(structure, small):
                return small
        return None

    def gain(self, structure: Structure, effect: str) -> float:
        """Part of the residual's RMS that `effect` explains beside `structure`."""
        more = self.with_effect(structure, effect)
        if more is None:
            return 0.0
        here = self.left(self.bench.judge(structure))
        return float(1.0 - np.sqrt(min(self.left(self.bench.judge(more)) / here, 1.0)))

    def tells(self, structure: Structure, effect: str) -> bool:
        """Return True if `effect` explains more beside `structure` than chance does, however little."""
        more = self.with_effect(structure, effect)
        tests = len(one_larger(structure, self.known))
        return more is not None and self.surely(self.bench.judge(more), self.bench.judge(structure), tests)

    def loss(self, structure: Structure, effect: str) -> float | None:
        """By how much the residual's RMS grows without `effect`, a ratio minus 1; None if nothing is left then."""
        without = self.without_effect(structure, effect)
        if without is None:
            return None
        here = self.left(self.bench.judge(structure))
        return float(np.sqrt(self.left(self.bench.judge(without)) / here) - 1.0)


def _has_own_motion(big: Structure, small: Structure) -> bool:
    """Return True if `big` has more masses than `small`, or a hard limit that `small` lacks."""
    return big.masses > small.masses or (big.has_hard_limit and not small.has_hard_limit)


def _level(tests: int, mass: bool) -> float:
    """Level of one of several tests, by Wilks's distribution, be it of a further mass or not."""
    return SELECTION.false_alarm_level / max(tests, 1) / (SELECTION.mass_multiplicity if mass else 1.0)
