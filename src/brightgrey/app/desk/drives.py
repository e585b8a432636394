"""What the desk does with drives: effects to choose from, contradictions, and the drawing, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from brightgrey.app.workspace.project import MASS_EFFECTS, AxisChoice
from brightgrey.drawing.drive import drive_of
from brightgrey.drawing.picture import DriveDrawing
from brightgrey.errors import BrightgreyError, one_of
from brightgrey.kit import Placed, Structure, grammar_named
from brightgrey.kit.in_words import effect_heading
from brightgrey.option_texts import number
from brightgrey.search.lattice import Lattice

__all__ = ["check_drive", "drive_picture", "effect_choices"]

_OPTIONAL_IN_DRAWING = ("coulomb", "viscous", "gravity", "backlash", "current_control", "delay")
"""Effects that are drawn dashed while nothing is known of them."""


def effect_choices() -> dict[str, Any]:
    """Effects and parameters that a user may know something of, with words and explanations."""
    grammar = grammar_named("drive")
    effects = [
        {"name": str(p), "title": effect_heading(p), "about": p.effect.about, "equation": p.effect.equation}
        for p in (*grammar.placed, *grammar.further)
        if not p.effect.masses and p.place == 1
    ]
    parameters = [{"name": name, "about": declared.about} for name, declared in grammar.parameters.items()]
    return {"effects": effects, "parameters": [p for p in parameters if "@" not in p["name"]]}


def drive_picture(motion: str, least: int, most: int, certain: Sequence[str], absent: Sequence[str]) -> str:
    """Drawing of what is known of a drive; what is open is dashed.

    Parameters
    ----------
    motion : {'rotary', 'linear'}
    least, most : int
        Number of masses.
    certain, absent : sequence of str
        Effects.
    """
    chosen = [Placed.parse(name) for name in certain if Placed.parse(name).place <= max(least, 1)]
    chosen = [p for p in chosen if p.effect.where != "shaft" or p.place < least]
    structure = Structure((Placed(MASS_EFFECTS[least]), *chosen))
    undecided = [MASS_EFFECTS[n] for n in range(least + 1, most + 1)]
    for name in (*_OPTIONAL_IN_DRAWING, *certain):
        placed = Placed.parse(name)
        enough = most > placed.place if placed.effect.where == "shaft" else True
        if enough and name not in absent and placed not in structure.placed:
            undecided.append(name)
    drive = drive_of(
        structure,
        rotary=motion == "rotary",
        undecided=undecided,
    )
    return DriveDrawing(drive).html()


def check_drive(drive: Mapping[str, Any]) -> str:
    """Say which choices of a drive contradict each other; empty if none do."""
    chosen = AxisChoice.model_validate(drive)
    grammar = grammar_named("drive")
    try:
        Lattice.of(grammar.whole, chosen.required, chosen.excluded)
        for known in chosen.known:
            one_of("parameter", known.name, sorted(grammar.parameters))
            for text in (known.low, known.high):
                if text:
                    number(known.name, text, "a number in the recording's units")
    except BrightgreyError as error:
        return str(error)
    return ""
