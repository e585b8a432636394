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

from brightgrey.kit import Placed, Structure
from brightgrey.search.comparison import Judged
from brightgrey.search.fitting import Fitted
from brightgrey.search.lattice import mass_chain_of
from brightgrey.search.minimal import minimal_structures
from brightgrey.search.parallel import thread_pool
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask
from brightgrey.search.yardstick import Yardstick

__all__ = ["EffectVerdict", "Evidence", "assess_effects", "has"]

Verdict = Literal["needed", "not needed", "not decidable"]
_AT_BOUND = "with an inertia at its bound: a lag, or a spring to a wall, looks like that"


@dataclass(frozen=True)
class EffectVerdict:
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
        Fewest masses first, then best criterion.
    optional : tuple of str
        Effects that beside any of the minimal structures this recording could not have shown at a size that matters, or
        that explain too little to matter but more than chance.
    cards : tuple of EffectVerdict
    judged : mapping of Structure to Judged
        All structures that were refitted.
    criterion : mapping of Structure to float
        Bayesian information criterion of their whitened residuals; less is better.
    independent : float
        Number of independent samples that the residuals are worth.
    """

    minimal: tuple[Judged, ...]
    optional: tuple[str, ...]
    cards: tuple[EffectVerdict, ...]
    judged: Mapping[Structure, Judged]
    criterion: Mapping[Structure, float]
    independent: float


def assess_effects(
    task: IdentificationTask,
    fitted: Mapping[Structure, Fitted],
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Structure], None] | None = None,
) -> Evidence:
    """Find the minimal structures among those `fitted`, and what the recording says about every effect.

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
    asked = {s: {e: yardstick.shown(s, e) for e in effects if not has(s, e)} for s in structures}  # side by side
    shown = {
        s: {
            e: answer() and yardstick.gain(s, e) <= SELECTION.notable_gain and not yardstick.tells(s, e)
            for e, answer in of.items()
        }
        for s, of in asked.items()
    }
    unseen = {e: [s for s in structures if not shown[s].get(e, True)] for e in effects}
    optional = tuple(e for e in effects if unseen[e])
    cards = tuple(_card(yardstick, e, structures, unseen[e]) for e in effects)
    judged = dict(yardstick.bench.judged)
    criterion = {s: yardstick.criterion(j) for s, j in judged.items()}
    return Evidence(tuple(found), optional, cards, judged, criterion, yardstick.independent)


def _all_effects(structures: Collection[Structure]) -> list[str]:
    """All placed effects by name, in their order; what all structures have is no question."""
    placed = sorted({p for s in structures for p in s.placed}, key=lambda p: (p.effect.number, p.name, p.place))
    return [e for e in map(str, placed) if not all(has(s, e) for s in structures)]


def has(structure: Structure, effect: str) -> bool:
    """Whether the structure has the effect; it has all ladders up to its own."""
    masses = Placed.parse(effect).effect.masses
    return mass_chain_of(structure).effect.masses >= masses if masses else effect in structure.names


def _card(yardstick: Yardstick, effect: str, found: Sequence[Structure], unseen: Sequence[Structure]) -> EffectVerdict:
    """Evidence for one effect, with the refits that it rests on.

    `found` are the minimal structures; beside those `unseen` the effect would not have shown.
    """
    having = [s for s in found if has(s, effect)]
    best = found[0]
    loss = yardstick.loss(best, effect) if has(best, effect) else None
    gain = None if has(best, effect) else yardstick.gain(best, effect)
    if len(having) == len(found):
        doubt = _sampling(yardstick, best, effect) or _without_inertia(yardstick, found, effect, loss)
        if doubt is not None:
            return EffectVerdict(effect, "not decidable", loss, gain, doubt)
        return EffectVerdict(effect, "needed", loss, gain, _why_needed(loss))
    if having:
        others = next(s for s in found if s not in having)
        late = _sampling(yardstick, having[0], effect)
        reason = f"{having[0]} and {others} fit equally well" + (f"; {late}" if late else "")
        return EffectVerdict(effect, "not decidable", loss, gain, reason)
    if unseen:
        return EffectVerdict(effect, "not decidable", loss, gain, _why_optional(yardstick, effect, unseen))
    text = f"{_largest(yardstick, effect, found)} would have shown, but it explains {_number(100.0 * (gain or 0.0))} %"
    return EffectVerdict(effect, "not needed", loss, gain, text)


def _why_needed(loss: float | None) -> str:
    if loss is None:
        return "no structure without it fits"
    if loss > SELECTION.reported_loss:
        return f"without it the residual is {1.0 + loss:.3g} times as large"
    return "without it the residual is as large, but other effects would explain part of that"


def _why_optional(yardstick: Yardstick, effect: str, unseen: Sequence[Structure]) -> str:
    """Why an effect that is in no minimal structure cannot be called needless beside those `unseen`."""
    most = max(yardstick.gain(s, effect) for s in unseen)
    if most > SELECTION.notable_gain:
        told = f"it explains {_number(100.0 * most)} % of the residual"
        if Placed.parse(effect).effect.masses and any(_has_no_inertia(yardstick, s, effect) for s in unseen):
            return f"{told}, but {_AT_BOUND}"
        pairs = ((yardstick.with_effect(s, effect), s) for s in unseen)
        judge = yardstick.bench.judge
        if any(big and yardstick.follows_drifts(judge(big), judge(s)) for big, s in pairs):
            return f"{told}, but at a bound, or swinging less than once, it would follow any drift"
        slow = yardstick.independent < SELECTION.slow_share * yardstick.whitening.samples
        few = "residuals as slow as these" if slow else "as few samples as these"
        return f"{told}, which may be chance with {few}"
    if any(yardstick.tells(s, effect) for s in unseen):
        if all(yardstick.trusted(yardstick.bench.judge(s)) for s in unseen):
            return "what it explains is less than simulation and sensor are trusted in"
        return "it explains hardly anything of the residual, but more than chance does"
    if any(yardstick.fits_as_large(s, effect) for s in unseen):
        return "it fits no worse with it at a size that matters"
    asked = [(s, least) for s in unseen for least in yardstick.least(s, effect)]
    for structure, least in asked:
        by = yardstick.hidden(structure, effect, least)
        if by is not None:
            size = _size(yardstick, effect, [least])
            text = f"at a size that matters{f' ({size})' if size else ''} this recording would not have shown it"
            return text + (f" if {by[0]} was there, too" if by else _shows_from(yardstick, effect, asked))
    if asked:
        return "it fits no worse with it held at a size that matters"
    if all(yardstick.with_effect(s, effect) is None for s in unseen):
        return "it was not asked: it takes a further effect as well"
    return "it was not asked: it declares no size that matters"


def _has_no_inertia(yardstick: Yardstick, structure: Structure, ladder: str) -> bool:
    """Whether a further mass beside `structure` makes an inertia run to its bound."""
    big = yardstick.with_effect(structure, ladder)
    return big is not None and yardstick.inertias(yardstick.bench.judge(big)) < big.masses


def _without_inertia(yardstick: Yardstick, found: Sequence[Structure], effect: str, loss: float | None) -> str | None:
    """What to say of a mass without which nothing fits, but of which no inertia is left in some of those `found`."""
    masses = Placed.parse(effect).effect.masses
    if not masses or all(yardstick.inertias(yardstick.bench.judge(s)) >= masses for s in found):
        return None
    return f"{_why_needed(loss)}, but it fits {_AT_BOUND}"


def _shows_from(yardstick: Yardstick, effect: str, asked: Sequence[tuple[Structure, Mapping[str, float]]]) -> str:
    """From which size on the recording would have shown an effect beside all structures; nothing if from none."""
    found = [yardstick.shows_from(structure, effect, least) for structure, least in asked]
    sizes = [{name: abs(value) for name, value in size.items()} for size in found if size]
    if len(sizes) < len(found):
        return ""
    return f"; it would from {_size(yardstick, effect, [max(sizes, key=lambda size: list(size.values()))])} on"


def _largest(yardstick: Yardstick, effect: str, found: Sequence[Structure]) -> str:
    """The size that would have shown beside all structures `found`."""
    sizes = [yardstick.least(s, effect) for s in found]
    most = max(sizes, key=lambda some: [abs(value) for value in some[0].values()])
    return _size(yardstick, effect, most) or "it"


def _size(yardstick: Yardstick, effect: str, sizes: Sequence[Mapping[str, float]]) -> str | None:
    """A size of `effect` in words, of both signs if there are two; None if no number is its size, as with masses."""
    placed = Placed.parse(effect)
    if not any(p.size for p in placed.effect.parameters):
        return None
    told = []
    for parameter in placed.effect.parameters:
        name = placed.parameter(parameter.symbol)
        values = {size[name] for size in sizes if name in size}
        if values:
            unit, factor = yardstick.bench.task.recordings[0].units.of(parameter.dimension)
            sign = "±" if len(values) > 1 else ""
            told.append(f"{name} of {sign}{_number(factor * max(values))} {unit}")
    return " at ".join(told)


def _number(value: float) -> str:
    """With two digits that count."""
    return f"{float(f'{value:.2g}'):g}"


def _sampling(yardstick: Yardstick, structure: Structure, effect: str) -> str | None:
    """What to say of an effect that only makes the input late by less than a sample: data can be taken that way."""
    placed = Placed.parse(effect)
    if placed not in structure.placed or not placed.effect.parameters:
        return None
    if not all(p.lag for p in placed.effect.parameters):
        return None
    values = yardstick.bench.judge(structure).values
    total = sum(values[placed.parameter(p.symbol)] for p in placed.effect.parameters)
    interval = yardstick.bench.task.scales.interval
    if total >= interval:
        return None
    return f"it fits, but {total:.2g} s are less than one sample ({interval:.2g} s): sampling looks like that"
