"""Grammars: the rules by which effects are combined, written as data."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache

from brightgrey.effects import registry
from brightgrey.errors import StructureError
from brightgrey.kit.structure import Placed, Structure

__all__ = ["PAPER", "Grammar", "function_set"]


@dataclass(frozen=True)
class Grammar:
    """Construction rules of structures.

    A grammar lists the places of each effect. Two rules hold for every grammar, because without them there is no
    system. Exactly one effect brings the masses, and an effect stands only at a mass or shaft that exists.

    Attributes
    ----------
    name : str
    places : mapping of str to tuple of int
        Places at which each effect may stand, counted from the motor. An effect that is not listed is not in the
        function set.
    """

    name: str
    places: Mapping[str, tuple[int, ...]]

    def broken_rule(self, structure: Structure) -> str | None:
        """Sentence about the rule that `structure` breaks, or None if it is legal."""
        chains = [p.name for p in structure.placed if p.effect.masses]
        if len(chains) != 1:
            came = " and ".join(chains) if chains else "none"
            allowed = ", ".join(e.name for e in registry().values() if e.masses)
            return f"a structure has exactly one of {allowed}; in '{structure}' there is {came}"
        for placed in structure.placed:
            if placed.name not in self.places:
                return f"'{placed.name}' is not in the function set of grammar '{self.name}'"
            if placed.place not in self.places[placed.name]:
                allowed = ", ".join(str(place) for place in self.places[placed.name])
                return f"'{placed}': grammar '{self.name}' allows '{placed.name}' at {placed.effect.where} {allowed}"
            last = {"drive": 1, "mass": structure.masses, "shaft": structure.masses - 1}[placed.effect.where]
            if placed.place > last:
                what = f"no {placed.effect.where} {placed.place}"
                return f"'{placed}' cannot stand in '{structure}': {chains[0]} has {what}"
        return None

    def check(self, structure: Structure) -> Structure:
        """Return `structure` if it is legal.

        Raises
        ------
        StructureError
            If it is not; the message names the rule.
        """
        reason = self.broken_rule(structure)
        if reason:
            raise StructureError(reason)
        return structure

    def parse(self, text: str) -> Structure:
        """Read a structure such as ``two_mass+coulomb`` and check it; raises StructureError."""
        return self.check(Structure.parse(text))

    def structures(self) -> Iterator[Structure]:
        """All legal structures, those with fewer effects first."""
        options = [Placed(name, place) for name, places in self.places.items() for place in places]
        chains = [p for p in options if p.effect.masses]
        others = [p for p in options if not p.effect.masses]
        for size in range(len(others) + 1):
            for chain in chains:
                for chosen in itertools.combinations(others, size):
                    structure = Structure((chain, *chosen))
                    if self.broken_rule(structure) is None:
                        yield structure


PAPER = Grammar(
    "paper",
    dict.fromkeys(
        (
            *("one_mass", "two_mass", "three_mass", "four_mass"),
            *("coulomb", "viscous", "stribeck", "gravity", "backlash", "current_control", "delay"),
        ),
        (1,),
    ),
)
"""The paper's construction rules: 448 structures."""


@cache
def function_set() -> Grammar:
    """Grammar of all effects: the paper's, and every further effect of the library at the first place.

    Without further effects it is the paper's grammar.
    """
    others = {name: (1,) for name in registry() if name not in PAPER.places}
    return replace(PAPER, name="all effects", places={**PAPER.places, **others}) if others else PAPER
