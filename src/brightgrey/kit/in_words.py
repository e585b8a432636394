"""Structures and effects in the words of an engineer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from brightgrey.kit.structure import Placed, Structure

__all__ = [
    "effect_heading",
    "effect_in_words",
    "effects_in_words",
    "enumerated",
    "masses_in_words",
    "parameters_in_words",
    "structure_in_words",
]

_COUNTS = ("no", "one", "two", "three", "four")


def enumerated(items: Sequence[str], last: str = "and") -> str:
    """Items as they stand in a sentence: ``a, b and c``; `last` is the word before the last one."""
    return f" {last} ".join([*([", ".join(items[:-1])] if items[:-1] else []), *items[-1:]])


def effect_in_words(placed: Placed, *, article: bool = True) -> str:
    """Name of an effect within a sentence, with its place unless that is the first.

    Parameters
    ----------
    placed : Placed
    article : bool
        With its article where it has one: ``a constant load``; otherwise ``constant load``.
    """
    words = placed.effect.words if article else placed.effect.words.removeprefix("a ")
    return words if placed.place == 1 else f"{words} at {placed.effect.where} {placed.place}"


def effect_heading(placed: Placed) -> str:
    """Name of an effect at the head of a card or a line: ``Second mass``."""
    words = effect_in_words(placed, article=False)
    return f"{words[:1].upper()}{words[1:]}"


def masses_in_words(structure: Structure) -> str:
    """Number of masses: ``two masses``."""
    count = structure.masses
    return f"{_COUNTS[count] if count < len(_COUNTS) else count} mass{'' if count == 1 else 'es'}"


def effects_in_words(placed: Iterable[Placed], last: str = "and") -> list[str]:
    """Effects by their names within a sentence; masses, and kinds of friction at one place, share that word.

    ``Coulomb, viscous and Stribeck friction`` is one item; `last` is the word before its last part.
    """
    shared: dict[tuple[str, int], list[Placed]] = {}
    for one in placed:
        noun = one.effect.words.rsplit(" ", 1)[-1]
        key = (noun, one.place) if one.effect.stage in ("friction", "masses") else (one.name, one.place)
        shared.setdefault(key, []).append(one)
    out = []
    for (noun, _), group in shared.items():
        before = [one.effect.words.removesuffix(f" {noun}") for one in group[:-1]]
        out.append(enumerated([*before, effect_in_words(group[-1])], last))
    return out


def parameters_in_words(structure: Structure) -> dict[str, str]:
    """Parameters by name, each with what it belongs to, ``viscous friction at mass 2``, or of masses its meaning."""
    return {
        placed.parameter(q.symbol): q.about if placed.effect.masses else effect_in_words(placed, article=False)
        for placed in structure.placed
        for q in placed.effect.parameters
    }


def structure_in_words(structure: Structure) -> str:
    """Structure as a phrase: ``two masses with Coulomb and viscous friction, and dead time``."""
    items = effects_in_words(p for p in structure.placed if not p.effect.masses)
    if not items:
        return masses_in_words(structure)
    return f"{masses_in_words(structure)} with {', '.join(items[:-1])}{', and ' if items[:-1] else ''}{items[-1]}"
