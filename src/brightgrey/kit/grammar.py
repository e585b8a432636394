"""Grammars: the rules by which effects are combined, written as data."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from types import MappingProxyType

from brightgrey.effects import Parameter, registry
from brightgrey.errors import StructureError, one_of
from brightgrey.kit.structure import Placed, Structure

__all__ = ["GRAMMARS", "PAPER", "Grammar", "function_set", "grammar_named"]

Places = Mapping[str, tuple[int, ...]]
"""Places of effects, counted from the motor, by the effect's name."""


@dataclass(frozen=True)
class Grammar:
    """Construction rules of structures.

    A grammar lists the places of each effect. Three rules hold for every grammar. Exactly one effect brings the masses,
    an effect stands only at a mass or shaft that exists, beside the effects that it requires, and without those that it
    excludes.

    Attributes
    ----------
    name : str
    places : mapping of str to tuple of int
        Places at which each effect may stand, counted from the motor. An effect that is not listed is not in the
        function set.
    held_back : mapping of str to tuple of int
        Further places: a search offers them only where the others leave something that nothing explains.
    """

    name: str
    places: Places
    held_back: Places = field(default_factory=dict)

    @cached_property
    def whole(self) -> Grammar:
        """The grammar with what is held back."""
        return Grammar(self.name, _places_of([*_listed(self.places), *_listed(self.held_back)]))

    @property
    def placed(self) -> tuple[Placed, ...]:
        """All placed effects but those that are held back."""
        return tuple(_listed(self.places))

    @property
    def further(self) -> tuple[Placed, ...]:
        """Placed effects that are held back."""
        return tuple(_listed(self.held_back))

    def offering(self, more: Collection[Placed]) -> Grammar:
        """The grammar with further placed effects, and those that they require; nothing is held back.

        They take the place of effects that they exclude.
        """
        required = [Placed(name, p.place) for p in more for name in p.effect.requires]
        kept = [p for p in _listed(self.places) if not any(p.excludes(other) for other in more)]
        return Grammar(self.name, _places_of([*kept, *required, *more]))

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """Declarations of the parameters of all its structures, by name."""
        return MappingProxyType({p.parameter(q.symbol): q for p in self.whole.placed for q in p.effect.parameters})

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
            for name in placed.effect.requires:
                if Placed(name, placed.place) not in structure.placed:
                    return f"'{placed}' requires '{Placed(name, placed.place)}', which '{structure}' lacks"
            for other in structure.placed:
                if placed.excludes(other):
                    return f"'{placed}' and '{other}' exclude each other: '{structure}' has both"
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


# A constant torque at another mass is a twin of that at mass 1: it only twists the shafts, which no sensor sees.
_OF_REAL_AXES: Places = {
    "coulomb": (2, 3, 4),
    "viscous": (2, 3, 4),
    "stribeck": (2, 3, 4),
    "directional_viscous": (1, 2, 3, 4),
    "ground_spring": (1, 2),
    "pendulum": (1, 2),
    "cubic_spring": (1, 2, 3),
    "backlash": (2, 3),
}


@cache
def _drive() -> Grammar:
    """The paper's rules and effects that others have put into the library; those of real axes are held back."""
    own = {name: (1,) for name in registry() if name not in PAPER.places and name not in _OF_REAL_AXES}
    return Grammar("drive", {**PAPER.places, **own}, _OF_REAL_AXES)


GRAMMARS = ("drive", "paper")
"""Names of the function sets that can be searched."""


def grammar_named(name: str) -> Grammar:
    """Function set by its name, ``paper`` or ``drive``. Raises StructureError for another one."""
    return {"paper": PAPER, "drive": _drive()}[one_of("function set", name, GRAMMARS, error=StructureError)]


@cache
def function_set() -> Grammar:
    """Every effect at every place: the rules for structures that a user gives."""
    most = max(e.masses for e in registry().values())
    last = {"drive": 1, "mass": most, "shaft": most - 1}
    return Grammar("all effects", {e.name: tuple(range(1, last[e.where] + 1)) for e in registry().values()})


def _listed(places: Places) -> list[Placed]:
    return [Placed(name, place) for name, at in places.items() for place in at]


def _places_of(placed: Sequence[Placed]) -> dict[str, tuple[int, ...]]:
    names = dict.fromkeys(p.name for p in placed)
    return {name: tuple(sorted({p.place for p in placed if p.name == name})) for name in names}
