"""From the raw numbers of a table to samples on a uniform time, with a note on every repair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array, Indices
from brightgrey.recordings.checks import fill_single, resolution, span_of_present
from brightgrey.recordings.columns import ColumnChoice
from brightgrey.recordings.formats.table import Table, list_rows
from brightgrey.recordings.recording import check_samples
from brightgrey.recordings.time_base import Stamps, UniformGrid, repairs_allowed, uniform_grid
from brightgrey.recordings.window import TimeWindow, inside

__all__ = ["Samples", "sample"]


@dataclass(frozen=True)
class Samples:
    """Channels on a uniform time, in the units of the file."""

    t: Array  #: In s, shape (samples,).
    values: Array  #: Input first, shape (channels, samples).
    resolution: Array  #: Smallest steps, see `checks.resolution`, shape (channels,).
    notes: tuple[str, ...]  #: Repairs.


def sample(table: Table, choice: ColumnChoice, dt: float | None, limits: TimeWindow | None) -> Samples:
    """Load the chosen columns, cut them to a window, check and repair them.

    Each repair is noted. A single missing value or sample between two good ones is interpolated, a sample
    written twice is left out, and ends with missing values are cut off. No kind of repair may concern more
    than 1 % of the samples.

    Raises
    ------
    RecordingError
        For a fault that cannot be repaired; the message names file, column and row.
    """
    channels = [choice.input, *choice.outputs]
    columns = channels if choice.time is None else [*channels, choice.time]
    names = [table.columns[i].name for i in columns]
    data, rows = table.load(columns), table.rows
    _check_finite(data, names, table)
    notes: list[str] = []
    t: Array = (dt or 1.0) * np.arange(rows.size, dtype=np.float64)
    if choice.time is not None:
        data[-1], repaired, _ = fill_single(data[-1])
        t = data[-1] * choice.time_factor
        if repaired.size:
            notes.append(f"time is missing in {list_rows(rows[repaired])}: interpolated")
    part = inside(t, limits) if limits is not None else np.ones(t.size, bool)
    span = f"; the recording goes from {np.nanmin(t):.6g} to {np.nanmax(t):.6g} s" if limits and t.size else ""
    check_samples(table.name, int(part.sum()), span)
    t, data, rows = t[part], data[:, part], rows[part]
    ends, more = _good_ends(data, names, rows, table)
    t, data, rows, notes = t[ends], data[:, ends], rows[ends], notes + more
    if choice.time is None:
        grid = UniformGrid(float(t[0]), dt or 1.0, np.arange(t.size))
    else:
        if np.isnan(t).any():
            raise table.fault("no value", column=names[-1], row=int(rows[np.argmax(np.isnan(t))]))
        repeated = (data[:, 1:] == data[:, :-1]).all(axis=0)
        grid = uniform_grid(Stamps(t, repeated, rows, table, names[-1]))
    values, more = _on_grid(data[: len(channels)], names, rows, grid, table)
    steps = np.array([resolution(row[np.isfinite(row)]) for row in data[: len(channels)]])
    time: Array = grid.start + grid.dt * np.arange(values.shape[1], dtype=np.float64)
    return Samples(time, values, steps, (*notes, *grid.notes, *more))


def _check_finite(data: Array, names: list[str], table: Table) -> None:
    for row, name in zip(data, names, strict=True):
        if np.isinf(row).any():
            at = int(np.argmax(np.isinf(row)))
            raise table.fault("the value is infinite", column=name, row=int(table.rows[at]))
        if np.isnan(row).all():
            raise table.fault("there is no number in it", column=name)


def _good_ends(data: Array, names: list[str], rows: Indices, table: Table) -> tuple[slice, list[str]]:
    """Cut off missing values at both ends, with a note."""
    missing = np.asarray(np.isnan(data).any(axis=0))
    if missing.all():
        raise table.fault("no row has a value in every column that is used")
    ends = span_of_present(missing)
    cut = np.concatenate([rows[: ends.start], rows[ends.stop :]])
    if not cut.size:
        return ends, []
    first = int(np.argmax(missing))
    if cut.size > repairs_allowed(rows.size):
        column = names[int(np.argmax(np.isnan(data[:, first])))]
        raise table.fault(
            f"no value, like in {cut.size - 1} other rows at the ends (cut the recording with a window)",
            column=column,
            row=int(rows[first]),
        )
    return ends, [f"values are missing in {list_rows(cut)} at the ends: left out"]


def _on_grid(data: Array, names: list[str], rows: Indices, grid: UniformGrid, table: Table) -> tuple[Array, list[str]]:
    """Put the channels on the points of a grid and fill single gaps."""
    points = int(grid.index[-1]) + 1
    values = np.full((len(data), points), np.nan)
    values[:, grid.index] = data
    row_of = np.zeros(points, dtype=np.intp)
    row_of[grid.index] = rows
    notes = []
    for channel, name in enumerate(names[: len(data)]):
        values[channel], repaired, left = fill_single(values[channel])
        empty = repaired[row_of[repaired] > 0]  # the grid has noted points without a row already
        allowed = repairs_allowed(points)
        if left.size or empty.size > allowed:
            at = left[0] if left.size else empty[0]
            while not row_of[at]:
                at += 1
            many = left.size + repaired.size
            raise table.fault(
                f"no value here, {many} in all; only single ones between two good ones are interpolated,"
                f" at most {allowed} (cut the recording with a window)",
                column=name,
                row=int(row_of[at]),
            )
        if empty.size:
            notes.append(f"'{name}' has no value in {list_rows(row_of[empty])}: interpolated")
    return values, notes
