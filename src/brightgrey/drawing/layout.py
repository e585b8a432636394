"""Layout of a drawing: every part, wire and text with its place, before anything is drawn.

The drive is a row of cells from left to right: the input with its blocks, then mass, shaft, mass. Cells are put into
rows that are no wider than asked; a circle with a letter ends a row and begins the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from brightgrey.drawing.cells import Before, block_cell, input_cell, mark_cell, mass_cell, shaft_cell
from brightgrey.drawing.drive import Drive
from brightgrey.drawing.items import STYLE, Cell, DrawnItem, Label
from brightgrey.drawing.text_width import wrap

__all__ = ["Layout", "lay_out"]


@dataclass(frozen=True)
class Layout:
    """Places of everything in a drawing.

    Attributes
    ----------
    title : str
        Sentence for people who do not see it.
    width, height : float
        Size in pixels.
    items : tuple of DrawnItem
        Parts, wires and texts.
    """

    title: str
    width: float
    height: float
    items: tuple[DrawnItem, ...]


def lay_out(drive: Drive, width: float = STYLE.wide) -> Layout:
    """Layout of a drive.

    Parameters
    ----------
    drive : Drive
    width : float
        Most pixels in a row. A single part with its texts may be wider than a very small width.

    Returns
    -------
    Layout
    """
    items: list[DrawnItem] = []
    y, widest = STYLE.margin, 0.0
    rows = _broken_rows(_cells(drive), width - 2.0 * STYLE.margin)
    for row in rows:
        top = min(cell.top for cell in row)
        x = STYLE.margin
        for cell in row:
            items += [item.moved(x, y - top) for item in cell.items]
            x += cell.width
        widest = max(widest, x)
        y += max(cell.bottom for cell in row) - top + STYLE.row_gap
    y -= STYLE.row_gap
    if any(part.undecided for part in drive.parts):
        y += 2.0 * STYLE.gap
        for line in wrap(STYLE.legend, STYLE.small, max(width, widest) - 2.0 * STYLE.margin):
            y += STYLE.line_height
            text = Label(STYLE.margin, y - 0.3 * STYLE.small, ((line, False),), STYLE.small, soft=True)
            items.append(text)
            widest = max(widest, text.box[2])
    return Layout(drive.title, widest + STYLE.margin, y + STYLE.margin, tuple(items))


def _cells(drive: Drive) -> list[Cell]:
    """Cells of the whole drive in the order of the power flow."""
    blocks = [part for part in drive.parts if part.symbol.at == "input"]
    # A dead time is that of the bus, so that it comes before the current control that acts on what has come.
    cells = [input_cell(drive.input), *(block_cell(part) for part in reversed(blocks))]
    if drive.actuator > 1:  # its wire goes on at the driven mass
        cells.append(replace(mark_cell(STYLE.input_mark, ends=True, dashed=False), is_mark=False))
    for place in range(1, drive.masses + 1):
        sensors = [sensor for sensor in drive.sensors if sensor.mass == place]
        of_place = [part for part in drive.parts if part.place == place]
        driven = drive.input if place == drive.actuator > 1 else ""
        before: Before = "shaft" if place > 1 else "input" if drive.actuator == 1 else "nothing"
        cells.append(mass_cell(of_place, sensors, before, driven, last=place == drive.masses))
        if place < drive.masses:
            cells.append(shaft_cell(of_place))
    return cells


def _broken_rows(cells: Sequence[Cell], width: float) -> list[list[Cell]]:
    """Cells in rows, each row that goes on ended and the next one begun by a letter."""
    rows: list[list[Cell]] = [[]]
    for i, cell in enumerate(cells):
        room = width - sum(c.width for c in rows[-1])
        if i + 1 < len(cells):
            room -= STYLE.mark_width
        own = sum(not c.is_mark for c in rows[-1])
        if own and cell.width > room:
            letter = chr(ord("A") + len(rows) - 1)
            rows[-1].append(mark_cell(letter, ends=True, dashed=cell.dashed))
            rows.append([mark_cell(letter, ends=False, dashed=cell.dashed)])
        rows[-1].append(cell)
    return rows
