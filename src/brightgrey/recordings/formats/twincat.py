"""Text exported by Beckhoff TwinCAT Scope.

A preamble (``Name``, ``File``, ``Starttime of export``) is followed by a block of property lines with one cell per
column, an empty line, and the numbers. A column whose cells repeat the names of the properties holds the time of the
columns right of it, in ms. Each channel may have its own, or several share one. Channels that are sampled less often
end earlier. Any character but a space may be the separator; a line ``EOF`` may end the file. Times may be full stamps
in 100 ns.

Whether ``ScaleFactor``, ``Offset``, ``Unit ScaleFactor`` and ``Unit Offset`` are applied to the numbers already is an
option of the export ("Scale values before export") that the file does not tell. Two channels of one variable show it,
and so does a channel of whole numbers with a factor that is none; see `_is_scaled`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.dialect import Dialect
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.numbers import TextNumbers
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.formats.text import Text, first_text, read_text
from brightgrey.recordings.policy import READING

__all__ = ["FORMAT"]

SAMPLE_TIME, STARTED = "SampleTime[", "Starttime of export"
FULL_STAMP, TICK = 1e15, 1e-4
"""Times above the first number count 100 ns from the year 1601; the second turns them into ms."""
NO_UNIT = "(None)"


def is_scope_text(start: bytes) -> bool:
    """Recognise an export by its first line, and by its line of sample times or of the time of the export."""
    text = first_text(start)
    return bool(re.match(r"Name[^\w\s]|Name\t", text)) and (f"\n{SAMPLE_TIME}" in text or f"\n{STARTED}" in text)


def read_scope_text(path: Path, like: str = "") -> Table:
    """Open an export of TwinCAT Scope; its columns are the channels, each with its time.

    Raises
    ------
    RecordingError
        For a file without the line of names, or without numbers.
    """
    text = read_text(path)
    head = text.lines(0, min(len(text), READING.head_lines)) if text else []
    delimiter = head[0][4] if head and len(head[0]) > 4 else "\t"
    names_at = next((i for i, line in enumerate(head[1:], 1) if line.startswith(f"Name{delimiter}")), None)
    if text is None or names_at is None:
        raise RecordingError(f"{path.name}: the export of TwinCAT Scope has no line with the names of the channels")
    end = next((i for i, line in enumerate(head[names_at:], names_at) if not line.strip()), len(head))
    properties = [[cell.strip() for cell in line.split(delimiter)] for line in head[names_at:end]]
    columns = _columns(properties, path.name)
    content = text.content(())
    body = content[content >= end]
    while body.size and text.line(int(body[-1])).strip() in ("EOF", ""):
        body = body[:-1]
    if not body.size:
        raise RecordingError(f"{path.name}: there are no numbers below the properties of the channels")
    table = Table(path.name, columns, body + 1, lambda indices: np.empty(0))
    dialect = Dialect(delimiter, _decimal(text, int(body[0]), delimiter))
    numbers = TextNumbers(text, body, len(columns), dialect, {}, table, ragged=True)
    numbers.check_widths()
    return _scaled(replace(table, load=numbers.load), _scales(properties, len(columns)))


def _columns(properties: list[list[str]], name: str) -> tuple[Column, ...]:
    """Return a column for every cell of the property lines; times have no name, and stand below their first word.

    The line of sample times is left out by a short header; the time is in ms then.
    """
    rows = _by_name(properties)
    names, units = rows["Name"], rows.get("Unit", [])
    sampling = next((cells for key, cells in rows.items() if key.startswith(SAMPLE_TIME)), names)
    unit = sampling[0][len(SAMPLE_TIME) :].rstrip("]") if sampling is not names else "ms"
    columns, clock = [], 0
    for i, cell in enumerate(sampling):
        if cell == sampling[0]:
            clock = i
            columns.append(Column("", "", unit or "ms"))
        elif i < len(names) and names[i]:
            columns.append(Column(names[i], names[i], _unit(units[i] if i < len(units) else ""), clock))
    if not any(column.name for column in columns):
        raise RecordingError(f"{name}: the export of TwinCAT Scope names no channel")
    return tuple(columns)


def _by_name(properties: list[list[str]]) -> dict[str, list[str]]:
    return {cells[0]: cells for cells in properties if cells and cells[0]}


@dataclass(frozen=True)
class _Scale:
    """Scaling of one channel: the exported number is factor times the recorded one, plus offset, if it is applied."""

    variable: str
    whole: bool
    factor: float
    offset: float

    @property
    def trivial(self) -> bool:
        """True if the scaling changes nothing."""
        return (self.factor, self.offset) == (1.0, 0.0)


def _scales(properties: list[list[str]], columns: int) -> dict[int, _Scale]:
    """Return the scaling of every column."""
    rows = _by_name(properties)

    def number(name: str, i: int, default: float) -> float:
        cell = rows.get(name, [])[i : i + 1]
        try:
            value = float(cell[0].replace(",", ".")) if cell else default
        except ValueError:
            return default
        return value if np.isfinite(value) else default

    def text(name: str, i: int) -> str:
        return "".join(rows.get(name, [])[i : i + 1])

    scales = {}
    for i in range(columns):
        unit = number("Unit ScaleFactor", i, 1.0)
        factor = number("ScaleFactor", i, 1.0) * unit
        offset = number("Offset", i, 0.0) * unit + number("Unit Offset", i, 0.0)
        whole = "INT" in text("Data-Type", i) or "BIT" in text("Data-Type", i)
        scales[i] = _Scale(f"{text('NetID', i)} {text('SymbolName', i)}", whole, factor, offset)
    return scales


def _scaled(table: Table, scales: dict[int, _Scale]) -> Table:
    """Return a table with all scalings applied, and with times in ms from the first."""
    channels = {i: scale for i, scale in scales.items() if table.columns[i].name}
    with_scale = [i for i, scale in channels.items() if not scale.trivial]
    scaled = _is_scaled(table, channels) if with_scale else True
    notes = table.notes
    if scaled is None:
        names = ", ".join(f"'{table.columns[i].name}'" for i in with_scale[: READING.listed_columns])
        notes = (*notes, f"ScaleFactor and Offset of {names} are taken as applied already; the file does not tell")

    def load(indices: Sequence[int]) -> Array:
        values = table.load(indices)
        for row, i in zip(values, indices, strict=True):
            if not table.columns[i].name and np.nanmax(row, initial=0.0) > FULL_STAMP:
                row[:] = (row - np.nanmin(row)) * TICK
            elif scaled is False and i in channels:
                row[:] = channels[i].factor * row + channels[i].offset
        return values

    return replace(table, load=load, notes=notes)


def _is_scaled(table: Table, channels: dict[int, _Scale]) -> bool | None:
    """Return True if the numbers are scaled already, False if they are as recorded, None if nothing shows it."""
    variables: dict[str, list[int]] = {}
    for i, scale in channels.items():
        variables.setdefault(scale.variable, []).append(i)
    for group in variables.values():
        first = next((i for i in group if channels[i].trivial), None)
        other = next((i for i in group if not channels[i].trivial), None)
        if first is not None and other is not None:
            x, y = table.load([first, other])
            both = np.isfinite(x) & np.isfinite(y)
            scale = channels[other]
            raw = bool(np.array_equal(x[both], y[both]))
            applied = bool(np.allclose(y[both], scale.factor * x[both] + scale.offset, rtol=1e-5, atol=1e-9))
            if raw != applied:
                return applied
    for i, scale in channels.items():
        if scale.whole and not scale.trivial:
            (x,) = table.load([i])
            shown = _whole_numbers_are_scaled(np.unique(x[np.isfinite(x)]), scale)
            if shown is not None:
                return shown
    return None


def _whole_numbers_are_scaled(levels: Array, scale: _Scale) -> bool | None:
    """Return what the levels of a channel that recorded whole numbers show."""
    if (levels != np.rint(levels)).any():
        return True
    if levels.size < READING.many_levels:
        return None
    if scale.factor != round(scale.factor):
        return False  # scaled numbers would not all be whole
    steps = np.diff(levels) / (scale.factor or 1.0)
    return None if abs(scale.factor) == 1.0 else bool((steps == np.rint(steps)).all())


def _unit(cell: str) -> str | None:
    """Return the unit in a cell like ``V (Voltage)``, None for ``(None)``."""
    return re.sub(r"\s*\([^)]*\)$", "", cell) or None if cell != NO_UNIT else None


def _decimal(text: Text, first: int, delimiter: str) -> str:
    """Return the decimal mark of the numbers from a line on."""
    if delimiter == ",":
        return "."
    return "," if text.data.find(b",", int(text.starts[first])) >= 0 else "."


FORMAT = FileFormat("Beckhoff TwinCAT Scope", is_scope_text, read_scope_text, text=True)
