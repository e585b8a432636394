"""LabVIEW measurement files (.lvm): a header of tags, then segments, each with a header of tags, names and numbers.

The tags say delimiter, decimal mark, units, and where the times are: in one column, in one for each channel, or nowhere
but in the step ``Delta_X``. National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array, Indices
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.dialect import Dialect
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.numbers import TextNumbers
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.formats.text import Text, first_text, read_text
from brightgrey.recordings.policy import READING

__all__ = ["FORMAT"]

TITLE = "LabVIEW Measurement"
END = "***End_of_Header***"
SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}
X_VALUE, COMMENT = "X_Value", "Comment"


@dataclass(frozen=True)
class _Header:
    """Tags of the file and of its first segment, the names of its columns, and the line of the first number."""

    tags: Mapping[str, Sequence[str]]
    names: Sequence[str]
    dialect: Dialect
    body: int

    def above(self, tag: str, column: int) -> str:
        """Return the text of a tag that stands above a column; empty without one."""
        return "".join(self.tags.get(tag, ())[column - 1 : column])

    @property
    def step(self) -> float | None:
        """Step of the time in s if all channels have the same one."""
        steps = {text for text in self.tags.get("Delta_X", ()) if text}
        step = self.dialect.number(steps.pop()) if len(steps) == 1 else None
        return step if step is not None and step > 0.0 else None


def is_labview(start: bytes) -> bool:
    """Recognise a file by the words that it has to begin with."""
    return first_text(start).startswith(TITLE)


def read_labview(path: Path, like: str = "") -> Table:
    """Open a measurement file; its times have no names, and each channel has its own one.

    Raises
    ------
    RecordingError
        For a file without header or numbers, and for one that gives no time.
    """
    text = read_text(path)
    header = _header(text) if text else None
    if text is None or header is None:
        raise RecordingError(f"{path.name}: the LabVIEW file ends before its header does")
    body, segments = _body(text, header)
    if not body.size:
        raise RecordingError(f"{path.name}: there are no numbers below the header of the LabVIEW file")
    columns = _labview_columns(header)
    table = Table(path.name, columns, body + 1, lambda indices: np.empty(0))
    numbers = TextNumbers(text, body, len(header.names), header.dialect, {}, table, ragged=True)
    numbers.check_widths()
    table = replace(table, load=numbers.load)
    first = dict(enumerate(header.dialect.split(text.line(int(body[0])))))
    timed = any(name == X_VALUE and first.get(i) for i, name in enumerate(header.names))
    return table if timed else _with_steps(table, header, segments)


def _header(text: Text) -> _Header | None:
    """Read the tags, None if they do not end."""
    lines = text.lines(0, min(len(text), READING.head_lines))
    ends = [i for i, line in enumerate(lines) if line.startswith(END)][:2]
    if len(ends) < 2 or ends[1] + 2 > len(lines):
        return None
    own = {line.strip()[:9]: line.strip()[9:].strip() for line in lines[: ends[0]]}
    delimiter = SEPARATORS.get(own.get("Separator", "").strip(",;\t "), "\t")
    cells = [[cell.strip() for cell in line.split(delimiter)] for line in lines[: ends[1] + 2]]
    tags = {row[0]: row[1:] for row in cells if row[0]}
    decimal = "".join(tags.get("Decimal_Separator", ["."])[:1])
    names = cells[ends[1] + 1]
    while names and not names[-1]:
        names.pop()
    dialect = Dialect(delimiter, "," if decimal == "," or (decimal == "" and delimiter == ",") else ".")
    return _Header(tags, names, dialect, ends[1] + 2)


def _body(text: Text, header: _Header) -> tuple[Indices, int]:
    """Return the lines of numbers and the number of segments; further segments have a header of their own."""
    content = text.content(())
    body = content[content >= header.body]
    more = text.data.count(END.encode(), int(text.starts[header.body]) if header.body < len(text) else len(text.data))
    if more:
        kept = [i for i in body.tolist() if text.line(i).lstrip(" ")[:1] in "+-.,;\t0123456789"]
        body = np.array(kept, dtype=np.intp)
    return body, 1 + more


def _labview_columns(header: _Header) -> tuple[Column, ...]:
    """Return a column for every name; a time has none, and channels follow their time."""
    columns, clock = [], 0
    for i, name in enumerate(header.names):
        if name == X_VALUE:
            clock = i
            columns.append(Column("", "", "s"))
        elif name == COMMENT and i == len(header.names) - 1:
            columns.append(Column(name, name))
        else:
            columns.append(Column(name or str(i + 1), name, header.above("Y_Unit_Label", i) or None, clock))
    return tuple(columns)


def _with_steps(table: Table, header: _Header, segments: int) -> Table:
    """Return a table whose one time is the number of the row times the step that the header gives."""
    step = header.step
    if step is None:
        raise table.fault("the file holds no times, and the header gives no step Delta_X that all channels share")
    own = next((i for i, column in enumerate(table.columns) if not column.name), len(table.columns))
    columns = tuple(replace(c, clock=own) if c.clock is not None else c for c in table.columns)
    columns += () if own < len(columns) else (Column("", "", "s"),)

    def load(indices: Sequence[int]) -> Array:
        values = np.empty((len(indices), table.rows.size))
        inside = [k for k, i in enumerate(indices) if i != own]
        if inside:
            values[inside] = table.load([indices[k] for k in inside])
        values[[k for k, i in enumerate(indices) if i == own]] = step * np.arange(table.rows.size)
        return values

    notes = [f"the time is {step:g} s per row, as the header says"]
    notes += [f"{segments} segments are read as one, without a pause between them"] if segments > 1 else []
    return replace(table, columns=columns, load=load, notes=(*table.notes, *notes))


FORMAT = FileFormat("LabVIEW measurement", is_labview, read_labview, text=True)
