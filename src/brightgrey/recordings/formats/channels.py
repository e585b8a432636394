"""Channels: what a library reads from a file, before it is a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.formats.table import Column, Table

__all__ = ["Channel", "Channels", "columns_of_matrix", "listed", "with_distinct_names"]


@dataclass(frozen=True)
class Channel:
    """One channel.

    Attributes
    ----------
    name : str
    values : ndarray, shape (samples,)
        In `unit`.
    unit : str, optional
    clock : int, optional
        Number of its clock among `Channels.clocks`.
    label : str
        What the file calls it beside its name, e.g. the label of a signal of Simulink; columns are found by it, too.
    """

    name: str
    values: Array
    unit: str | None = None
    clock: int | None = None
    label: str = ""


@dataclass(frozen=True)
class Channels:
    """Channels of a file.

    Attributes
    ----------
    channels : tuple of Channel
    clocks : tuple of ndarray
        Times in s that channels share, each of shape (samples,).
    others : tuple of str
        Names of what is no channel.
    notes : tuple of str
        What the library remarks on the file.
    """

    channels: tuple[Channel, ...]
    clocks: tuple[Array, ...] = ()
    others: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def table(self, name: str) -> Table:
        """Return the table of all channels; times are columns without a name, and short channels end with NaN."""
        arrays = [*(channel.values for channel in self.channels), *self.clocks]
        samples = max((array.size for array in arrays), default=0)
        clocks = len(self.channels)
        columns = [
            Column(c.name, c.label or c.name, c.unit, None if c.clock is None else clocks + c.clock)
            for c in self.channels
        ]
        columns += [Column("", "", "s")] * len(self.clocks)
        rows, unread = np.arange(1, samples + 1), listed("", self.others)
        return Table(name, tuple(columns), rows, _loader(arrays, samples), self.notes, unread)


def _loader(arrays: Sequence[Array], samples: int) -> Callable[[Sequence[int]], Array]:
    def load(indices: Sequence[int]) -> Array:
        values = np.full((len(indices), samples), np.nan)
        for row, index in enumerate(indices):
            values[row, : arrays[index].size] = arrays[index]
        return values

    return load


def columns_of_matrix(name: str, matrix: Array) -> list[Channel]:
    """Return the columns of a matrix of shape (samples, columns), or its rows if it has more columns than samples."""
    tall = matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T
    label = "(:,{})" if tall is matrix else "({},:)"
    return [Channel(name + label.format(i + 1), tall[:, i].astype(np.float64)) for i in range(tall.shape[1])]


def with_distinct_names(found: Sequence[tuple[str, Channel]]) -> tuple[Channel, ...]:
    """Return channels of (group, channel), called ``group/name`` where several groups have the name."""
    times = Counter(channel.name for _, channel in found)
    return tuple(c if times[c.name] == 1 else replace(c, name=f"{group}/{c.name}") for group, c in found)


def listed(words: str, names: Sequence[str]) -> str:
    """Return words and names for a message; empty without names."""
    return f"{words} {', '.join(names)}".strip() if names else ""
