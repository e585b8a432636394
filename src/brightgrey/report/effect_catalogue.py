"""The function set as a page of text, from the declarations of the effects."""

from __future__ import annotations

from collections.abc import Iterator

from brightgrey.drawing.drive import drive_of
from brightgrey.drawing.picture import DriveDrawing
from brightgrey.drawing.svg import symbol_svg
from brightgrey.effects import Effect, registry
from brightgrey.kit import Placed, Structure
from brightgrey.recordings.units.signals import Units

__all__ = ["catalogue"]

WHERE = {
    "drive": "the whole drive, once",
    "mass": "a mass, counted from the motor",
    "shaft": "a shaft, counted from the motor",
}


def catalogue() -> str:
    """Every effect with its equation, parameters, units and source, as Markdown."""
    return "\n".join(line for effect in registry().values() for line in _effect(effect))


def _effect(effect: Effect) -> Iterator[str]:
    yield from (f"## {effect.number} · {effect.title}", "", _drawn(effect), "", f"`{effect.name}`. {effect.about}", "")
    yield from ("```text", effect.equation, "```", "")
    yield from ("| parameter | rotary drive | linear axis | meaning |", "|---|---|---|---|")
    rotary, linear = Units(), Units("N", "m")
    for q in effect.parameters:
        sign = "positive" if q.scale == "log" else "any sign or zero"
        units = " | ".join(units.of(q.dimension)[0] for units in (rotary, linear))
        yield f"| `{q.symbol}` | {units} | {q.about} ({sign}) |"
    yield ""
    yield f"- Stands at: {WHERE[effect.where]}."
    law = effect.law
    if law is not None:
        kept = [word for word, holds in (("odd", law.odd), ("takes energy only", law.dissipative)) if holds]
        yield from [f"- Its law is {' and '.join(kept)}."] if kept else []
    yield from ["- It has states of its own."] if effect.has_states else []
    yield from [f"- When it matters: {effect.matters}."] if effect.matters else []
    yield from [f"- Confused with: {effect.confused_with}."] if effect.confused_with else []
    yield from [f"- Never beside `{'`, `'.join(effect.excludes)}`."] if effect.excludes else []
    yield from (f"- Mind ({c.kind}, `{'`, `'.join(c.symbols)}`): {c.text}." for c in effect.cautions)
    yield from (f"- Source: {effect.source}.", "")


def _drawn(effect: Effect) -> str:
    """Symbol of the effect, or the whole chain of an effect that brings the masses."""
    if effect.masses:
        return f"<div>{DriveDrawing(drive_of(Structure((Placed(effect.name),)))).svg()}</div>"
    return f"<div>{''.join(map(symbol_svg, effect.symbols))}</div>"
