"""Lattice of structures: one contains another that has fewer effects or fewer masses.

A grammar is a set of *atoms*, each a further mass or a placed effect, and what they require: backlash requires a second
mass. Its structures are closed under union. So a structure is a set of bits, any set of atoms stands for the largest
structure within it, and a grammar of millions of structures is never listed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from brightgrey.errors import SettingsError, unknown_name
from brightgrey.kit import Grammar, Placed, Structure

__all__ = [
    "Lattice",
    "added_effects",
    "complexity",
    "contains",
    "has",
    "is_excluded",
    "mass_chain_of",
    "maximal_submodels",
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


def has(structure: Structure, effect: str) -> bool:
    """Return True if the structure has the effect; it has all multiple-mass systems up to its own."""
    masses = Placed.parse(effect).effect.masses
    return structure.masses >= masses if masses else effect in structure.names


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


def is_excluded(placed: Placed, exclude: Collection[str]) -> bool:
    """Return True for an effect that is excluded, or that requires one that is."""
    wanted = (placed, *(Placed(name, placed.place) for name in placed.effect.requires))
    return any(str(p) in exclude for p in wanted)


def added_effects(big: Structure, small: Structure) -> tuple[str, ...]:
    """Names of the effects that `big` has beyond `small`; its masses, if there are more of them, come first."""
    more = (mass_chain_of(big).name,) if big.masses > small.masses else ()
    return (*more, *(str(p) for p in big.placed if p in big.beside - small.beside))


@dataclass(frozen=True)
class Lattice:
    """Structures of a grammar that have some atoms and lack others. A mask has one bit for each atom."""

    atoms: tuple[Placed, ...]  #: Each multiple-mass system stands for its last mass; the first mass is no atom.
    requires: tuple[int, ...]  #: Of each atom, the mask of all others that have to be there, itself complete.
    required: int = 0  #: Mask of what every structure has.
    allowed: int = -1  #: Mask of what a structure may have.

    @classmethod
    def of(cls, grammar: Grammar, require: Sequence[str] = (), exclude: Sequence[str] = ()) -> Lattice:
        """Structures of a grammar that have all required effects and none of the excluded ones.

        Masses count cumulatively: ``two_mass`` required means at least two, ``three_mass`` excluded at most two.

        Raises
        ------
        SettingsError
            For an effect that the grammar lacks or that is both required and excluded, for two required ones that
            exclude each other, or if no structure is left.
        """
        placed = [Placed(name, place) for name, places in grammar.places.items() for place in places]
        known = sorted(map(str, placed))
        for name in (*require, *exclude):
            if name not in known:
                raise SettingsError(unknown_name("effect", name, known))
        for name in exclude:
            if Placed.parse(name).effect.masses == 1:
                raise SettingsError(f"'{name}' cannot be excluded: every structure has one mass at least")
            if name in require:
                raise SettingsError(f"'{name}' is both required and excluded")
        for one, other in combinations(map(Placed.parse, require), 2):
            if one.excludes(other):
                raise SettingsError(f"'{one}' and '{other}' exclude each other: no structure has both")
        chains = sorted((p for p in placed if p.effect.masses > 1), key=lambda p: p.effect.masses)
        beside = [p for p in placed if not p.effect.masses]
        reach = {"drive": 1, "mass": 0, "shaft": 1}  # masses that stand before the place
        wanted = {p: (p.place + reach[p.effect.where] if p.effect.where != "drive" else 1) for p in beside}
        most = max((p.effect.masses for p in chains), default=1)
        beside = [p for p in beside if wanted[p] <= most]
        atoms = tuple(sorted((*chains, *beside), key=lambda p: (p.effect.number, p.name, p.place)))
        masses = {p.effect.masses: 1 << i for i, p in enumerate(atoms) if p.effect.masses}
        bits = {str(p): 1 << i for i, p in enumerate(atoms)}
        needs = tuple(
            sum(bit for n, bit in masses.items() if n < p.effect.masses or n <= wanted.get(p, 0))
            | sum(bits[str(Placed(name, p.place))] for name in p.effect.requires)
            for p in atoms
        )
        whole = cls(atoms, needs)
        allowed = whole.within(whole.everything & ~sum(bits[e] for e in set(exclude)))
        required = 0
        for name in require:
            if name in bits:
                required |= bits[name] | needs[[str(p) for p in atoms].index(name)]
        if required & ~allowed:
            raise SettingsError(f"no structure has {', '.join(require)} and lacks {', '.join(exclude)}")
        return cls(atoms, needs, required, allowed)

    def index(self, effect: str) -> int:
        """Place of an effect among the atoms."""
        return next(i for i, p in enumerate(self.atoms) if str(p) == effect)

    def required_by(self, effect: str) -> int:
        """Mask of all that has to be there with an effect."""
        return self.requires[self.index(effect)]

    @cached_property
    def everything(self) -> int:
        """Mask of the largest structure."""
        return ((1 << len(self.atoms)) - 1) & self.allowed

    @cached_property
    def optional(self) -> int:
        """Mask of the atoms that some structures have and others lack."""
        return self.everything & ~self.required

    def bits(self, mask: int) -> Iterator[int]:
        """Atoms of a mask, one bit each."""
        while mask:
            bit = mask & -mask
            yield bit
            mask ^= bit

    def within(self, mask: int) -> int:
        """Mask of the largest structure within a set of atoms."""
        return sum(b for b in self.bits(mask) if not self.requires[b.bit_length() - 1] & ~mask)

    def without(self, mask: int, bit: int) -> int:
        """Mask of the largest structure within `mask` that lacks an atom."""
        return self.within(mask & ~bit)

    def structure(self, mask: int) -> Structure:
        """The structure of a mask, with what every structure has."""
        chosen = [p for i, p in enumerate(self.atoms) if (mask | self.required) >> i & 1]
        last = max((p for p in chosen if p.effect.masses), key=lambda p: p.effect.masses, default=Placed("one_mass"))
        return Structure((last, *(p for p in chosen if not p.effect.masses)))

    def mask(self, structure: Structure) -> int:
        """Mask of a structure."""
        return sum(
            1 << i
            for i, p in enumerate(self.atoms)
            if (p.effect.masses <= structure.masses if p.effect.masses else p in structure.beside)
        )

    @cached_property
    def size(self) -> int:
        """Number of structures."""
        return _count(frozenset(self.bits(self.optional)), {1 << i: r for i, r in enumerate(self.requires)})

    def masks(self) -> list[int]:
        """Masks of all structures, those with fewer effects first; only for small grammars."""
        found = {self.required}
        for bit in self.bits(self.optional):  # an atom comes after what it requires
            found |= {m | bit for m in found if not self.requires[bit.bit_length() - 1] & ~m}
        return sorted(found, key=lambda m: (m.bit_count(), m))

    def lacking(self, mask: int) -> tuple[str, ...]:
        """Effects that a structure lacks, without those that only fail because another one is missing."""
        absent = self.everything & ~mask
        return tuple(str(p) for i, p in enumerate(self.atoms) if absent >> i & 1 and not self.requires[i] & absent)


def _count(free: frozenset[int], requires: Mapping[int, int]) -> int:
    """Number of sets of `free` atoms in which each atom has those of the free ones that it requires."""
    root = next((b for b in sorted(free) if any(requires[other] & b for other in free)), None)
    if root is None:
        return 1 << len(free)
    above = {b for b in free if requires[b] & root}
    below = {b for b in free if requires[root] & b}
    return _count(free - above - {root}, requires) + _count(free - below - {root}, requires)
