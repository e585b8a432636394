"""CSV of Rigol oscilloscopes: samples are numbered, and the header gives the time of the first one and the step.

X,CH1,CH2,Start,Increment,
Sequence,Volt,Volt,-1.500000e+00,1.000000e-03
0,1.20e+00,3.40e+00,
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.dialect import Dialect
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.numbers import TextNumbers
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.formats.text import first_text, read_text
from brightgrey.recordings.units.parser import is_unit

__all__ = ["FORMAT"]

NUMBERED_HEADER = re.compile(r"X,([^,\n]+,)+Start,Increment")
COMMAS = Dialect(",", ".")


def is_numbered(start: bytes) -> bool:
    """Recognise a file by its header."""
    return bool(NUMBERED_HEADER.match(first_text(start)[:2000]))


def read_numbered(path: Path, like: str = "") -> Table:
    """Open a file of numbered samples; their time has no name.

    Raises
    ------
    RecordingError
        For a file without numbers, or without the time of the first sample and the step.
    """
    text = read_text(path)
    if text is None or len(text) < 3:
        raise RecordingError(f"{path.name}: there are no numbers below the header of the oscilloscope")
    names, units = COMMAS.split(text.line(0)), COMMAS.split(text.line(1))
    width = names.index("Start")
    start, step = (COMMAS.number(cell) for cell in (*units[width : width + 2], "", "")[:2])
    if start is None or step is None or not (np.isfinite(start) and 0.0 < step < np.inf):
        raise RecordingError(f"{path.name}: row 2: no numbers below Start and Increment, which give the time")
    channels = [Column(n, n, u if is_unit(u) else None, 0) for n, u in zip(names[1:width], units[1:width], strict=True)]
    body = text.content(())
    body = body[body >= 2]
    if not body.size:
        raise RecordingError(f"{path.name}: there are no numbers below the header of the oscilloscope")
    table = Table(path.name, (Column("", "", "s"), *channels), body + 1, lambda indices: np.empty(0))
    numbers = TextNumbers(text, body, width, COMMAS, {}, table)
    numbers.check_widths()

    def load(indices: Sequence[int]) -> Array:
        values = numbers.load(indices)
        for row, index in zip(values, indices, strict=True):
            if index == 0:
                row[:] = start + step * row
        return values

    return replace(table, load=load)


FORMAT = FileFormat("Rigol oscilloscope", is_numbered, read_numbered, text=True)
