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
from brightgrey.search.identification import Identification
from brightgrey.search.lattice import ladder_of
from brightgrey.search.minimal import minimal_structures
from brightgrey.search.work import pool
from brightgrey.search.yardstick import Yardstick

__all__ = ["Card", "Evidence", "has", "weigh"]

Verdict = Literal["needed", "not needed", "not decidable"]
_SAME = 0.005  # part of the residual's RMS by which it grows at least where that is worth a number
_NOTABLE = 0.02  # part of the residual's RMS that an effect explains from which it is not called needless


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
        return _weigh(Yardstick.of(task, fitted, workers, seed), progress)


def _weigh(yardstick: Yardstick, progress: Callable[[Structure], None] | None) -> Evidence:
    found = minimal_structures(yardstick, progress)
    structures = [j.structure for j in found]
    effects = _all_effects(yardstick.known)
    asked = {s: {e: yardstick.shown(s, e) for e in effects if not has(s, e)} for s in structures}  # side by side
    shown = {
        s: {e: answer() and yardstick.gain(s, e) <= _NOTABLE and not yardstick.tells(s, e) for e, answer in of.items()}
        for s, of in asked.items()
    }
    optional = tuple(e for e in effects if any(not of.get(e, True) for of in shown.values()))
    cards = tuple(_card(yardstick, e, structures, optional) for e in effects)
    judged = dict(yardstick.bench.judged)
    criterion = {s: yardstick.criterion(j) for s, j in judged.items()}
    return Evidence(tuple(found), optional, cards, judged, criterion, yardstick.independent)


def _all_effects(structures: Collection[Structure]) -> list[str]:
    """All placed effects by name, in their order; the smallest ladder is no question."""
    least = min(s.masses for s in structures)
    placed = {p for s in structures for p in s.placed if not (p.effect.masses and p.effect.masses <= least)}
    return [str(p) for p in sorted(placed, key=lambda p: (p.effect.number, p.name, p.place))]


def has(structure: Structure, effect: str) -> bool:
    """Whether the structure has the effect; it has all ladders up to its own."""
    masses = Placed.parse(effect).effect.masses
    return ladder_of(structure).effect.masses >= masses if masses else effect in structure.names


def _card(yardstick: Yardstick, effect: str, found: Sequence[Structure], optional: Collection[str]) -> Card:
    """Evidence for one effect, with the refits that it rests on; `found` are the minimal structures."""
    having = [s for s in found if has(s, effect)]
    best = found[0]
    loss = yardstick.loss(best, effect) if has(best, effect) else None
    gain = None if has(best, effect) else yardstick.gain(best, effect)
    if len(having) == len(found):
        late = _sampling(yardstick, best, effect)
        if late is not None:
            return Card(effect, "not decidable", loss, gain, late)
        return Card(effect, "needed", loss, gain, _why_needed(loss))
    if having:
        others = next(s for s in found if s not in having)
        late = _sampling(yardstick, having[0], effect)
        reason = f"{having[0]} and {others} fit equally well" + (f"; {late}" if late else "")
        return Card(effect, "not decidable", loss, gain, reason)
    if effect not in optional:
        size = _least(yardstick, best, effect) or "it"
        text = f"{size} would have shown, but it explains {100.0 * (gain or 0.0):.2g} %"
        return Card(effect, "not needed", loss, gain, text)
    return Card(effect, "not decidable", loss, gain, _why_optional(yardstick, effect, found))


def _why_needed(loss: float | None) -> str:
    if loss is None:
        return "no structure without it fits"
    if loss > _SAME:
        return f"without it the residual is {1.0 + loss:.3g} times as large"
    return "without it the residual is as large, but other effects would explain part of that"


def _why_optional(yardstick: Yardstick, effect: str, found: Sequence[Structure]) -> str:
    """Why an effect that is in none of the structures `found` cannot be called needless."""
    most = max(yardstick.gain(s, effect) for s in found)
    if most > _NOTABLE:
        return f"it explains {100.0 * most:.2g} % of the residual, which may be chance with residuals as slow as these"
    if any(yardstick.tells(s, effect) for s in found):
        if all(yardstick.trusted(yardstick.bench.judge(s)) for s in found):
            return "what it explains is less than simulation and sensor are trusted in"
        return "it explains hardly anything of the residual, but more than chance does"
    if any(yardstick.fits_as_large(s, effect) for s in found):
        return "it fits no worse with it at a size that matters"
    for structure in found:
        change = yardstick.change(structure, effect)
        veil = None if change is None else yardstick.veil(structure, effect, change)
        if veil is not None:
            return f"{_unseen(yardstick, structure, effect)} if {veil} was there, too"
    return _unseen(yardstick, found[0], effect)


def _unseen(yardstick: Yardstick, structure: Structure, effect: str) -> str:
    least = _least(yardstick, structure, effect)
    return f"at a size that matters{f' ({least})' if least else ''} this recording would not have shown it"


def _least(yardstick: Yardstick, structure: Structure, effect: str) -> str | None:
    """The least size of `effect` that matters beside `structure`; None if no single number does, or none is known."""
    if yardstick.with_effect(structure, effect) is None:
        return None
    placed = Placed.parse(effect)
    least = yardstick.least(yardstick.bench.judge(structure), effect)
    for parameter in placed.effect.parameters:
        name = placed.parameter(parameter.symbol)
        if parameter.size and name in least:
            unit, factor = yardstick.bench.task.recordings[0].units.of(parameter.dimension)
            return f"{name} of {factor * least[name]:.2g} {unit}"
    return None


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
