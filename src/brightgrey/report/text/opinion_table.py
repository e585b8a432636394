"""Second opinion as rows of text: each term of the torque balance beside its fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from brightgrey.estimation.diagnostics.second_opinion import TermOpinion
from brightgrey.kit.in_words import effect_heading
from brightgrey.model.model import Model
from brightgrey.numerics.number_format import significant, with_uncertainty

__all__ = ["OpinionRow", "opinion_rows"]


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
        first = opinion.effects[0]
        rows.append(
            OpinionRow(
                "Total inertia" if first.effect.masses else effect_heading(first).partition(" at mass ")[0],
                " + ".join(opinion.parameters),
                significant(shown),
                value,
                half_width,
                parts[0].unit,
                _says(opinion),
            )
        )
    return rows


def _says(opinion: TermOpinion) -> str:
    if opinion.contradicts:
        return "contradicts the fit"
    if opinion.differs:
        return "differs"
    return "agrees, but does not tell it from zero" if opinion.is_open else "agrees"
