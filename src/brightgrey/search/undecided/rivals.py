"""Rivals of a minimal structure that its lattice has no place for, and that fit as well.

Two kinds are tried. An effect that was offered at one mass may stand at another: a spring on a stiff shaft is an
example. And what excludes an effect may take its place: a gap and a hardening spring of one shaft never stand in one
structure.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from brightgrey.kit import Placed, Structure, function_set
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.refined_fit import Refined, refine
from brightgrey.search.fitting.structure_fit import Options, fit_from_neighbours, fit_multistart
from brightgrey.search.further.proposals import FURTHER_STARTS

__all__ = ["rivals_beyond"]


def rivals_beyond(
    detectability: Detectability,
    structure: Structure,
    effects: Iterable[Placed],
    offered: Collection[Placed],
    seed: int,
) -> dict[str, Refined]:
    """Refined fits with another effect in the place of one, no worse than those without; by the one that is replaced.

    Parameters
    ----------
    detectability : Detectability
        Of the round.
    structure : Structure
        A minimal one.
    effects : iterable of Placed
        Those that the lattice lacks, which may take the place of others.
    offered : collection of Placed
        Effects whose place is in question.
    seed : int
        Of the starts of their parameters.
    """
    refined, kit = detectability.refined, function_set()
    own, found = refined.of(structure), dict[str, Refined]()
    enough = detectability.threshold(structure, 1)
    for other in effects:
        alike = [p for p in structure.placed if p in offered and p.name == other.name]
        for gone in [p for p in structure.placed if p.excludes(other)] + alike:
            rival = Structure((*(p for p in structure.placed if p != gone), other))
            if kit.broken_rule(rival):
                continue
            bare = Structure(tuple(p for p in structure.placed if p != gone))
            starts = [refined.fits.done[bare]] if bare in refined.fits.done else []
            fits = [fit_from_neighbours(refined.task, rival, starts, [], Options(), (seed,))] if starts else []
            if gone in alike:
                there = {
                    other.parameter(q.symbol): own.values[gone.parameter(q.symbol)] for q in gone.effect.parameters
                }
                fits += refined.fits.tried([(rival, {**own.values, **there})], detectability.executor)
            else:
                fits.append(fit_multistart(refined.task, rival, FURTHER_STARTS, seed))
            fitted = min(fits, key=lambda f: f.cost)
            end = refine(refined.task, rival, fitted.values, refined.whitening, float("inf"))
            if end.deviance <= own.deviance + enough:
                found[str(gone)] = end
    return found
