"""Certificate of a search: what it has decided, and the fits that the decision rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from brightgrey.kit import Placed

__all__ = ["Certificate", "RefutedStructure"]


@dataclass(frozen=True)
class RefutedStructure:
    """A largest structure that the recordings refute, with everything within it."""

    without: tuple[str, ...]  #: Effects that it lacks; every other effect of the grammar is allowed.
    structure: str
    ratio: float  #: Its residual's RMS over that of the best structure.
    excess: float  #: Its deviance beyond the least one.
    threshold: float  #: The most that chance explains.
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
    unexplained: tuple[str, ...]  #: Signs in the residual of the best structure that none of the structures explains.
    #: Effects that the function set holds back, and that were offered since its first ones left a notable residual.
    offered: tuple[str, ...] = ()

    def without(self, effect: str) -> RefutedStructure | None:
        """The refuted structure with the least residual that lacks `effect`."""
        lacking = [r for r in self.refuted if effect in r.without]
        return min(lacking, key=lambda r: r.ratio, default=None)

    def loss(self, effect: str) -> float | None:
        """By how much the residual's RMS grows at least without `effect`: a ratio minus 1."""
        found = self.without(effect)
        return None if found is None else found.ratio - 1.0

    def sentences(self, titles: Sequence[tuple[str, str]] = ()) -> tuple[str, ...]:
        """The certificate in words, the most important first; `titles` are names of effects for people."""
        names = dict(titles)
        out = []
        if self.unexplained:
            out.append(
                "This recording holds something that none of the structures offered explains: "
                + "; ".join(self.unexplained)
                + "."
            )
        for r in self.refuted:
            lacking = " and ".join(_in_words(e, names.get(e, e)) for e in r.without)
            out.append(
                f"Even with every other effect allowed, without {lacking} the residual is {r.ratio:.3g} times as large"
                f" (whitened sum of squares {r.excess:.3g} above the least one, chance explains {r.threshold:.3g};"
                f" {_starts(r.agreeing)})."
            )
        if self.undecided:
            out.append(f"Left undecided within the budget: {', '.join(self.undecided)}.")
        if self.offered:
            titles_offered = ", ".join(Placed.parse(e).title for e in self.offered)
            out.append(
                f"Offered beyond the first effects, since those left a notable part of the residual: {titles_offered}."
            )
        out.append(
            f"{self.fitted} fits decide all {self.structures:,} structures of the function set '{self.grammar}',"
            " conditional on these optima."
        )
        return tuple(out)


def _in_words(effect: str, title: str) -> str:
    """Effect within a sentence; masses count cumulatively."""
    masses = Placed.parse(effect).effect.masses
    return ("a motor", "a second mass", "a third mass", "a fourth mass")[masses - 1] if masses else title


def _starts(count: int) -> str:
    return f"{count} independent start{'' if count == 1 else 's'} agree{'s' if count == 1 else ''}"
