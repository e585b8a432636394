"""From the raw numbers of a table to samples on a uniform time, with a note on every repair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, Indices
from brightgrey.recordings.clocks import Channel, onto_one_clock, resampling_error
from brightgrey.recordings.columns import ColumnChoice, ReadingOptions
from brightgrey.recordings.formats.table import Table, list_rows
from brightgrey.recordings.policy import READING
from brightgrey.recordings.recording import Hold, check_samples
from brightgrey.recordings.sample_values import fill_single, resolution, span_of_present
from brightgrey.recordings.time_base import Stamps, UniformGrid, longest_stretch, repairs_allowed, uniform_grid
from brightgrey.recordings.window import inside

__all__ = ["Samples", "sample"]

# What instruments write where nothing was measured (SCPI).
NOT_A_NUMBER = 9.91e37


@dataclass(frozen=True)
class Samples:
    """Channels on a uniform time, in the units of the file."""

    t: Array  #: In s, shape (samples,).
    values: Array  #: Input first, shape (channels, samples).
    resolution: Array  #: Smallest steps, see `checks.resolution`, shape (channels,).
    notes: tuple[str, ...]  #: Repairs.


def sample(table: Table, choice: ColumnChoice, options: ReadingOptions, hold: Hold) -> Samples:
    """Load the chosen columns, cut them to a window, check and repair them, and put them onto one clock.

    Each repair is noted. A single missing value or sample between two good ones is interpolated, a sample
    written twice is left out, and ends with missing values are cut off. No kind of repair may concern more
    than 1 % of the samples. Channels that are hardly ever in one row have a clock each. Holes and uneven steps are
    treated as `time_base` says, several clocks as `clocks` says.

    Raises
    ------
    RecordingError
        For a fault that cannot be repaired; the message names file, column and row.
    """
    channels = (choice.input, *choice.outputs)
    clocks: dict[int | None, list[int]] = {}
    for place, time in enumerate(choice.times or (None,) * len(channels)):
        clocks.setdefault(time, []).append(place)
    found: dict[int, Channel] = {}
    steps, notes = np.empty(len(channels)), []
    for time, together in clocks.items():
        for places, data, rows in _parts(table, channels, time, together):
            names = [table.columns[i].name or "time" for i in (*(channels[p] for p in places), time) if i is not None]
            factor = 1.0 if time is None else choice.time_factors[places[0]]
            part = _sample_clock(table, names, data, rows, None if time is None else factor, options)
            notes += [note for note in part.notes if note not in notes]
            for place, name, row, step in zip(places, names, part.values, part.resolution, strict=False):
                found[place] = Channel(name, float(part.t[0]) + choice.shifts[place], part.dt, row)
                steps[place] = step
    t, values, more = onto_one_clock([found[place] for place in range(len(channels))], hold, table.name)
    check_samples(table.name, t.size, " in the time that all channels share")
    return Samples(t, values, steps, (*notes, *more))


@dataclass(frozen=True)
class _ClockSamples:
    """Channels of one clock."""

    t: Array
    dt: float
    values: Array
    resolution: Array
    notes: tuple[str, ...]


def _parts(
    table: Table, channels: Sequence[int], time: int | None, places: list[int]
) -> list[tuple[list[int], Array, Indices]]:
    """Load channels of one time, and return them together, or each with the rows that hold it.

    The latter is so where sources of different clocks were merged into one list by their time, and a row holds only
    what is new.

    Returns
    -------
    list of (places, data, rows)
        The last row of the data is the time, if there is one.
    """
    columns = [channels[place] for place in places]
    data, rows = table.load(columns if time is None else [*columns, time]), table.rows
    if time is None:
        return [(places, data, rows)]
    if table.columns[columns[0]].clock is not None:  # other channels may go on longer, or are faster
        data, rows = _present(data, rows, np.asarray(np.isnan(data).all(axis=0)))
    filled = np.append(False, (data[:, 1:] == data[:, :-1]).all(axis=0))
    if filled.mean() > READING.merged:  # rows of a slower channel, filled with the value before and its time
        data, rows = _present(data, rows, filled)
    missing = np.isnan(data[:-1])
    several = len(places) > 1 and table.columns[columns[0]].clock is None
    if not several or missing.all(axis=1).any() or max(map(_missing_within, missing)) <= READING.merged:
        return [(places, data, rows)]
    kept = [np.flatnonzero(~absent) for absent in missing]
    return [([place], data[[k, -1]][:, kept[k]], rows[kept[k]]) for k, place in enumerate(places)]


def _missing_within(absent: NDArray[np.bool_]) -> float:
    """Return the part of the rows from the first to the last value of a channel that hold none."""
    return float(absent[span_of_present(absent)].mean())


def _present(data: Array, rows: Indices, absent: NDArray[np.bool_]) -> tuple[Array, Indices]:
    """Leave out rows; those at the ends cost no memory."""
    if absent.all():
        return data[:, :0], rows[:0]
    part = span_of_present(absent)
    data, rows, absent = data[:, part], rows[part], absent[part]
    return (data[:, ~absent], rows[~absent]) if absent.any() else (data, rows)


def _sample_clock(
    table: Table, names: list[str], data: Array, rows: Indices, factor: float | None, options: ReadingOptions
) -> _ClockSamples:
    """Check and repair channels that have the same time, which is the last row of the data unless `factor` is None."""
    dt, limits, timed = options.dt, options.window, factor is not None
    _check_finite(data, names, table, rows)
    notes: list[str] = []
    t: Array = (dt or 1.0) * np.arange(rows.size, dtype=np.float64)
    if factor is not None:
        data[-1], repaired, _ = fill_single(data[-1])
        t = data[-1] * factor
        if repaired.size:
            notes.append(f"time is missing in {list_rows(rows[repaired])}: interpolated")
    chosen = inside(t, limits) if limits is not None else np.ones(t.size, bool)
    span = f"; the recording goes from {np.nanmin(t):.6g} to {np.nanmax(t):.6g} s" if limits and t.size else ""
    check_samples(table.name, int(chosen.sum()), span)
    if limits is not None:
        t, data, rows = t[chosen], data[:, chosen], rows[chosen]
    if timed:
        part, more = longest_stretch(t, rows, table, names[-1])
        t, data, rows, notes = t[part], data[:, part], rows[part], notes + more
    ends, more = _good_ends(data, names, rows, table)
    t, data, rows, notes = t[ends], data[:, ends], rows[ends], notes + more
    grid = _grid(t, data, rows, table, names[-1]) if timed else UniformGrid(float(t[0]), dt or 1.0, np.arange(t.size))
    channels = data[: len(data) - timed]
    values, more = _on_grid(channels, names, rows, grid, table, t)
    steps = np.array([resolution(row[np.isfinite(row)]) for row in channels])
    stamps: Array = grid.start + grid.dt * np.arange(values.shape[1], dtype=np.float64)
    return _ClockSamples(stamps, grid.dt, values, steps, (*notes, *grid.notes, *more))


def _grid(t: Array, data: Array, rows: Indices, table: Table, column: str) -> UniformGrid:
    """Return the uniform time of samples."""
    if np.isnan(t).any():
        raise table.fault("no value", column=column, row=int(rows[np.argmax(np.isnan(t))]))
    repeated = (data[:, 1:] == data[:, :-1]).all(axis=0)
    return uniform_grid(Stamps(t, repeated, rows, table, column))


def _check_finite(data: Array, names: list[str], table: Table, rows: Indices) -> None:
    """Take what instruments write for "no value" as missing, and refuse infinite and absurd numbers."""
    for row, name in zip(data, names, strict=True):
        row[np.abs(np.abs(row) / NOT_A_NUMBER - 1.0) < 1e-6] = np.nan
        wrong = np.abs(row) > READING.absurd
        if wrong.any():
            at = int(np.argmax(wrong))
            what = "the value is infinite" if np.isinf(row[at]) else f"no sensor measures {row[at]:.6g}"
            raise table.fault(what, column=name, row=int(rows[at]))
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


def _on_grid(
    data: Array, names: list[str], rows: Indices, grid: UniformGrid, table: Table, t: Array
) -> tuple[Array, list[str]]:
    """Put the channels on the points of a grid and fill single gaps."""
    points = int(grid.index[-1]) + 1
    index = np.arange(t.size) if grid.between else grid.index
    size = t.size if grid.between else points
    values = np.full((len(data), size), np.nan)
    values[:, index] = data
    row_of = np.zeros(size, dtype=np.intp)
    row_of[index] = rows
    notes = []
    for channel, name in enumerate(names[: len(data)]):
        values[channel], repaired, left = fill_single(values[channel])
        empty = repaired[row_of[repaired] > 0]  # the grid has noted points without a row already
        allowed = repairs_allowed(size)
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
    if not grid.between:
        return values, notes
    at = grid.start + grid.dt * np.arange(points)
    costs = ", ".join(
        f"'{name}' {100 * resampling_error(t, row):.2g} %" for name, row in zip(names, values, strict=False)
    )
    notes.append(f"the interpolation costs about, as a part of the standard deviation: {costs}")
    return np.array([np.interp(at, t, row) for row in values]), notes
