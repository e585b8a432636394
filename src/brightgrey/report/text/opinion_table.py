"""Second opinion as rows of text: each term of the torque balance beside its fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from brightgrey.estimation.diagnostics.second_opinion import TermOpinion
from brightgrey.kit.in_words import effect_in_words
from brightgrey.model.model import Model
from brightgrey.numerics.number_format import significant, with_uncertainty
from brightgrey.report.text.prose import listing

__all__ = ["OpinionRow", "opinion_rows", "opinion_sentences"]


NOT_TOLD = "agrees, but does not tell it from zero"


@dataclass(frozen=True)
class OpinionRow:
    """One term as text."""

    term: str  #: In words, with the parameters that add up.
    parameters: str
    fitted: str
    regressed: str
    half_width: str  #: Half of the 95 % interval of `regressed`.
    unit: str
    says: str  #: Whether both agree.


def opinion_rows(model: Model, opinions: Sequence[TermOpinion]) -> list[OpinionRow]:
    """Rows in the recording's units, the inertia first."""
    rows = []
    for opinion in opinions:
        parts = [model.parameters[name] for name in opinion.parameters]
        shown = sum(part.value for part in parts)
        factor = shown / opinion.fitted if opinion.fitted else 1.0  # of the units
        value, half_width = with_uncertainty(factor * opinion.regressed, factor * opinion.half_width)
        rows.append(
            OpinionRow(
                f"{_term(opinion)[:1].upper()}{_term(opinion)[1:]}",
                " + ".join(opinion.parameters),
                significant(shown),
                value,
                half_width,
                parts[0].unit,
                _says(opinion),
            )
        )
    return rows


def opinion_sentences(opinions: Sequence[TermOpinion]) -> str:
    """Sentences on whether the second opinion agrees with the fit, the gravest first."""
    said = [(_says(o), _term(o)) for o in opinions]
    prefixes = {
        "contradicts the fit": "It contradicts the fit, by the sign of",
        "differs": "It differs from the fit by more than its interval in",
        "agrees": "It agrees with the fit on",
        NOT_TOLD: "It does not tell from zero, so that it neither confirms nor denies,",
    }
    texts = (listing(start, [term for says, term in said if says == kind], "and") for kind, start in prefixes.items())
    return " ".join(text for text in texts if text)


def _term(opinion: TermOpinion) -> str:
    first = opinion.effects[0]
    return "total inertia" if first.effect.masses else effect_in_words(first, article=False).partition(" at mass ")[0]


def _says(opinion: TermOpinion) -> str:
    if opinion.contradicts:
        return "contradicts the fit"
    if opinion.differs:
        return "differs"
    return NOT_TOLD if opinion.is_open else "agrees"
