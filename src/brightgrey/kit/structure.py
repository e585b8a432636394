"""Structures: sets of effects, each at its place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Literal

from brightgrey.effects import Effect, Parameter, Scales, registry
from brightgrey.errors import StructureError, unknown_name

__all__ = ["Placed", "Structure", "Verdict"]

Verdict = Literal["needed", "not needed", "not decidable"]
"""Verdict of a search on an effect."""


@dataclass(frozen=True)
class Placed:
    """An effect at a place, counted from the motor.

    It is written ``coulomb@2``; the paper's place 1 is omitted.
    """

    name: str
    place: int = 1

    @property
    def effect(self) -> Effect:
        """Declaration of the effect."""
        return registry()[self.name]

    @classmethod
    def parse(cls, text: str) -> Placed:
        """Read ``name`` or ``name@place``.

        Raises
        ------
        StructureError
            For an unknown effect or a place that is not a whole number from 1 to 999.
        """
        name, at, place = (part.strip() for part in text.partition("@"))
        if name not in registry():
            raise StructureError(unknown_name("effect", name, registry()))
        if at and not re.fullmatch("0*[1-9][0-9]{0,2}", place):
            raise StructureError(f"place '{place}' of effect '{name}' is not a whole number from 1 to 999")
        return cls(name, int(place) if at else 1)

    def excludes(self, other: Placed) -> bool:
        """The two never stand in one structure, as a gap and a hardening spring of one shaft."""
        return self.place == other.place and (other.name in self.effect.excludes or self.name in other.effect.excludes)

    def parameter(self, symbol: str) -> str:
        """Name of the effect's parameter `symbol` at this place, e.g. ``M_C@2``."""
        return symbol if self.place == 1 else f"{symbol}@{self.place}"

    def declared(self, parameter: Parameter) -> Parameter:
        """Declaration of a parameter of the effect, which names the place unless that is the first."""
        if self.place == 1:
            return parameter
        return replace(parameter, about=f"{parameter.about}, at {self.effect.where} {self.place}")

    def relevant_size(self, scales: Scales, values: Mapping[str, float]) -> dict[str, float]:
        """Parameters by name, SI, of the effect at the least size that matters for control; see `Effect`.

        Parameters
        ----------
        scales : Scales
        values : mapping of str to float
            Values of the model without the effect, by name.

        Returns
        -------
        dict of str to float
            Empty if the effect declares no such size.
        """
        declared = self.effect.relevant_size
        sizes = declared(scales, values, self.place) if declared is not None else {}
        return {self.parameter(symbol): float(value) for symbol, value in sizes.items()}

    @property
    def title(self) -> str:
        """Name for people, with its place unless that is the first."""
        return self.effect.title if self.place == 1 else f"{self.effect.title} at {self.effect.where} {self.place}"

    def __str__(self) -> str:
        return self.name if self.place == 1 else f"{self.name}@{self.place}"


@dataclass(frozen=True)
class Structure:
    """Set of placed effects, in the order of their numbers. A grammar decides if it is legal.

    Attributes
    ----------
    placed : tuple of Placed
        Sorted by effect number and place, without repetition.
    """

    placed: tuple[Placed, ...]

    def __post_init__(self) -> None:
        ordered = tuple(sorted(set(self.placed), key=lambda p: (p.effect.number, p.name, p.place)))
        if len(ordered) != len(self.placed):
            twice = sorted({str(p) for p in self.placed if self.placed.count(p) > 1})
            raise StructureError(f"'{twice[0]}' stands more than once in the structure")
        object.__setattr__(self, "placed", ordered)

    @classmethod
    def of(cls, names: Iterable[str]) -> Structure:
        """Structure from names of placed effects.

        Raises
        ------
        StructureError
            For one text instead of several names, unknown effects, wrong places or effects that are named twice.
        """
        if isinstance(names, str):
            raise StructureError(f"names of effects are expected, and one text came; Structure.parse reads '{names}'")
        return cls(tuple(Placed.parse(name) for name in names))

    @classmethod
    def parse(cls, text: str) -> Structure:
        """Read ``two_mass+coulomb+viscous``.

        Raises
        ------
        StructureError
            For what is no text, unknown effects, wrong places or effects that are named twice.
        """
        if not isinstance(text, str):
            raise StructureError(f"a text such as two_mass+coulomb is expected, {text!r} came")
        if "+" not in text and len(words := re.split(r"[,;&|\s]+", text.strip())) > 1 and words[0] in registry():
            raise StructureError(f"'{text}': effects are joined by +, like {'+'.join(words)}")
        return cls.of(text.split("+"))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the placed effects."""
        return tuple(str(p) for p in self.placed)

    @cached_property
    def masses(self) -> int:
        """Number of masses N."""
        return sum(p.effect.masses for p in self.placed)

    @cached_property
    def beside(self) -> frozenset[Placed]:
        """Placed effects other than the one that brings the masses."""
        return frozenset(p for p in self.placed if not p.effect.masses)

    @cached_property
    def has_hard_limit(self) -> bool:
        """A state is kept between limits, such as the position in a gap: the cost is rugged then."""
        return any(p.effect.has_hard_limit for p in self.placed)

    @cached_property
    def may_be_unstable(self) -> bool:
        """A torque over the position may let the motion part from one that begins alike."""
        return any(p.effect.may_be_unstable for p in self.placed)

    @cached_property
    def has_dry_friction(self) -> bool:
        """There is friction that reverses with the motion."""
        return any(p.effect.is_dry_friction for p in self.placed)

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """Declarations of all parameters by their names in this structure."""
        return MappingProxyType(
            {placed.parameter(q.symbol): placed.declared(q) for placed in self.placed for q in placed.effect.parameters}
        )

    def __str__(self) -> str:
        return "+".join(self.names)

    def __reduce__(self) -> tuple[type[Structure], tuple[tuple[Placed, ...]]]:
        return Structure, (self.placed,)  # cached declarations hold functions, which cannot be pickled
