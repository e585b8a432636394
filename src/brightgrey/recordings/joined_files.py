"""One table of several files: a drive that writes its channels into files of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.file import open_table
from brightgrey.recordings.formats.table import TIME_NAME, Column, Table

__all__ = ["open_together"]


def open_together(
    path: str | Path,
    beside: Sequence[str | Path] = (),
    like: str = "",
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
) -> Table:
    """Open a file, and further files that hold channels of the same recording.

    A column of a further file is called ``FILE.COLUMN``, with the name of the file without its ending. It has the time
    of its own file if there is one there. A file without a time has to have the rows of the first one.

    Parameters
    ----------
    path : str or Path
    beside : sequence of str or Path
        Further files, of any format.
    like, delimiter, decimal, header : optional
        As for `open_table`.

    Returns
    -------
    Table

    Raises
    ------
    RecordingError
        If a file cannot be read, or has neither a time nor as many rows as the first one.
    """
    text = {"delimiter": delimiter, "decimal": decimal, "header": header}
    first, *others = [open_table(file, like, **text)[0] for file in (path, *beside)]  # type: ignore[arg-type]
    if not others:
        return first
    tables = [first, *(_renamed(table, Path(file).stem) for table, file in zip(others, beside, strict=True))]
    times = [_own_time(table) for table in (first, *others)]
    for table, time in zip(others, times[1:], strict=True):
        if time is None and table.rows.size != first.rows.size:
            raise table.fault(
                f"it has {table.rows.size} rows and no time, and {first.name} {first.rows.size} rows: samples of one"
                " recording have to belong to each other"
            )
    starts = [0, *accumulate(len(table.columns) for table in tables)]
    columns: list[Column] = []
    several = any(time is not None for time in times[1:])
    for table, time, start in zip(tables, times, starts, strict=False):
        clock = (times[0] if time is None else start + time) if several else None
        for i, column in enumerate(table.columns):
            own = clock if column.clock is None else start + column.clock
            columns.append(replace(column, clock=None if own == start + i else own))
    longest = max(tables, key=lambda table: table.rows.size)

    def load(indices: Sequence[int]) -> Array:
        values = np.full((len(indices), longest.rows.size), np.nan)
        for table, start in zip(tables, starts, strict=False):
            mine = [k for k, i in enumerate(indices) if start <= i < start + len(table.columns)]
            if mine:
                values[mine, : table.rows.size] = table.load([indices[k] - start for k in mine])
        return values

    notes = tuple(note for table in tables for note in table.notes)
    return Table(first.name, tuple(columns), longest.rows, load, notes, first.unread)


def _renamed(table: Table, stem: str) -> Table:
    """Return a table whose columns are called after its file, too; the unit in the name of a time is kept."""
    columns = []
    for column in table.columns:
        match = TIME_NAME.fullmatch(column.name)
        unit = column.unit or (match and match["unit"]) or None
        name = f"{stem}.{column.name}" if column.name else ""
        columns.append(replace(column, name=name, header=f"{stem}.{column.header}", unit=unit))
    return replace(table, columns=tuple(columns))


def _own_time(table: Table) -> int | None:
    """Return the column that is called a time, else one of clock times, else that of all channels; None without one."""
    named = [i for i, column in enumerate(table.columns) if TIME_NAME.fullmatch(column.name)]
    stamps = [i for i, column in enumerate(table.columns) if column.clock_time]
    clocks = {column.clock for column in table.columns if column.clock is not None}
    return next(iter((*named, *stamps, *(clocks if len(clocks) == 1 else ()))), None)
