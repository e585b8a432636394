"""Construction rules (paper section 3.2), read from the grammar: what may be added to an unfinished tree."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

from brightgrey.kit import Grammar, Placed, Structure

__all__ = ["Rules"]

Types = frozenset[Placed]


@dataclass(frozen=True)
class Rules:
    """Construction rules for unfinished trees, by `grammar`.

    Each type stands at most once in a tree. A set of types is *open* if some legal structure holds all of them,
    and *complete* if it is one.
    """

    grammar: Grammar
    _allowed: dict[tuple[Types, int], tuple[Placed, ...]] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def options(self) -> tuple[Placed, ...]:
        """All types, in the order of the grammar."""
        return tuple(Placed(name, place) for name, places in self.grammar.places.items() for place in places)

    @cached_property
    def mass_chains(self) -> tuple[Placed, ...]:
        """Types that bring masses, the fewest first."""
        return tuple(sorted((o for o in self.options if o.effect.masses), key=lambda o: o.effect.masses))

    @cached_property
    def largest_size(self) -> int:
        """Nodes of the largest legal tree, of effects that exclude each other with the first ones."""
        types: tuple[Placed, ...] = self.mass_chains[-1:]
        while more := self.allowed(types):
            types = (*types, more[0])
        return len(types)

    def complete(self, types: Iterable[Placed]) -> bool:
        """Return True if `types` are a legal structure as they are."""
        listed = tuple(types)
        if not listed or len(set(listed)) != len(listed):
            return False
        return self.grammar.broken_rule(Structure(listed)) is None

    def completing(self, types: Iterable[Placed]) -> tuple[Placed, ...]:
        """Multiple-mass systems, fewest masses first, that complete `types`, which hold none."""
        listed = tuple(types)
        return tuple(ladder for ladder in self.mass_chains if self.complete((*listed, ladder)))

    def allowed(self, types: Iterable[Placed], nodes: int = 2) -> tuple[Placed, ...]:
        """Types that may be added to `types` so that it can be completed with `nodes` further nodes in all.

        Parameters
        ----------
        types : iterable of Placed
            Types that are there.
        nodes : int
            1 if the next node is the last one: it then has to bring the masses where there are none.
        """
        present = frozenset(types)
        key = (present, min(nodes, 2))
        if key not in self._allowed:
            self._allowed[key] = tuple(o for o in self.options if self._fits(present, o, nodes))
        return self._allowed[key]

    def _fits(self, present: Types, option: Placed, nodes: int) -> bool:
        if option in present:
            return False
        together = (*present, option)
        if any(placed.effect.masses for placed in together):
            return self.complete(together)
        return nodes > 1 and bool(self.completing(together))
