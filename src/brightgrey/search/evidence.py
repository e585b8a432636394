"""What a recording says about every effect: needed, not needed, or not decidable.

Every structure that contains the true one fits as well, so that neither one winner nor a list of all that fit says
much. *Minimal* structures are those from which nothing can be removed and to which nothing has to be added, neither
without a significant loss; *optional* effects are those that this recording would not have shown at a size that
matters, and those that it shows without their mattering.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Literal

import numpy as np

from brightgrey.kit import Placed, Structure
from brightgrey.search.comparison import Judged, Whitening, power, significance, threshold
from brightgrey.search.fitting import Fitted
from brightgrey.search.identification import ACCURACY, ROUGH, Identification
from brightgrey.search.judging import Bench
from brightgrey.search.lattice import contains, effects_of, extensions, ladder_of, minimal, simpler
from brightgrey.search.work import pool

__all__ = ["Card", "Evidence", "has", "weigh"]

Verdict = Literal["needed", "not needed", "not decidable"]
LEVEL = 0.02  # chance of calling for an effect that is not there
_MATERIAL = 1.01  # ratio of costs below which a difference does not matter, however sure it is
_SHOWN = 0.8  # power from which a recording is said to show an effect
_NOTABLE = 0.02  # part of the residual's RMS that an effect explains from which it is not called needless
_SLACK = 1.02  # ratio of costs within which a structure is always looked at
_MOST = 24  # structures that are examined
_AT_ONCE = 2  # larger structures refitted side by side: what an inadequate one does not need is in vain
_RARE = 1e-3


@dataclass(frozen=True)
class Card:
    """Evidence for one effect.

    Attributes
    ----------
    effect : str
        Name of the placed effect; that of a ladder stands for "at least so many masses".
    verdict : str
        ``needed``, ``not needed`` or ``not decidable``.
    loss : float or None
        By how much the residual's RMS, or what is trusted of it, grows when it is removed from the best structure, a
        ratio minus 1.
    gain : float or None
        By how much it shrinks when the effect is added.
    reason : str
        One sentence without its full stop.
    """

    effect: str
    verdict: Verdict
    loss: float | None
    gain: float | None
    reason: str


@dataclass(frozen=True)
class Evidence:
    """What :func:`weigh` found.

    Attributes
    ----------
    minimal : tuple of Judged
        Best criterion first.
    optional : tuple of str
        Effects that beside any of the minimal structures this recording could not have shown at a size that matters, or
        that explain too little to matter but more than chance.
    cards : tuple of Card
    judged : mapping of Structure to Judged
        All structures that were refitted.
    criterion : mapping of Structure to float
        Bayesian information criterion of their whitened residuals; less is better.
    independent : float
        Number of independent samples that the residuals are worth.
    """

    minimal: tuple[Judged, ...]
    optional: tuple[str, ...]
    cards: tuple[Card, ...]
    judged: Mapping[Structure, Judged]
    criterion: Mapping[Structure, float]
    independent: float


def weigh(
    task: Identification,
    fitted: Mapping[Structure, Fitted],
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Structure], None] | None = None,
) -> Evidence:
    """Find the minimal structures among those `fitted`, and what the recording says about every effect.

    Parameters
    ----------
    task : Identification
    fitted : mapping of Structure to Fitted
        All structures of a grammar, or as many as were tried.
    seed : int
    executor : concurrent.futures.Executor, optional
        Makes the refits, most of them one after the other.
    progress : callable, optional
        Called with every structure that is examined.
    """
    with pool(executor) as workers:
        return _weigh(_Scale.of(task, fitted, workers, seed), progress)


def _weigh(scale: _Scale, progress: Callable[[Structure], None] | None) -> Evidence:
    found = _minimal_structures(scale, progress)
    structures = [j.structure for j in found]
    effects = _all_effects(scale.known)
    asked = {s: {e: scale.shown(s, e) for e in effects if not has(s, e)} for s in structures}  # side by side
    shown = {
        s: {e: answer() and not scale.gain(s, e) > _NOTABLE and not scale.tells(s, e) for e, answer in of.items()}
        for s, of in asked.items()
    }
    optional = tuple(e for e in effects if any(e in of and not of[e] for of in shown.values()))
    cards = tuple(scale.card(e, structures, optional) for e in effects)
    judged = dict(scale.bench.judged)
    criterion = {s: scale.criterion(j) for s, j in judged.items()}
    return Evidence(tuple(found), optional, cards, judged, criterion, _independent(scale))


@dataclass
class _Scale:
    """Refits and the yardstick that they are compared by."""

    bench: Bench
    whitening: Whitening
    known: Mapping[Structure, Fitted]

    @classmethod
    def of(cls, task: Identification, fitted: Mapping[Structure, Fitted], executor: Executor, seed: int) -> _Scale:
        """Yardstick from the noise of the structure that fits best."""
        bench = Bench(task, fitted, executor, seed)
        best = min(fitted.values(), key=lambda f: (f.cost, f.free))
        reference = bench.judge(best.structure)
        lengths = [r.samples for r in task.recordings for _ in r.outputs]
        doubt = task.doubt(task.problem(best.structure).weights, ACCURACY).ravel() / lengths
        return cls(bench, Whitening.of(reference, lengths, doubt.tolist()), fitted)

    @property
    def doubt(self) -> float:
        """Weighted sum of squares that simulation and sensor may leave even if the model is right: below it all fit."""
        return float(np.dot(self.whitening.lengths, self.whitening.doubt))

    def left(self, judged: Judged) -> float:
        """Weighted sum of squares that is left to be explained: of each output no less than nobody is trusted in."""
        w = self.whitening
        pieces = np.split(judged.descent.residual, np.cumsum(w.lengths)[:-1])
        return sum(max(float(p @ p), n * d) for p, n, d in zip(pieces, w.lengths, w.doubt, strict=True))

    def misfit(self, judged: Judged) -> float:
        """Whitened sum of squares."""
        return max(self.whitening.misfit(judged), 1e-300)

    def criterion(self, judged: Judged) -> float:
        """Bayesian information criterion (Schwarz 1978) of the whitened residuals."""
        n = self.whitening.samples
        return n * float(np.log(self.misfit(judged) / n)) + judged.free * float(np.log(n))

    def better(self, big: Judged, small: Judged, tests: int) -> bool:
        """Whether `big` fits significantly and materially better; `tests` structures are compared with `small`."""
        if self.left(small) <= _MATERIAL * self.left(big):
            return False
        return self.surely(big, small, tests)

    def surely(self, big: Judged, small: Judged, tests: int) -> bool:
        """Whether `big` fits significantly better, be it ever so little."""
        found = significance(self.misfit(small), self.misfit(big), self.whitening.samples)
        return found > threshold(big.free - small.free, LEVEL / max(tests, 1))

    def shown(self, structure: Structure, effect: str) -> Callable[[], bool]:
        """Whether the recording shows that `effect` is not there at the least size that matters, beside `structure`.

        It would have been found: its power is enough for small changes. And it is refuted: with the effect held at
        that size and all else fitted anew, the fit is significantly worse. Friction bends so much that small changes
        alone promise too much; and where gaps make many optima that fit may miss the best one, so that a fit that has
        the effect as large as that, and is no worse, speaks against it. What comes back waits for the held fit.
        """
        big = self.with_effect(structure, effect)
        placed = Placed.parse(effect)
        if big is None or placed.effect.noticeable is None:
            return lambda: False
        judged = self.bench.judge(structure)
        task = self.bench.task
        changed = placed.effect.noticeable(task.scales, judged.values)
        least = {placed.parameter(symbol): float(value) for symbol, value in changed.items()}
        values = {**task.standard(big), **judged.values, **least}
        change = self.bench.outputs(big, [values])[:, 0] - judged.descent.residual
        size = self.whitening.unexplained(judged, change)
        tests = len(extensions(structure, self.known))
        if power(size, len(placed.effect.parameters), LEVEL / max(tests, 1)) < _SHOWN:
            return lambda: False
        own = {name: value for name, value in least.items() if name not in structure.parameters}
        if self.fits_as_large(structure, effect):
            return lambda: False
        held = self.bench.held(big, values, own, judged.cost)
        return lambda: self.worse(held(), judged)

    def fits_as_large(self, structure: Structure, effect: str) -> bool:
        """Whether the fit with `effect` beside `structure` has it at a size that matters and is no worse.

        Only of effects whose size is a single number.
        """
        big, placed = self.with_effect(structure, effect), Placed.parse(effect)
        if big is None or placed.effect.noticeable is None:
            return False
        free = self.bench.judge(big)
        least = placed.effect.noticeable(self.bench.task.scales, free.values)
        if len(least) != 1:
            return False
        ((symbol, value),) = least.items()
        large = abs(free.values[placed.parameter(symbol)]) >= abs(float(value))
        return large and not self.worse(free, self.bench.judge(structure))

    def worse(self, one: Judged, other: Judged) -> bool:
        """Whether `one` fits significantly worse than `other`, by one parameter's worth."""
        return significance(self.misfit(one), self.misfit(other), self.whitening.samples) > threshold(1, LEVEL)

    def with_effect(self, structure: Structure, effect: str) -> Structure | None:
        """Least structure that has `effect` beyond `structure`, one mass or one effect more."""
        for big in extensions(structure, self.known):
            if effect in effects_of(big, structure):
                return big
        return None

    def without_effect(self, structure: Structure, effect: str) -> Structure | None:
        """`structure` without `effect`; of a ladder, with one mass less."""
        for small in simpler(structure, self.known):
            if effect in effects_of(structure, small):
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
        """Whether `effect` explains more beside `structure` than chance does, be it ever so little."""
        more = self.with_effect(structure, effect)
        tests = len(extensions(structure, self.known))
        return more is not None and self.surely(self.bench.judge(more), self.bench.judge(structure), tests)

    def loss(self, structure: Structure, effect: str) -> float | None:
        """By how much the residual's RMS grows without `effect`, a ratio minus 1; None if nothing is left then."""
        without = self.without_effect(structure, effect)
        if without is None:
            return None
        here = self.left(self.bench.judge(structure))
        return float(np.sqrt(self.left(self.bench.judge(without)) / here) - 1.0)

    def sampling(self, structure: Structure, effect: str) -> str | None:
        """What to say of an effect that only makes the input late by less than a sample: data can be taken that way."""
        placed = Placed.parse(effect)
        if placed not in structure.placed or not placed.effect.parameters:
            return None
        if not all(p.lag for p in placed.effect.parameters):
            return None
        values = self.bench.judge(structure).values
        total = sum(values[placed.parameter(p.symbol)] for p in placed.effect.parameters)
        interval = self.bench.task.scales.interval
        if total >= interval:
            return None
        return f"it fits, but {total:.2g} s are less than one sample ({interval:.2g} s): sampling looks like that"

    def card(self, effect: str, found: Sequence[Structure], optional: Collection[str]) -> Card:
        """Evidence for one effect, with the refits that it rests on; `found` are the minimal structures."""
        having = [s for s in found if has(s, effect)]
        best = found[0]
        loss = self.loss(best, effect) if has(best, effect) else None
        gain = None if has(best, effect) else self.gain(best, effect)
        if len(having) == len(found):
            late = self.sampling(best, effect)
            if late is not None:
                return Card(effect, "not decidable", loss, gain, late)
            grows = "no structure without it fits"
            if loss is not None:
                grows = f"without it the residual is {1.0 + loss:.3g} times as large"
            return Card(effect, "needed", loss, gain, grows)
        if having:
            others = next(s for s in found if s not in having)
            late = self.sampling(having[0], effect)
            reason = f"{having[0]} and {others} fit equally well" + (f"; {late}" if late else "")
            return Card(effect, "not decidable", loss, gain, reason)
        if effect not in optional:
            return Card(
                effect, "not needed", loss, gain, f"it would have shown, but explains {100.0 * (gain or 0.0):.2g} %"
            )
        most = max(self.gain(s, effect) for s in found)
        if most > _NOTABLE:
            text = (
                f"it explains {100.0 * most:.2g} % of the residual, which may be chance with residuals as slow as these"
            )
            return Card(effect, "not decidable", loss, gain, text)
        if any(self.tells(s, effect) for s in found):
            text = "it explains hardly anything of the residual, but more than chance does"
            if all(self.bench.judge(s).cost <= self.doubt for s in found):
                text = "what it explains is less than simulation and sensor are trusted in"
            return Card(effect, "not decidable", loss, gain, text)
        if any(self.fits_as_large(s, effect) for s in found):
            return Card(effect, "not decidable", loss, gain, "it fits no worse with it at a size that matters")
        return Card(
            effect, "not decidable", loss, gain, "at a size that matters this recording would not have shown it"
        )


def _all_effects(structures: Collection[Structure]) -> list[str]:
    """All placed effects by name, in their order; the smallest ladder is no question."""
    least = min(s.masses for s in structures)
    placed = {p for s in structures for p in s.placed if not (p.effect.masses and p.effect.masses <= least)}
    return [str(p) for p in sorted(placed, key=lambda p: (p.effect.number, p.name, p.place))]


def has(structure: Structure, effect: str) -> bool:
    """Whether the structure has the effect; it has all ladders up to its own."""
    masses = Placed.parse(effect).effect.masses
    return ladder_of(structure).effect.masses >= masses if masses else effect in structure.names


def _minimal_structures(scale: _Scale, progress: Callable[[Structure], None] | None) -> list[Judged]:
    """Adequate structures that contain no other adequate one: hopeful ones first, until none is left to be examined."""
    n = _independent(scale)
    accepted: list[Judged] = []
    examined: set[Structure] = set()
    while len(examined) < _MOST or not accepted:
        structure = _next(scale, n, accepted, examined)
        if structure is None:
            break
        examined.add(structure)
        if progress is not None:
            progress(structure)
        if _adequate(scale, structure):
            accepted.append(scale.bench.judge(structure))
    rejected = sorted(examined - {j.structure for j in accepted}, key=str)
    improved = [s for s in rejected if scale.bench.improve(s)]
    accepted += [scale.bench.judge(s) for s in improved if _adequate(scale, s)]
    for j in accepted:  # grows meanwhile
        accepted += [s for s in _without_loss(scale, j) if s.structure not in [a.structure for a in accepted]]
    least = minimal([j.structure for j in accepted])
    return sorted((j for j in accepted if j.structure in least), key=scale.criterion)


def _without_loss(scale: _Scale, judged: Judged) -> list[Judged]:
    """Adequate structures that lack one effect, or one mass, of an adequate one; they are refitted from there."""
    found = []
    smaller = simpler(judged.structure, scale.known)
    scale.bench.judge_all(smaller)
    for s in smaller:
        scale.bench.improve(s)
        if not scale.better(judged, scale.bench.judge(s), 1) and _adequate(scale, s):
            found.append(scale.bench.judge(s))
    return found


def _next(scale: _Scale, n: float, accepted: Sequence[Judged], examined: Collection[Structure]) -> Structure | None:
    """Structure that may be adequate by all that is known now and contains none of those accepted.

    Of several the one with the least Bayesian information criterion, by the number of independent samples.
    """
    rough = scale.doubt * (ROUGH / ACCURACY) ** 2
    cost = {s: max(scale.bench.cost(s), scale.doubt) + rough for s in scale.known}
    least = min(scale.known.values(), key=lambda f: (cost[f.structure], f.free))

    def hopeful(f: Fitted) -> bool:
        more = max(least.free - f.free, 1)
        reach = float(np.exp(2.0 * threshold(more, _RARE) / n))
        return cost[f.structure] <= max(_SLACK, reach) * cost[least.structure]

    left = [
        f
        for f in scale.known.values()
        if f.structure not in examined and hopeful(f) and not any(contains(f.structure, j.structure) for j in accepted)
    ]

    def promise(f: Fitted) -> tuple[float, int]:
        return n * float(np.log(max(cost[f.structure], 1e-300))) + f.free * float(np.log(n)), f.free

    return min(left, key=promise).structure if left else None


def _adequate(scale: _Scale, structure: Structure) -> bool:
    """Whether nothing that contains the structure fits significantly better."""
    own = scale.bench.judge(structure)
    more = extensions(structure, scale.known)
    larger = [s for s in scale.known if s != structure and contains(s, structure)]
    if not larger:
        return True
    far = min(larger, key=lambda s: (scale.bench.cost(s), scale.known[s].free))
    compared = sorted({*more, far}, key=lambda s: (scale.bench.cost(s), str(s)))
    tests = dict.fromkeys(compared, len(compared))
    # The best of all has the share of the chance of any of them. The largest alone needs no such division if its ratio
    # is distributed as Wilks says; with resonances and gaps, which have a place of their own, more comes by chance.
    if far not in more:
        tests[far] *= len(larger) - len(more)
    pairs = (scale.bench.judge_all(compared[i : i + _AT_ONCE]) for i in range(0, len(compared), _AT_ONCE))
    return not any(scale.better(j, own, tests[j.structure]) for pair in pairs for j in pair)


def _independent(scale: _Scale) -> float:
    """Number of samples that tell a variance as well as the coloured residuals do."""
    return sum(m.telling(n) for m, n in zip(scale.whitening.models, scale.whitening.lengths, strict=True))
