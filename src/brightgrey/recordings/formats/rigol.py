"""CSV of Rigol oscilloscopes: samples are numbered or not, and the header gives the time of the first one and the step.

X,CH1,CH2,Start,Increment,
Sequence,Volt,Volt,-1.500000e+00,1.000000e-03
0,1.20e+00,3.40e+00,

CH1V,CH2V,t0 = -1.500000e+00s, tInc = 1.000000e-03s,
1.20e+00,3.40e+00,,
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
from brightgrey.recordings.units.parser import is_unit

__all__ = ["FORMAT"]

NUMBERED_HEADER = re.compile(r"X,([^,\n]+,)+Start,Increment")
STEPPED_HEADER = re.compile(
    r"(?P<names>(?:[^,\n=]+,)+)\s*t0\s*=\s*(?P<start>[^,\ns]+)s?\s*,\s*tInc\s*=\s*(?P<step>[^,\ns]+)s?[\s,]*(?:\n|$)"
)
COMMAS = Dialect(",", ".")


@dataclass(frozen=True)
class _ScopeHeader:
    """Channels of a file, and what gives their times."""

    columns: tuple[Column, ...]  #: Of the file, with that of the numbers of the samples if there is one.
    numbered: bool
    start: float | None
    step: float | None
    lines: int


def is_numbered(start: bytes) -> bool:
    """Recognise a file by its header."""
    text = first_text(start)[:2000]
    return bool(NUMBERED_HEADER.match(text) or STEPPED_HEADER.match(text))


def _rigol_header(text: Text) -> _ScopeHeader:
    """Read the header in the first line, or in the first two."""
    if match := STEPPED_HEADER.match(text.line(0)):
        names = [name.strip() for name in match["names"].split(",") if name.strip()]
        channels = [
            Column(n[:-1], n, n[-1], 0) if re.fullmatch(r"\w+\d[VA]", n) else Column(n, n, None, 0) for n in names
        ]
        start, step = COMMAS.number(match["start"].strip()), COMMAS.number(match["step"].strip())
        return _ScopeHeader(tuple(channels), False, start, step, 1)
    names, units = COMMAS.split(text.line(0)), COMMAS.split(text.line(1))
    width = names.index("Start")
    units += [""] * (width + 2 - len(units))
    start, step = (COMMAS.number(cell) for cell in units[width : width + 2])
    channels = [Column(n, n, u if is_unit(u) else None, 0) for n, u in zip(names[1:width], units[1:width], strict=True)]
    return _ScopeHeader((Column("", "", "s"), *channels), True, start, step, 2)


def read_numbered(path: Path, like: str = "") -> Table:
    """Open a file of an oscilloscope; its time has no name.

    Raises
    ------
    RecordingError
        For a file without numbers, or without the time of the first sample and the step.
    """
    text = read_text(path)
    if text is None or len(text) < 3:
        raise RecordingError(f"{path.name}: there are no numbers below the header of the oscilloscope")
    header = _rigol_header(text)
    start, step = header.start, header.step
    if start is None or step is None or not (np.isfinite(start) and 0.0 < step < np.inf):
        raise RecordingError(
            f"{path.name}: row {header.lines}: no numbers for the first time and the step (Start and Increment, or t0"
            " and tInc)"
        )
    body = text.content(())
    body = body[body >= header.lines]
    if not body.size:
        raise RecordingError(f"{path.name}: there are no numbers below the header of the oscilloscope")
    own = Table(path.name, header.columns, body + 1, lambda indices: np.empty(0))
    numbers = TextNumbers(text, body, len(header.columns), COMMAS, {}, own)
    numbers.check_widths()
    before = 0 if header.numbered else 1

    def load(indices: Sequence[int]) -> Array:
        wanted = [i - before for i in indices if i >= before]
        loaded = iter(numbers.load(wanted) if wanted else ())
        rows = [next(loaded) if i >= before else np.arange(body.size, dtype=np.float64) for i in indices]
        return np.array([row if i else start + step * row for row, i in zip(rows, indices, strict=True)])

    columns = header.columns if header.numbered else (Column("", "", "s"), *header.columns)
    return replace(own, columns=columns, load=load)


FORMAT = FileFormat("Rigol oscilloscope", is_numbered, read_numbered, text=True)
