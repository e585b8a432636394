"""Anchors: the structures with which a search begins, some for each number of masses."""

from __future__ import annotations

from collections.abc import Sequence

from brightgrey.kit import Placed, Structure
from brightgrey.search.lattice import Lattice, mass_chain_of

__all__ = ["anchors", "default_anchors", "hard_limits", "largest_by_masses", "linear_beside_masses", "mass_masks"]


def anchors(lattice: Lattice) -> list[Structure]:
    """Structures that are fitted first, by multistart: two for every number of masses.

    One has all friction and nothing else: resonances show beside the friction that hides them. The other has everything
    without a hard limit: resonances show beside the effects that delay the torque.
    """
    found = []
    for masses in mass_masks(lattice):
        for friction in (True, False):
            chosen = sum(
                1 << i
                for i, p in enumerate(lattice.atoms)
                if not p.effect.masses and not p.effect.has_hard_limit and (p.effect.law or not friction)
            )
            found.append(lattice.structure(lattice.within((masses | chosen) & lattice.allowed | lattice.required)))
    return list(dict.fromkeys(found))


def mass_masks(lattice: Lattice) -> list[int]:
    """Masks of the masses alone, for each number of them, fewest first."""
    bits = [1 << i for i, p in enumerate(lattice.atoms) if p.effect.masses and lattice.everything >> i & 1]
    least = lattice.required & sum(bits)
    return [least | sum(bits[:n]) for n in range(len(bits) + 1) if not least & ~sum(bits[:n])]


def largest_by_masses(lattice: Lattice) -> list[Structure]:
    """Largest structures with each number of masses, fewest first."""
    beside = beside_masses(lattice)
    return [lattice.structure(lattice.within(beside | masses)) for masses in mass_masks(lattice)]


def beside_masses(lattice: Lattice) -> int:
    """Mask of all atoms that are not masses."""
    return sum(1 << i for i, p in enumerate(lattice.atoms) if not p.effect.masses) & lattice.everything


def linear_beside_masses(lattice: Lattice) -> int:
    """Mask of the required atoms, and of those beside masses that are linear."""
    atoms = [(1 << i, p.effect.law) for i, p in enumerate(lattice.atoms) if not p.effect.masses]
    linear = sum(bit for bit, law in atoms if law is None or law.affine)
    return linear & lattice.everything | lattice.required


def hard_limits(lattice: Lattice) -> int:
    """Mask of the atoms with a hard limit that are not required."""
    return sum(1 << i for i, p in enumerate(lattice.atoms) if p.effect.has_hard_limit) & ~lattice.required


def default_anchors(structures: Sequence[Structure]) -> list[Structure]:
    """Two anchors for every number of masses, which find optima that simpler structures cannot.

    One has the most friction, and nothing else if possible: resonances show beside the friction that hides them. The
    other has all effects without a hard limit: resonances show beside the effects that delay the torque.
    """

    def laws(structure: Structure) -> list[int]:
        """Ports of the laws; 0 for effects without one."""
        return [p.effect.law.ports if p.effect.law else 0 for p in structure.beside]

    def friction(structure: Structure) -> tuple[int, int]:
        ports = laws(structure)
        return len(ports) - ports.count(1), -ports.count(1)

    def linear(structure: Structure) -> tuple[int, int]:
        return sum(p.effect.has_hard_limit for p in structure.beside), -len(structure.beside)

    ladders: dict[Placed, list[Structure]] = {}
    for s in structures:
        ladders.setdefault(mass_chain_of(s), []).append(s)
    return list(dict.fromkeys(min(group, key=rank) for group in ladders.values() for rank in (friction, linear)))
