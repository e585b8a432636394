"""Certificate of a search: what it has decided, and the fits that the decision rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words, effects_in_words, enumerated, structure_in_words
from brightgrey.kit.structure import Verdict

__all__ = ["Certificate", "RefutedStructure"]


@dataclass(frozen=True)
class RefutedStructure:
    """A largest structure that the recordings refute, with everything within it."""

    without: tuple[str, ...]  #: Effects that it lacks; every other effect of the grammar is allowed.
    structure: str
    ratio: float  #: Its residual's RMS over that of the best structure.
    excess: float  #: Its deviance beyond the least one.
    threshold: float  #: Excess with which it would be adequate.
    tried: str  #: The structure within it that was fitted by multistart.
    agreeing: int  #: Independent starts that have ended at the best optimum of that structure.


@dataclass(frozen=True)
class Certificate:
    """Fits that decide all structures of a grammar, conditional on the optima that were found."""

    grammar: str  #: Name of the function set.
    structures: int  #: Number of structures that are decided.
    fitted: int  #: Number of structures that were fitted.
    minimal: tuple[str, ...]
    refuted: tuple[RefutedStructure, ...]  #: The one with the least excess first.
    undecided: tuple[str, ...]  #: Largest structures that are left undecided, or whose status has changed.
    #: Signs in the residual of the best structure, or else of the simplest one, that none of the structures explains.
    unexplained: tuple[str, ...]
    #: Effects that the function set holds back, and that were offered since its first ones left a notable residual.
    offered: tuple[str, ...] = ()
    #: Part of the motion in percent that the best fit leaves; None unless that is poor, and not white.
    poor_fit: float | None = None
    #: Verdicts on effects that were not offered, at first order beside the minimal structures.
    held_back: Mapping[str, Verdict] = field(default_factory=dict)

    def without(self, effect: str) -> RefutedStructure | None:
        """The refuted structure with the least residual that lacks `effect`."""
        lacking = [r for r in self.refuted if effect in r.without]
        return min(lacking, key=lambda r: r.ratio, default=None)

    def loss(self, effect: str) -> float | None:
        """By how much the residual's RMS grows at least without `effect`: a ratio minus 1."""
        found = self.without(effect)
        return None if found is None else found.ratio - 1.0

    def sentences(self) -> tuple[str, ...]:
        """The certificate in words, the most important first."""
        out = []
        if self.unexplained:
            signs = " ".join(f"{sign[:1].upper()}{sign[1:]}." for sign in self.unexplained)
            out.append(f"This recording holds something that none of the structures offered explains. {signs}")
        if self.poor_fit is not None:
            out.append(
                f"The best structure leaves {min(self.poor_fit, 100.0):.0f} % of the motion, and that is not white."
                " Either the sensor has coloured noise of that size, or no structure explains the motion."
            )
        out += [_refutation(refuted, self._is_rivalled(refuted)) for refuted in self.refuted]
        if self.undecided:
            left = (structure_in_words(Structure.parse(name)) for name in self.undecided)
            out.append(" ".join(["The budget ended before these were decided.", *(f"Open: {one}." for one in left)]))
        if self.offered:
            names = enumerated([effect_in_words(Placed.parse(e)) for e in self.offered])
            out.append(f"The first effects left a notable part of the residual. So these were offered, too: {names}.")
        out += self._held_back()
        decided = "all but these" if self.undecided else "all"
        out.append(
            f"{self.fitted} fits decide {decided}{' of the' if self.undecided else ''} {self.structures:,} structures"
            f" of the function set '{self.grammar}', conditional on these optima."
        )
        return tuple(out)

    def _is_rivalled(self, refuted: RefutedStructure) -> bool:
        """True if a structure with effects that were not offered makes up for those that a refuted one lacks."""
        wanted = [Placed.parse(e) for e in refuted.without]
        structures = [Structure.parse(name) for name in self.minimal]
        return any(
            all(s.masses < p.effect.masses if p.effect.masses else p not in s.placed for p in wanted)
            for s in structures
            if self.held_back.keys() & set(s.names)
        )

    def _held_back(self) -> list[str]:
        """Sentences on the effects that were not offered, three to a sentence."""
        out = []
        fitted = {str(p) for s in self.minimal for p in Structure.parse(s).placed}
        instead = effects_in_words(Placed.parse(e) for e in self.held_back if e in fitted)
        if instead:
            out.append(f"Not offered, and as good in the place of others: {enumerated(instead)}.")
        for verdict, said in (
            ("not needed", "Not fitted, and not needed, since at first order they would have shown"),
            ("not decidable", "Not fitted, and not decidable from this recording"),
        ):
            of_kind = [e for e, known in self.held_back.items() if known == verdict and e not in fitted]
            names = effects_in_words(map(Placed.parse, of_kind))
            parts = [enumerated(names[i : i + 3]) for i in range(0, len(names), 3)]
            out += [f"{said}: {part}." if i == 0 else f"The same holds for {part}." for i, part in enumerate(parts)]
        return [" ".join(out)] if out else []


def _refutation(refuted: RefutedStructure, rivalled: bool) -> str:
    lacking = enumerated([effect_in_words(Placed.parse(e)) for e in refuted.without])
    among = "whatever else of the effects offered is allowed" if rivalled else "whatever else is allowed"
    return (
        f"Without {lacking} the residual is {refuted.ratio:.3g} times as large, {among}. (Whitened sum"
        f" of squares: {_three_digits(refuted.excess)} above the least one, where"
        f" {_three_digits(refuted.threshold)} are allowed; {_starts(refuted.agreeing)}.)"
    )


def _three_digits(value: float) -> str:
    """`value` with three significant digits, large ones without an exponent."""
    return f"{float(f'{value:.3g}'):,.0f}" if 1000.0 <= value < 1e9 else f"{value:.3g}"


def _starts(count: int) -> str:
    return f"{count} independent start{'' if count == 1 else 's'} agree{'s' if count == 1 else ''}"
