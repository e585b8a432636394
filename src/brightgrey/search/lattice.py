"""Lattice of structures: one contains another that has fewer effects or fewer masses."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from brightgrey.kit import Placed, Structure

__all__ = [
    "added_effects",
    "complexity",
    "contains",
    "mass_chain_of",
    "maximal_submodels",
    "minimal_elements",
    "minimal_supermodels",
    "one_larger",
    "one_smaller",
]


def mass_chain_of(structure: Structure) -> Placed:
    """The placed effect that brings the masses."""
    return next(p for p in structure.placed if p.effect.masses)


def contains(big: Structure, small: Structure) -> bool:
    """Return True if `small` is `big` without some effects or masses, or equals it; masses count cumulatively."""
    return small.masses <= big.masses and small.beside <= big.beside


def complexity(structure: Structure) -> int:
    """Number of masses and placed effects: what a structure contains is smaller."""
    return structure.masses + len(structure.placed)


def one_smaller(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Structures `among` others that lack one effect, or one mass, of `structure`."""
    wanted = complexity(structure) - 1
    return [s for s in among if complexity(s) == wanted and contains(structure, s)]


def one_larger(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Structures `among` others that have one effect, or one mass, more than `structure`."""
    wanted = complexity(structure) + 1
    return [s for s in among if complexity(s) == wanted and contains(s, structure)]


def maximal_submodels(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Largest of the structures `among` others that `structure` contains: none of them contains another."""
    found: list[Structure] = []
    for s in sorted((s for s in among if contains(structure, s) and s != structure), key=complexity, reverse=True):
        if not any(contains(t, s) for t in found):
            found.append(s)
    return found


def minimal_supermodels(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Smallest of the structures `among` others that contain `structure`: none of them contains another."""
    found: list[Structure] = []
    for s in sorted((s for s in among if contains(s, structure) and s != structure), key=complexity):
        if not any(contains(s, t) for t in found):
            found.append(s)
    return found


def minimal_elements(structures: Collection[Structure]) -> list[Structure]:
    """Structures that contain none of the others, in the order given."""
    return [s for s in structures if not any(t != s and contains(s, t) for t in structures)]


def added_effects(big: Structure, small: Structure) -> tuple[str, ...]:
    """Names of the effects that `big` has beyond `small`; its masses, if there are more of them, come first."""
    more = (mass_chain_of(big).name,) if big.masses > small.masses else ()
    return (*more, *(str(p) for p in big.placed if p in big.beside - small.beside))
