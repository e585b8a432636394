"""Choice that a recording leaves open: several minimal structures, each with another effect."""

from __future__ import annotations

from collections.abc import Sequence

from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words, structure_in_words
from brightgrey.search.lattice import has
from brightgrey.search.policy import FURTHER
from brightgrey.search.verdicts import Reason

__all__ = ["open_choice"]


def open_choice(minimal: Sequence[Structure], effect: str) -> Reason:
    """Reason why an effect is not decidable that some minimal structures have, and others lack.

    Where all that lack it have others in its place, it is one of several, and these are named.

    Parameters
    ----------
    minimal : sequence of Structure
    effect : str
    """
    having = [s for s in minimal if has(s, effect)]
    lacking = [s for s in minimal if s not in having]
    beside = frozenset[Placed]().union(*(s.beside for s in having))
    others = [s.beside - beside for s in lacking]
    if all(others):
        instead = sorted(frozenset[Placed]().union(*others), key=lambda p: (p.effect.number, p.place))
        choice = [Placed.parse(effect), *instead]
        named = [_with_place(p, at_several_places=sum(p.name == q.name for q in choice) > 1) for p in choice]
        return Reason("one of several", names=tuple(named[: FURTHER.named]))
    return Reason("equivalent", names=(structure_in_words(having[0]), structure_in_words(lacking[0])))


def _with_place(placed: Placed, *, at_several_places: bool) -> str:
    """Name of an effect, with its place also if that is the first of several."""
    words = effect_in_words(placed)
    return f"{words} at {placed.effect.where} 1" if at_several_places and placed.place == 1 else words
