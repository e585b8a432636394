"""Which structure is contained in which: fewer effects, or fewer masses."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from brightgrey.kit import Placed, Structure

__all__ = [
    "contains",
    "effects_of",
    "extensions",
    "ladder_of",
    "largest_within",
    "minimal",
    "simpler",
    "size",
    "smallest_around",
]


def ladder_of(structure: Structure) -> Placed:
    """The placed effect that brings the masses."""
    return next(p for p in structure.placed if p.effect.masses)


def contains(big: Structure, small: Structure) -> bool:
    """Whether `small` is `big` without some effects or masses; masses count cumulatively. Equal ones do, too."""
    return small.masses <= big.masses and small.beside <= big.beside


def size(structure: Structure) -> int:
    """Number of masses and placed effects: what a structure contains is smaller."""
    return structure.masses + len(structure.placed)


def simpler(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Structures `among` others that lack one effect, or one mass, of `structure`."""
    wanted = size(structure) - 1
    return [s for s in among if size(s) == wanted and contains(structure, s)]


def extensions(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Structures `among` others that have one effect, or one mass, more than `structure`."""
    wanted = size(structure) + 1
    return [s for s in among if size(s) == wanted and contains(s, structure)]


def largest_within(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Largest of the structures `among` others that `structure` contains: none of them contains another."""
    found: list[Structure] = []
    for s in sorted((s for s in among if contains(structure, s) and s != structure), key=size, reverse=True):
        if not any(contains(t, s) for t in found):
            found.append(s)
    return found


def smallest_around(structure: Structure, among: Iterable[Structure]) -> list[Structure]:
    """Smallest of the structures `among` others that contain `structure`: none of them contains another."""
    found: list[Structure] = []
    for s in sorted((s for s in among if contains(s, structure) and s != structure), key=size):
        if not any(contains(s, t) for t in found):
            found.append(s)
    return found


def minimal(structures: Collection[Structure]) -> list[Structure]:
    """Those that contain none of the others, in the order given."""
    return [s for s in structures if not any(t != s and contains(s, t) for t in structures)]


def effects_of(big: Structure, small: Structure) -> tuple[str, ...]:
    """Names of the effects that `big` has beyond `small`; its masses, if there are more of them, come first."""
    more = (ladder_of(big).name,) if big.masses > small.masses else ()
    return (*more, *(str(p) for p in big.placed if p in big.beside - small.beside))
