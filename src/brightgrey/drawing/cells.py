"""Cells of a drawing: input, block, mass and shaft, each with what stands at it and with its texts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from brightgrey.drawing.drive import DrivePart, Sensor, ValueText, shown_symbol
from brightgrey.drawing.items import STYLE, Cell, DrawnItem, Label, PlacedSymbol, Wire
from brightgrey.drawing.text_width import text_width, wrap
from brightgrey.effects import Symbol

__all__ = ["Before", "block_cell", "input_cell", "mark_cell", "mass_cell", "shaft_cell"]

FLAG = Symbol("load", 24.0, 18.0, (((0.0, 9.0), (3.0, 9.0)), ((3.0, 18.0), (3.0, 1.0), (23.0, 6.0), (3.0, 11.0))))
GROUND = Symbol(
    "ground",
    8.0,
    26.0,
    (((1.0, 1.0), (1.0, 25.0)), *(((1.0, 7.0 + 6.0 * i), (7.0, 1.0 + 6.0 * i)) for i in range(4))),
)
RING = Symbol("input", 20.0, 20.0, circles=((10.0, 10.0, 10.0),))
_UNSURE = " ?"
Runs = tuple[tuple[str, bool], ...]
Before = Literal["input", "shaft", "nothing"]
"""What leads to a mass from the left."""


def input_cell(name: str) -> Cell:
    """Name of the input above the wire that carries it."""
    texts = _upwards(0.0, -STYLE.gap, _wrapped(name, STYLE.size))
    width = max(_right(texts) + STYLE.gap, 60.0)
    return Cell(width, [*texts, Wire(0.0, 0.0, width, 0.0)])


def block_cell(part: DrivePart) -> Cell:
    """Block in the path of the input, its texts below."""
    symbol = part.symbol
    mark = _mark(part, STYLE.lead, -0.5 * symbol.height)
    texts = _downwards(STYLE.lead, 0.5 * symbol.height + STYLE.gap, _lines(part))
    width = max(mark.box[2], _right(texts)) + STYLE.gap
    wires = [Wire(0.0, 0.0, mark.x, 0.0, arrow=True), Wire(mark.box[2], 0.0, width, 0.0)]
    return Cell(width, [mark, *texts, *wires])


def mass_cell(
    parts: Sequence[DrivePart],
    sensors: Sequence[Sensor],
    before: Before,
    driven: str = "",
    *,
    last: bool,
) -> Cell:
    """Mass with loads and sensors above, its inertia and what leads to the ground below.

    `driven` is the name of an input that acts on it from elsewhere.
    """
    body = next(part for part in parts if part.symbol.at == "body")
    left = STYLE.lead if before == "shaft" else 2.5 * STYLE.lead
    mark = _mark(body, left, -0.5 * body.symbol.height)
    centre = 0.5 * (mark.x + mark.box[2])
    on_ground = any(part.symbol.at == "ground" for part in parts)
    inertia = _downwards(centre + STYLE.bus if on_ground else left, mark.box[3] + STYLE.gap, _lines(body))
    items: list[DrawnItem] = [mark, *inertia, *_loads(parts, sensors, driven, centre, mark.y)]
    items += _grounded(parts, centre, mark.box[3], _bottom(inertia))
    width = _right(items) + (STYLE.gap if not last else 0.0)
    if before != "nothing":
        items.append(Wire(0.0, 0.0, left, 0.0, arrow=before == "input", dashed=body.undecided))
    if not last:
        onward = any(part.symbol.at == "spring" and part.undecided for part in parts)
        items.append(Wire(mark.box[2], 0.0, width, 0.0, dashed=onward))
    return Cell(width, items, dashed=body.undecided)


def _loads(
    parts: Sequence[DrivePart], sensors: Sequence[Sensor], driven: str, centre: float, top: float
) -> list[DrawnItem]:
    """Input from elsewhere, loads and flags of sensors on a stem above the mass, the sensors on top."""
    x = centre + STYLE.bus
    entries: list[tuple[PlacedSymbol, list[tuple[Runs, bool]]]] = []
    if driven:
        ring = PlacedSymbol(x, 0.0, _lettered_ring(STYLE.input_mark), about=f"Input: {driven}")
        entries.append((ring, _wrapped(driven, STYLE.size)))
    entries += [(_mark(part, x, 0.0), _lines(part)) for part in parts if part.symbol.at == "load"]
    for sensor in sensors:
        flag = PlacedSymbol(x, 0.0, FLAG, about=f"Sensor: {sensor.name}, {sensor.kind}")
        entries.append((flag, [*_wrapped(sensor.name, STYLE.size), *_wrapped(sensor.kind, STYLE.small)]))
    items: list[DrawnItem] = []
    ends: list[tuple[float, bool]] = []
    y = top - STYLE.gap
    for mark, lines in entries:
        y -= max(mark.symbol.height, len(lines) * STYLE.line_height)
        end = y + 0.5 * mark.symbol.height
        ends.append((end, mark.dashed))
        items += [mark.moved(0.0, y), Wire(centre, end, x, end, dashed=mark.dashed)]
        items += _downwards(x + mark.symbol.width + STYLE.gap, y, lines)
        y -= STYLE.gap
    return [*items, *_stem(centre, top, ends)]


def _grounded(parts: Sequence[DrivePart], centre: float, foot: float, y: float) -> list[DrawnItem]:
    """Parts between the mass and the ground, side by side on a wire that leads down from the mass."""
    x = centre + STYLE.bus
    items: list[DrawnItem] = []
    ends: list[tuple[float, bool]] = []
    for part in (part for part in parts if part.symbol.at == "ground"):
        symbol, lines = part.symbol, _lines(part)
        y += STYLE.gap
        height = max(symbol.height, GROUND.height)
        end = y + 0.5 * height
        ends.append((end, part.undecided))
        mark = _mark(part, x, end - 0.5 * symbol.height)
        wall = PlacedSymbol(mark.box[2] + STYLE.lead, end - 0.5 * GROUND.height, GROUND, dashed=part.undecided)
        items += [mark, wall, Wire(centre, end, x, end, dashed=part.undecided)]
        items.append(Wire(mark.box[2], end, wall.x, end, dashed=part.undecided))
        items += _downwards(wall.box[2] + STYLE.gap, y, lines)
        y += max(height, len(lines) * STYLE.line_height)
    return [*items, *_stem(centre, foot, ends)]


def _stem(x: float, start: float, ends: Sequence[tuple[float, bool]]) -> list[Wire]:
    """Wire from a mass along which parts hang, each with a mark if it is undecided; dashed beyond the last decided."""
    solid = next((y for y, undecided in reversed(ends) if not undecided), start)
    last = ends[-1][0] if ends else start
    wires = Wire(x, start, x, solid), Wire(x, solid, x, last, dashed=True)
    return [wire for wire in wires if wire.y1 != wire.y2]


def shaft_cell(parts: Sequence[DrivePart]) -> Cell:
    """Spring beside damper, then what stands in series with them."""
    spring, damper = (next(p for p in parts if p.symbol.at == kind) for kind in ("spring", "damper"))
    left, length = STYLE.lead, spring.symbol.width
    marks = [_mark(spring, left, -22.0), _mark(damper, left, 22.0 - damper.symbol.height)]
    level = 22.0 - 0.5 * damper.symbol.height
    unsure = spring.undecided
    items: list[DrawnItem] = [Wire(0.0, 0.0, left, 0.0, dashed=unsure), *marks]
    items += [Wire(x, -level, x, level, dashed=unsure) for x in (left, left + length)]
    items += _upwards(left, -22.0 - STYLE.gap, _lines(spring))
    below = _downwards(left, 22.0 + STYLE.gap, _lines(damper))
    x, y = left + length, _bottom(below)
    for part in (p for p in parts if p.symbol.at == "series"):
        mark = _mark(part, x + STYLE.lead, -0.5 * part.symbol.height)
        items += [mark, Wire(x, 0.0, mark.x, 0.0, dashed=unsure)]
        x = mark.box[2]
        below += _downwards(left, y + STYLE.gap, _lines(part))
        y = _bottom(below)
    items += below
    width = max(x, _right(items)) + STYLE.gap
    return Cell(width, [*items, Wire(x, 0.0, width, 0.0, dashed=unsure)], dashed=unsure)


def mark_cell(letter: str, *, ends: bool, dashed: bool) -> Cell:
    """Letter in a circle, where a row ends or begins."""
    size, width = RING.width, STYLE.mark_width
    x = width - size if ends else 0.0
    symbol = _lettered_ring(letter)
    wire = Wire(*((0.0, 0.0, x) if ends else (size, 0.0, width)), 0.0, dashed=dashed)
    return Cell(width, [PlacedSymbol(x, -0.5 * size, symbol, about=f"goes on at {letter}"), wire], is_mark=True)


def _lettered_ring(letter: str) -> Symbol:
    return Symbol("input", RING.width, RING.height, circles=RING.circles, letters=letter)


def _mark(part: DrivePart, x: float, y: float) -> PlacedSymbol:
    values = ", ".join(" ".join([name, "=", *_value_words(value)]) if value else name for name, value in part.values)
    name = part.title or {"body": "Mass", "spring": "Spring", "damper": "Damper"}.get(part.symbol.at, part.effect)
    about = f"{name} at place {part.place}: {values}" + ("; not decidable" if part.undecided else "")
    return PlacedSymbol(x, y, part.symbol, part.effect, about, part.undecided)


def _value_words(value: ValueText) -> list[str]:
    interval = [f"± {value.half_width}"] if value.half_width else []
    return [value.value, *interval, *([value.unit] if value.unit not in ("", "1") else [])]


def _lines(part: DrivePart) -> list[tuple[Runs, bool]]:
    """Lines beside a part: its name, then its values; each with a mark if it is less important."""
    lines: list[tuple[Runs, bool]] = []
    named = wrap(part.title, STYLE.small, STYLE.text_width - text_width(_UNSURE, STYLE.small))
    if named and part.undecided:
        named[-1] += _UNSURE
    lines += [(((line, False),), True) for line in named]
    for name, value in part.values:
        runs = shown_symbol(name)
        if value is None:
            lines.append(((*runs, (_UNSURE, False)) if part.undecided and not part.title else runs, False))
            continue
        lines += ((line, False) for line in _value_lines(runs, value))
    return lines


def _value_lines(runs: Runs, value: ValueText) -> list[Runs]:
    """A value in as few lines as it needs; its unit stands beside the half width if both fit a line."""
    first, *rest = _value_words(value)
    lines: list[Runs] = []
    for texts in ([" ".join([first, *rest])], [first, " ".join(rest)], [first, *rest]):
        lines = [(*runs, (f" = {texts[0]}", False)), *(((text, False),) for text in texts[1:] if text)]
        if all(Label(0.0, 0.0, line).width <= STYLE.text_width for line in lines):
            break
    return lines


def _wrapped(text: str, size: float) -> list[tuple[Runs, bool]]:
    """Lines of a text, each with a mark that small ones are less important."""
    return [(((line, False),), size < STYLE.size) for line in wrap(text, size, STYLE.text_width)]


def _downwards(x: float, top: float, lines: Sequence[tuple[Runs, bool]]) -> list[Label]:
    """Lines of text below each other, the first one below `top`."""
    return [
        Label(x, top + STYLE.line_height * (i + 1) - 4.0, runs, STYLE.small if soft else STYLE.size, soft)
        for i, (runs, soft) in enumerate(lines)
    ]


def _upwards(x: float, bottom: float, lines: Sequence[tuple[Runs, bool]]) -> list[Label]:
    """Lines of text below each other, the last one above `bottom`."""
    return _downwards(x, bottom - STYLE.line_height * len(lines), lines)


def _right(items: Sequence[DrawnItem]) -> float:
    return max((item.box[2] for item in items), default=0.0)


def _bottom(items: Sequence[DrawnItem]) -> float:
    return max((item.box[3] for item in items), default=0.0)
