"""Border of the adequate structures: the minimal adequate ones and the maximal refuted ones decide all others.

What lies within an inadequate structure is inadequate. So a few dozen fits decide a lattice of any size ("dualise and
advance", Gunopulos et al. 2003, doi:10.1145/777943.777945; Edwards and Havranek 1985, Biometrika 72:339). All functions
are pure: they take what has been fitted as a dict and know nothing of simulations.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from functools import reduce
from operator import and_

from brightgrey.search.adequacy import Deviance, Round
from brightgrey.search.lattice import Lattice

__all__ = ["Border", "Refutation", "assess", "inclusion_minimal", "joint", "largest_avoiding", "shrunk"]


@dataclass(frozen=True)
class Refutation:
    """A maximal refuted structure: it and everything within it leaves too much."""

    mask: int
    excess: float  #: Deviance of the best structure within it beyond the least one.
    threshold: float  #: The most with which it would be adequate.
    witness: int  #: The structure within it that leaves the least.


@dataclass(frozen=True)
class Border:
    """Decision of a table of fits."""

    best: int  #: Structure with the least deviance.
    least: float  #: The least deviance.
    minimal: tuple[int, ...]  #: Adequate structures that contain no other adequate one.
    refuted: tuple[Refutation, ...]  #: Largest structures that contain no adequate one.
    undecided: tuple[int, ...]  #: Largest structures that contain no adequate one and have not been fitted.
    excess: Mapping[int, float]  #: Deviance of each fitted structure, or of one within it, beyond the least one.
    adequate: frozenset[int]  #: Fitted structures that are adequate: they contain a minimal one.


def assess(table: Mapping[int, Deviance], circumstances: Round) -> Border:
    """Decide all structures by those in the table.

    Parameters
    ----------
    table : mapping of int to Deviance
        Fitted structures by mask.
    circumstances : Round

    Returns
    -------
    Border
        Minimal structures and refutations in the order of their masks.
    """
    lattice = circumstances.lattice
    best = min(table, key=lambda m: (table[m].value, table[m].free, m))
    least = table[best].value
    reached = {m: min(d.value for n, d in table.items() if not n & ~m) - least for m in table}
    ahead = circumstances.least(table.values())
    limits = {m: circumstances.limit(d, ahead) - least for m, d in table.items()}
    minimal = inclusion_minimal(m for m in table if reached[m] <= limits[m])
    adequate = frozenset(m for m in table if any(not small & ~m for small in minimal))
    refuted, undecided = [], []
    for mask in largest_avoiding(minimal, lattice):
        if mask in table:
            witness = min((m for m in table if not m & ~mask), key=lambda m: (table[m].value, table[m].free, m))
            refuted.append(Refutation(mask, reached[mask], limits[mask], witness))
        else:
            undecided.append(mask)
    return Border(best, least, tuple(minimal), tuple(refuted), tuple(undecided), reached, adequate)


def inclusion_minimal(masks: Iterable[int]) -> list[int]:
    """Masks that contain none of the others, ascending."""
    found: list[int] = []
    for mask in sorted(set(masks), key=lambda m: (m.bit_count(), m)):
        if not any(not small & ~mask for small in found):
            found.append(mask)
    return sorted(found)


def largest_avoiding(masks: Iterable[int], lattice: Lattice) -> list[int]:
    """Largest structures that contain none of `masks`, ascending (Berge's multiplication)."""
    found = [lattice.everything]
    for mask in masks:
        free = [b for b in lattice.bits(mask) if not b & lattice.required]
        parts = set()
        for big in found:
            if mask & ~big:
                parts.add(big)
            else:
                smaller = (lattice.without(big, bit) for bit in free)
                parts.update(m for m in smaller if not lattice.required & ~m)
        found = [m for m in parts if not any(n != m and not m & ~n for n in parts)]
    return sorted(found)


def joint(border: Border, lattice: Lattice, done: Set[int]) -> list[int]:
    """An adequate structure without all the atoms that can be removed one by one, unless it is `done`; or none."""
    for mask in sorted(border.adequate, key=lambda m: (m.bit_count(), border.excess[m], m)):
        gone = [m for m in _children(mask, lattice) if m in border.adequate]
        if len(gone) < 2 or not any(m in border.minimal for m in gone):
            continue
        together = lattice.within(reduce(and_, gone))
        if together not in done and not any(not m & ~together for m in border.minimal):
            return [together]
    return []


def shrunk(border: Border, lattice: Lattice, done: Set[int]) -> list[int]:
    """Structures that the simplest minimal one is compared with: those that lack one of its atoms and are not `done`.

    They are asked for even within one that leaves far too much: that optimum may have been missed.
    """
    for mask in sorted(border.minimal, key=lambda m: (m.bit_count(), border.excess[m], m)):
        missing = [m for m in _children(mask, lattice) if m not in done]
        if missing:
            return missing
    return []


def _children(mask: int, lattice: Lattice) -> list[int]:
    """Masks of the largest structures within `mask` that lack one of its atoms."""
    removed = (lattice.without(mask, bit) for bit in lattice.bits(mask & ~lattice.required))
    return [m for m in dict.fromkeys(removed) if not lattice.required & ~m]
