"""Evidence of a search for tests of reports, without a search."""

from __future__ import annotations

from collections.abc import Sequence

from brightgrey.search.certificate import Certificate, RefutedStructure
from brightgrey.search.evidence import EffectVerdict, Evidence

__all__ = ["evidence_of"]


def evidence_of(cards: Sequence[EffectVerdict], optional: Sequence[str] = ("delay",)) -> Evidence:
    """Evidence with these cards, a certificate with one refuted structure, and no fits."""
    refuted = RefutedStructure(("coulomb",), "four_mass+viscous", 3.4, 2100.0, 8.9, "one_mass+viscous", 3)
    certificate = Certificate("paper", 448, 26, ("one_mass+coulomb",), (refuted,), (), ("the residual follows speed",))
    return Evidence((), tuple(optional), tuple(cards), {}, {}, {}, certificate, 100.0)
