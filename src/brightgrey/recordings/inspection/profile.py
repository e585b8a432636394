"""Profile of a channel: its rate, range, holes, held samples and course."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from brightgrey.arrays import Array, Indices
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.policy import INSPECTION, READING

__all__ = ["ChannelProfile", "block_line", "block_means", "profile_channels"]

BLOCKS = " ▁▂▃▄▅▆▇█"


@dataclass(frozen=True)
class ChannelProfile:
    """Numbers of one channel.

    Attributes
    ----------
    column : int
        Index in the table.
    name : str
    unit : str or None
        As the file says.
    samples : int
        Values that are there.
    missing : int
        Values that are missing between the first and the last one.
    low, high : float
        Range; NaN without a value.
    held : float
        Part of the samples that repeat the one before.
    levels : int
        Different values.
    dt : float or None
        Usual step of its own time in s; None if the file gives it none.
    course : ndarray, shape (points,)
        Values for drawing, at most a few hundred.
    text : str
        First fault, for a column that holds no numbers.
    begins_with_number : bool
        True if such a column begins with a number all the same.
    """

    column: int
    name: str
    unit: str | None
    samples: int = 0
    missing: int = 0
    low: float = float("nan")
    high: float = float("nan")
    held: float = 0.0
    levels: int = 0
    dt: float | None = None
    course: Array = field(default_factory=lambda: np.empty(0), repr=False)
    text: str = ""
    begins_with_number: bool = False

    @property
    def constant(self) -> bool:
        """True if nothing changes, or nothing is there."""
        return self.levels < 2

    def sparkline(self, width: int = 16) -> str:
        """Draw the course with block characters."""
        return block_line(self.course, width)


def block_line(values: Array, width: int) -> str:
    """Course of values in block characters, each the mean of as many values; values that are not finite are left out.

    Parameters
    ----------
    values : ndarray, shape (points,)
    width : int
        Characters at most.
    """
    present = values[np.isfinite(values)]
    if not present.size:
        return ""
    edges = np.linspace(0, present.size, min(width, present.size) + 1).astype(int)[:-1]
    means = np.add.reduceat(present, edges) / np.diff(np.append(edges, present.size))
    span = float(np.ptp(means))
    heights = (means - means.min()) / span * 7 if span > 0 else np.zeros(means.size)
    return "".join(BLOCKS[1 + round(float(height))] for height in heights)


def profile_channels(table: Table) -> tuple[list[ChannelProfile], dict[int, Array]]:
    """Return the profiles of all named columns, and the numbers of those that hold numbers, by column."""
    named = [i for i, column in enumerate(table.columns) if column.name][: INSPECTION.most_columns]
    clocks = sorted({c.clock for c in table.columns if c.clock is not None})
    loaded, faults = _load_numbers(table, [*named, *clocks])
    profiles = []
    for i in named:
        column = table.columns[i]
        if i in faults:
            begun = np.isfinite(column.first)  # a text among numbers is worth saying
            profiles.append(ChannelProfile(i, column.name, column.unit, text=faults[i], begins_with_number=bool(begun)))
        else:
            profiles.append(_profile(i, column.name, column.unit, loaded[i]))
    return profiles, loaded


def _load_numbers(table: Table, columns: Sequence[int]) -> tuple[dict[int, Array], dict[int, str]]:
    """Load columns together, or one by one if some of them hold text; absurd numbers count as missing."""
    try:
        return dict(zip(columns, _sound(table.load(columns)), strict=True)), {}
    except RecordingError:
        pass
    loaded, faults = {}, {}
    for i in columns:
        try:
            (loaded[i],) = _sound(table.load([i]))
        except RecordingError as error:
            faults[i] = str(error)
    return loaded, faults


def _sound(values: Array) -> Array:
    values[~(np.abs(values) <= READING.absurd)] = np.nan
    return values


def _profile(column: int, name: str, unit: str | None, values: Array) -> ChannelProfile:
    present = np.flatnonzero(np.isfinite(values))
    if not present.size:
        return ChannelProfile(column, name, unit)
    span = values[present[0] : present[-1] + 1]
    finite = values[present]
    return ChannelProfile(
        column,
        name,
        unit,
        samples=int(present.size),
        missing=int(span.size - present.size),
        low=float(finite.min()),
        high=float(finite.max()),
        held=float(np.mean(np.diff(finite) == 0.0)) if present.size > 1 else 0.0,
        levels=int(np.unique(finite).size),
        course=_course(finite),
    )


def _course(values: Array) -> Array:
    """Return the lowest and the highest value of each part of a channel, so that no peak is lost."""
    if values.size <= INSPECTION.drawn:
        return values
    edges: Indices = np.linspace(0, values.size, INSPECTION.drawn // 2 + 1).astype(np.intp)[:-1]
    return np.column_stack([np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)]).ravel()


def block_means(values: Array, blocks: int) -> Array:
    """Return the means of equal parts of a channel, shape (blocks,); missing values are bridged by straight lines."""
    finite = np.isfinite(values)
    if not finite.all():
        at = np.arange(values.size)
        values = np.interp(at, at[finite], values[finite])
    if values.size <= blocks:
        return values
    width = values.size // blocks
    return np.asarray(values[: width * blocks].reshape(blocks, width).mean(axis=1))
