"""Verdict on every effect: needed, not needed, or not decidable from the recordings.

Every structure that contains the true one fits as well, so neither one winner nor a list of all good fits says much.
Nothing can be removed from a *minimal* structure and nothing has to be added to it, without a significant loss.
*Optional* effects would not have shown in these recordings at a size that matters, or show without mattering.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from brightgrey.kit import Placed, Structure
from brightgrey.kit.structure import Verdict
from brightgrey.search.comparison import Judged
from brightgrey.search.fitting import Fitted
from brightgrey.search.lattice import mass_chain_of
from brightgrey.search.minimal import minimal_structures
from brightgrey.search.parallel import thread_pool
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask
from brightgrey.search.verdicts import EffectVerdict, Reason, Size, decisive
from brightgrey.search.yardstick import Obstacle, Yardstick

__all__ = ["EffectVerdict", "Evidence", "assess_effects", "has"]


@dataclass(frozen=True)
class Evidence:
    """Result of :func:`assess_effects`."""

    minimal: tuple[Judged, ...]  #: Fewest masses first, then best criterion.
    #: Effects that beside one of the minimal structures would not have shown at a size that matters, or that explain
    #: too little to matter but more than chance.
    optional: tuple[str, ...]
    cards: tuple[EffectVerdict, ...]
    judged: Mapping[Structure, Judged]  #: All structures that were refitted.
    criterion: Mapping[Structure, float]  #: Bayesian information criterion of their whitened residuals; less is better.
    independent: float  #: Independent samples that the residuals are worth.


def assess_effects(
    task: IdentificationTask,
    fitted: Mapping[Structure, Fitted],
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Structure], None] | None = None,
) -> Evidence:
    """Find the minimal structures among those `fitted`, and the verdict on every effect.

    Parameters
    ----------
    task : IdentificationTask
    fitted : mapping of Structure to Fitted
        All structures of a grammar, or as many as were tried.
    seed : int
    executor : concurrent.futures.Executor, optional
        Makes the refits, most of them one after the other.
    progress : callable, optional
        Called with every structure that is examined.
    """
    with thread_pool(executor) as workers:
        return _weigh(Yardstick.of(task, fitted, workers, seed), progress)


def _weigh(yardstick: Yardstick, progress: Callable[[Structure], None] | None) -> Evidence:
    found = minimal_structures(yardstick, progress)
    structures = [j.structure for j in found]
    effects = _all_effects(yardstick.known)
    tests = {s: {e: yardstick.refutation(s, e) for e in effects if not has(s, e)} for s in structures}  # side by side
    doubts = {s: {e: _doubt(yardstick, s, e, test) for e, test in of.items()} for s, of in tests.items()}
    against = {e: {s: d for s in structures if (d := doubts[s].get(e)) is not None} for e in effects}
    optional = tuple(e for e in effects if against[e])
    cards = tuple(_verdict(yardstick, e, structures, against[e]) for e in effects)
    judged = dict(yardstick.bench.judged)
    criterion = {s: yardstick.criterion(j) for s, j in judged.items()}
    return Evidence(tuple(found), optional, cards, judged, criterion, yardstick.independent)


def _all_effects(structures: Collection[Structure]) -> list[str]:
    """All placed effects by name, in their order, but for those that all structures have."""
    placed = sorted({p for s in structures for p in s.placed}, key=lambda p: (p.effect.number, p.name, p.place))
    return [e for e in map(str, placed) if not all(has(s, e) for s in structures)]


def has(structure: Structure, effect: str) -> bool:
    """Return True if the structure has the effect; it has all multiple-mass systems up to its own."""
    masses = Placed.parse(effect).effect.masses
    return mass_chain_of(structure).effect.masses >= masses if masses else effect in structure.names


def _doubt(
    yardstick: Yardstick, structure: Structure, effect: str, test: Obstacle | Callable[[], bool]
) -> Reason | None:
    """Reason why an effect beside `structure` cannot be called needless; None if it can."""
    refuted = not isinstance(test, Obstacle) and test()
    gain = yardstick.gain(structure, effect)
    if gain > SELECTION.notable_gain:
        return _gain_in_doubt(yardstick, structure, effect, gain)
    if yardstick.tells(structure, effect):
        within = yardstick.trusted(yardstick.bench.judge(structure))
        return Reason("gain below accuracy" if within else "small gain")
    if isinstance(test, Obstacle):
        names = (Placed.parse(test.other).effect.title,) if test.other else ()
        return Reason(test.kind, size=_size(yardstick, effect, [test.size]), names=names)
    sizes = yardstick.least(structure, effect)
    return None if refuted else Reason("fits with fixed size", size=_size(yardstick, effect, sizes))


def _gain_in_doubt(yardstick: Yardstick, structure: Structure, effect: str, gain: float) -> Reason:
    """Reason why an effect that explains a notable part of the residual is in no minimal structure."""
    numbers, judge = {"gain": 100.0 * gain}, yardstick.bench.judge
    big = yardstick.with_effect(structure, effect)
    if big is not None and Placed.parse(effect).effect.masses and yardstick.inertias(judge(big)) < big.masses:
        return Reason("gain with inertia at bound", numbers)
    if big is not None and yardstick.follows_drifts(judge(big), judge(structure)):
        return Reason("gain by drift", numbers)
    if yardstick.independent < SELECTION.slow_share * yardstick.whitening.samples:
        return Reason("gain by chance, slow residuals", numbers)
    return Reason("gain by chance, few samples", numbers)


def _verdict(
    yardstick: Yardstick, effect: str, found: Sequence[Structure], against: Mapping[Structure, Reason]
) -> EffectVerdict:
    """Verdict on one effect by the minimal structures `found` and the reasons `against` calling it needless."""
    having, best = [s for s in found if has(s, effect)], found[0]
    loss = yardstick.loss(best, effect) if has(best, effect) else None
    gain = None if has(best, effect) else yardstick.gain(best, effect)
    verdict: Verdict = "not decidable"
    if len(having) == len(found):
        late = _below_sampling(yardstick, best, effect)
        bound = _without_inertia(yardstick, found, effect)
        needed = _needed(loss)
        why = late or (replace(needed, further=(Reason("inertia at bound"),)) if bound else needed)
        verdict = verdict if late or bound else "needed"
    elif having:
        late = _below_sampling(yardstick, having[0], effect)
        others = next(s for s in found if s not in having)
        why = Reason("equivalent", names=(str(having[0]), str(others)), further=(late,) if late else ())
    elif against:
        why = decisive(list(against.values()))
        if why.kind == "not detectable":
            why = replace(why, limit=_detection_limit(yardstick, effect, list(against)))
    else:
        verdict, why = "not needed", _refuted(yardstick, effect, found, gain or 0.0)
    return EffectVerdict(effect, verdict, loss, gain, why)


def _needed(loss: float | None) -> Reason:
    if loss is None:
        return Reason("indispensable")
    return Reason("loss", {"ratio": 1.0 + loss}) if loss > SELECTION.reported_loss else Reason("small loss")


def _refuted(yardstick: Yardstick, effect: str, found: Sequence[Structure], gain: float) -> Reason:
    """Largest of the sizes that would have shown beside the minimal structures, and the estimate beside the best."""
    sizes = [yardstick.least(s, effect) for s in found]
    size = _size(yardstick, effect, max(sizes, key=lambda some: [abs(value) for value in some[0].values()]))
    big, numbers = yardstick.with_effect(found[0], effect), {"gain": 100.0 * gain}
    if not size or big is None:
        return Reason("refuted without size", numbers)
    if size[0].name in yardstick.bench.task.fixed:
        return Reason("refuted as fixed", size=size)
    values = yardstick.bench.judge(big).values
    (estimate, *_) = _size(yardstick, effect, [{size[0].name: values[size[0].name]}])
    if abs(estimate.value) < SELECTION.zero_share * size[0].value:
        estimate = replace(estimate, value=0.0)
    return Reason("refuted", numbers, size=size, estimate=(estimate,))


def _without_inertia(yardstick: Yardstick, found: Sequence[Structure], effect: str) -> bool:
    """True for a multiple-mass system of which an inertia is at its bound in some of those `found`."""
    masses = Placed.parse(effect).effect.masses
    return bool(masses) and any(yardstick.inertias(yardstick.bench.judge(s)) < masses for s in found)


def _detection_limit(yardstick: Yardstick, effect: str, structures: Sequence[Structure]) -> tuple[Size, ...]:
    """Size from which on the recording would have shown an effect beside all structures; empty if there is none."""
    asked = [(s, least) for s in structures for least in yardstick.least(s, effect)]
    found = [yardstick.shows_from(structure, effect, least) for structure, least in asked]
    sizes = [{name: abs(value) for name, value in size.items()} for size in found if size]
    if len(sizes) < len(found):
        return ()
    return _size(yardstick, effect, [max(sizes, key=lambda size: list(size.values()))])


def _size(yardstick: Yardstick, effect: str, sizes: Sequence[Mapping[str, float]]) -> tuple[Size, ...]:
    """Size of `effect` in the recording's units, for both signs if there are two; empty if no number is its size."""
    placed, out = Placed.parse(effect), []
    if not any(p.size for p in placed.effect.parameters):
        return ()
    for parameter in placed.effect.parameters:
        name = placed.parameter(parameter.symbol)
        values = {size[name] for size in sizes if name in size}
        if values:
            unit, factor = yardstick.bench.task.recordings[0].units.of(parameter.dimension)
            out.append(Size(name, factor * max(values), unit, len(values) > 1))
    return tuple(out)


def _below_sampling(yardstick: Yardstick, structure: Structure, effect: str) -> Reason | None:
    """Reservation on an effect that only delays the input, by less than a sample: data can be taken that way."""
    placed = Placed.parse(effect)
    if placed not in structure.placed or not placed.effect.parameters:
        return None
    if not all(p.lag for p in placed.effect.parameters):
        return None
    values = yardstick.bench.judge(structure).values
    lag = sum(values[placed.parameter(p.symbol)] for p in placed.effect.parameters)
    interval = yardstick.bench.task.scales.interval
    return Reason("sampling", {"lag": lag, "interval": interval}) if lag < interval else None
