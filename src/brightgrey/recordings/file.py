"""File of a recording: its format is found by its content, never by its name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError, nearest, printable
from brightgrey.recordings.formats import file_formats
from brightgrey.recordings.formats.delimited import read_delimited
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.formats.text import GZIP, unpacked_start
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit

__all__ = ["open_table"]

DELIMITED = "delimited text"
SCALED_UNIT = re.compile(r"(?:0[.,](?P<zeros>0{0,8})1|(?:1[eE]|10\^)-0?(?P<power>[1-9]))\s*[*·×x]?\s*(?P<unit>\S.*)")
FOREIGN = (
    (
        rb"PK\x03\x04.{26}[^/]{1,200}\.npy",
        "a NumPy archive; give its arrays to recording_from",
    ),
    (rb"\x93NUMPY", "a NumPy array; give its columns to recording_from"),
    (rb"PK\x03\x04", "a workbook or an archive; save the sheet as CSV and read that"),
    (rb"\xd0\xcf\x11\xe0", "a workbook of an old version; save the sheet as CSV and read that"),
    (
        rb"PAR1|ARROW1|FEA1",
        "a data frame of Parquet or Arrow; give its columns to recording_from",
    ),
    (rb"SQLite format 3\0", "a database; export the samples as CSV and read that"),
    (rb"\x80[\x02-\x05]", "a Python pickle; give its arrays to recording_from"),
    (rb"#ROSBAG|\x89MCAP", "a bag of ROS; export the topics as CSV and read that"),
    (rb"\s*(\{\s*\"|\[\s*\{)", "JSON; write its samples as CSV, or give its arrays to recording_from"),
    (rb"\s*<(\?xml|!DOCTYPE|html)", "XML or a page of the web; export the samples as CSV and read that"),
    (rb"%PDF|\x89PNG|\xff\xd8\xff|GIF8", "a picture or a document; export the numbers of the recording"),
)
"""First bytes of files that are not read, as a pattern, and what to do instead."""


def open_table(
    path: str | Path,
    like: str = "",
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
) -> tuple[Table, str]:
    """Open a file of any format.

    Parameters
    ----------
    path : str or Path
    like : str
        Name of the input column, for files whose columns differ in length.
    delimiter, decimal, header : optional
        Of delimited text, see `read_delimited`.

    Returns
    -------
    table : Table
    title : str
        Name of the format.

    Raises
    ------
    RecordingError
        If there is no such file, or it cannot be read.
    """
    file = Path(path)
    start = _first_bytes(file)
    packed = start.startswith(GZIP)
    if packed:
        start = unpacked_start(start)
    found = next((f for f in file_formats() if f.recognises(start)), None)
    if found is not None and packed and not found.text:
        raise RecordingError(f"{file.name}: this is a compressed {found.title} file; unpack it, as it is no text")
    try:
        if found is not None:
            return _ready(found.read(file, like)), found.title
        if advice := next((what for pattern, what in FOREIGN if re.match(pattern, start, re.DOTALL)), ""):
            raise RecordingError(f"{file.name}: this is {advice}")
        return _ready(read_delimited(file, delimiter=delimiter, decimal=decimal, header=header)), DELIMITED
    except OSError as error:
        raise RecordingError(f"{file.name}: the file cannot be read ({error.strerror})") from error
    except MemoryError as error:
        raise RecordingError(
            f"{file.name}: the file does not fit into the memory; cut out the seconds that matter"
        ) from error


def _ready(table: Table) -> Table:
    """Return a table whose name can be written anywhere, and whose units have no factors such as 0.1 rpm."""
    table = replace(table, name=printable(table.name))
    factors, columns, notes = {}, list(table.columns), []
    for i, column in enumerate(table.columns):
        match = SCALED_UNIT.fullmatch(column.unit or "")
        if match and is_unit(match["unit"]):
            digits = len(match["zeros"]) + 1 if match["zeros"] is not None else int(match["power"])
            factors[i] = 10.0**digits
            columns[i] = replace(column, unit=match["unit"])
            notes.append(f"'{column.name}' counts {column.unit}: its numbers are divided by {factors[i]:g}")
    if not factors:
        return table

    def load(indices: Sequence[int]) -> Array:
        divisors = np.array([factors.get(i, 1.0) for i in indices])
        return np.asarray(table.load(indices) / divisors[:, None])

    return replace(table, columns=tuple(columns), load=load, notes=(*table.notes, *notes))


def _first_bytes(path: Path) -> bytes:
    """Start of a file, after checking that it exists and can be read."""
    name = path.name or str(path)
    if re.match(r"[a-z]{2,}:/", str(path)):
        raise RecordingError(f"{path}: this is an address; download the file first")
    if "\0" in str(path):
        raise RecordingError(f"{name}: a NUL is in the name, which no file has")
    try:
        if path.is_dir():
            within = sorted(p.name for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
            example = f", e.g. {path / within[0]}" if within else ""
            raise RecordingError(f"{name}: this is a folder, not a recording; name a file in it{example}")
        if not path.exists():
            folder = path.parent
            files = [p.name for p in folder.iterdir() if p.is_file()] if folder.is_dir() else []
            guess = nearest(name, files)
            raise RecordingError(f"{path}: there is no such file" + (f". Did you mean '{guess}'?" if guess else ""))
        if not path.is_file():
            raise RecordingError(f"{path}: this is a device or a pipe, not a file")
        with path.open("rb") as file:
            return file.read(READING.first_bytes)
    except OSError as error:
        raise RecordingError(f"{name}: the file cannot be read ({error.strerror})") from error
