"""Effects that exclude each other: those that fit as well in the place of one that was found.

A gap and a hardening spring of one shaft never stand in one structure, so the lattice has one of them only.
"""

from __future__ import annotations

from collections.abc import Iterable

from brightgrey.kit import Placed, Structure, function_set
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.refined_fit import refine
from brightgrey.search.fitting.structure_fit import fit_multistart
from brightgrey.search.further.proposals import FURTHER_STARTS

__all__ = ["exclusive_rivals"]


def exclusive_rivals(
    detectability: Detectability, structure: Structure, effects: Iterable[Placed], seed: int
) -> dict[str, Structure]:
    """Structures that have an effect of `effects` in the place of one that it excludes, and are no worse.

    Parameters
    ----------
    detectability : Detectability
        Of the round.
    structure : Structure
        A minimal one.
    effects : iterable of Placed
        Those that may take the place of others.
    seed : int
        Of the multistart.

    Returns
    -------
    dict of str to Structure
        By the effect that is replaced.
    """
    refined, kit = detectability.refined, function_set()
    own, found = refined.of(structure), {}
    for other in effects:
        gone = [p for p in structure.placed if p.excludes(other)]
        if len(gone) != 1:
            continue
        instead = Structure((*(p for p in structure.placed if p not in gone), other))
        if not kit.broken_rule(instead):
            fitted = fit_multistart(refined.task, instead, FURTHER_STARTS, seed)
            end = refine(refined.task, instead, fitted.values, refined.whitening, float("inf"))
            enough = max(
                detectability.chance(1),
                detectability.circumstances.material_growth * own.deviance,
                detectability.circumstances.error_floor,
            )
            if end.deviance <= own.deviance + enough:
                found[str(gone[0])] = instead
    return found
