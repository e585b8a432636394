"""Verdict on an effect and its reason, as values; the sentences that people read stand in one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from brightgrey.kit import Placed
from brightgrey.kit.in_words import effect_heading, enumerated
from brightgrey.kit.structure import Verdict
from brightgrey.recordings.units.amounts import amount, rounded
from brightgrey.recordings.units.signals import Units

__all__ = ["EffectVerdict", "Reason", "ReasonKind", "Size", "Verdict", "decisive", "size_in_units"]


ReasonKind = Literal[
    "indispensable",
    "loss",
    "small loss",
    "inertia at bound",
    "gap at bound",
    "slow mode",
    "few samples",
    "unsteady gain",
    "unknown size",
    "unconfirmed",
    "undecided",
    "contained",
    "sampling",
    "one of several",
    "equivalent",
    "gain below threshold",
    "small gain",
    "fits at relevant size",
    "masked",
    "not detectable",
    "fits with fixed size",
    "needs further effects",
    "no relevant size",
    "not offered",
    "refuted",
    "refuted as fixed",
    "refuted without size",
    "refuted at first order",
    "fits better",
    "left out",
]

SENTENCES: Mapping[ReasonKind, str] = MappingProxyType(
    {
        "indispensable": "No structure without it fits.",
        "loss": "Without it the residual is {ratio} times as large.",
        "small loss": "Without it the residual is about as large, but other effects would take its part.",
        "inertia at bound": (
            "An inertia or a spring constant is at its bound, however: a lag, a spring to a wall or a drift looks like"
            " that."
        ),
        "gap at bound": "The gap is at its bound, however: the fit uses it for something else.",
        "slow mode": (
            "Its masses swing less than twice in the recording, however: that follows any drift of load or sensor."
        ),
        "few samples": "With residuals as slow as these that may be chance, however.",
        "unsteady gain": (
            "It helps in some parts of the recordings only, however, and they hold something that nothing explains."
        ),
        "unknown size": (
            "A parameter of it is not known, however: it is at a bound, or its interval is wide or holds zero. The"
            " recordings hold something that nothing explains."
        ),
        "unconfirmed": (
            "Fits without it from other starting values ended elsewhere, however. A better one may have been missed."
        ),
        "undecided": "A structure without it was not decided within the budget, however.",
        "contained": "It is a limit of another effect, which explains as well: {names}.",
        "sampling": "The fit puts it at {lag} s, less than one sample ({interval} s): sampling looks like that.",
        "one of several": (
            "One of several effects is needed, and this recording does not say which. Among them are {names}."
        ),
        "equivalent": "Structures with and without it fit equally well. With it: {first}. Without it: {last}.",
        "gain below threshold": (
            "It explains {gain} % of the residual; effects that mean nothing may explain as much."
        ),
        "small gain": "It explains hardly anything of the residual, but more than chance does.",
        "fits at relevant size": "A fit with it is no worse, and gives it a size that matters.",
        "masked": "At a size that matters{size} this recording would not have shown it beside another effect: {names}.",
        "not detectable": "At a size that matters{size} this recording would not have shown it{limit}.",
        "fits with fixed size": "Held at a size that matters{size}, it makes the fit no worse.",
        "no relevant size": "It was not tested, because no size that matters is declared for it.",
        "needs further effects": "It was not tested: it requires {names}, and whether that is there is open.",
        "not offered": "It was not tested, because {names} is not called for.",
        "refuted": (
            "From {size} on it would have shown. The fit has {estimate}, which explains {gain} % of the residual."
        ),
        "refuted as fixed": "Its fixed size, {size}, makes the fit worse.",
        "refuted without size": "At a size that matters it would have shown, but it explains {gain} % of the residual.",
        "refuted at first order": (
            "From {size} on it would have shown. At first order it explains {gain} % of the residual."
        ),
        "fits better": "The model has it: with it the fit is notably better, and predictions do not contradict.",
        "left out": "The model leaves it out.",
    }
)
"""Sentences by the kind of reason. The order of the kinds decides which of several reasons is given."""


@dataclass(frozen=True)
class Size:
    """One parameter of an effect's size, in the units of the recording."""

    name: str
    value: float
    unit: str
    either_sign: bool = False  #: The value stands for both signs, or for half of a gap.

    def __str__(self) -> str:
        return f"{'±' if self.either_sign else ''}{amount(self.value, self.unit)}"


@dataclass(frozen=True)
class Reason:
    """Reason of a verdict: a kind, and the numbers and names that belong to it."""

    kind: ReasonKind  #: Key of the table of sentences.
    #: Of ``ratio`` (residual without over with the effect), ``gain`` (part of the residual's RMS, in percent), ``lag``
    #: and ``interval`` (s).
    numbers: Mapping[str, float] = field(default_factory=dict)
    #: Size that matters, the smallest size that would have shown, and the estimate; empty where there is none.
    size: tuple[Size, ...] = ()
    limit: tuple[Size, ...] = ()
    estimate: tuple[Size, ...] = ()
    names: tuple[str, ...] = ()  #: Structures or another effect, in words.
    further: tuple[Reason, ...] = ()  #: Reservations.

    def __str__(self) -> str:
        words = {name: rounded(v, 3 if name == "ratio" else 2) for name, v in self.numbers.items()}
        size = " at ".join(map(str, self.size))
        words["size"] = size if self.kind.startswith("refuted") or not size else f" ({size})"
        words["limit"] = f"; it would from {' at '.join(map(str, self.limit))} on" if self.limit else ""
        words["estimate"] = " at ".join("zero" if s.value == 0.0 else str(s) for s in self.estimate)
        words["names"] = enumerated(self.names)
        words["first"], words["last"] = (self.names[0], self.names[-1]) if self.names else ("", "")
        return " ".join([SENTENCES[self.kind].format(**words), *map(str, self.further)])


@dataclass(frozen=True)
class EffectVerdict:
    """Verdict on one effect."""

    effect: str  #: Name of the placed effect; the name of a multiple-mass system stands for "at least so many masses".
    verdict: Verdict  #: one of 'needed', 'not needed', 'not decidable'.
    #: Relative growth of the residual's RMS when the effect is removed from the best structure. An RMS counts as no
    #: less than the trusted accuracy.
    loss: float | None
    gain: float | None  #: Relative decrease when the effect is added.
    why: Reason

    @property
    def title(self) -> str:
        """Name of the effect for people, with its place unless that is the first: ``Second mass``."""
        return effect_heading(Placed.parse(self.effect))

    @property
    def reason(self) -> str:
        """Reason of the verdict in one or two sentences."""
        return str(self.why)

    def __str__(self) -> str:
        return f"{self.title}: {self.verdict}. {self.reason}"


def decisive(reasons: Sequence[Reason]) -> Reason:
    """The reason that comes first in the table of sentences; of several of one kind that with the largest gain."""
    order = list(SENTENCES)
    return min(reasons, key=lambda r: (order.index(r.kind), -r.numbers.get("gain", 0.0)))


def size_in_units(units: Units, effect: str, sizes: Sequence[Mapping[str, float]]) -> tuple[Size, ...]:
    """Size of `effect` in the recording's units, for both signs if there are two; empty if no number is its size.

    Parameters
    ----------
    units : Units
    effect : str
    sizes : sequence of mapping of str to float
        Sizes by parameter, SI; the largest is shown.
    """
    placed, out = Placed.parse(effect), []
    if not any(p.size for p in placed.effect.parameters):
        return ()
    for parameter in placed.effect.parameters:
        name = placed.parameter(parameter.symbol)
        values = {size[name] for size in sizes if name in size}
        if values and (parameter.size or any(values)):  # a phase of zero says nothing
            unit, factor = units.of(parameter.dimension)
            out.append(Size(name, factor * max(values), unit, parameter.half or len(values) > 1))
    return tuple(out)
