"""Numbers of a text file with columns, parsed block by block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import Array, Indices
from brightgrey.recordings.formats.dialect import Dialect
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.formats.text import Text
from brightgrey.recordings.formats.time_stamps import past_midnight, seconds

__all__ = ["TextNumbers"]


@dataclass(frozen=True)
class TextNumbers:
    """The rows of numbers of a text.

    Attributes
    ----------
    text : Text
    body : ndarray of int, shape (samples,)
        Line of every sample, from 0.
    width : int
        Fields of a row.
    dialect : Dialect
    stamps : mapping of int to float
        Columns that hold clock times, each with the number of its first day.
    table : Table
        For messages.
    cell_units : mapping of int to str
        Columns in which a unit follows every number.
    ragged : bool
        True if fields may be missing at the end of a row: shorter channels have ended there.
    milliseconds : mapping of int to int
        Columns with the milliseconds of clock times, by the column of these.
    """

    text: Text
    body: Indices
    width: int
    dialect: Dialect
    stamps: Mapping[int, float]
    table: Table
    cell_units: Mapping[int, str] = field(default_factory=dict)
    ragged: bool = False
    milliseconds: Mapping[int, int] = field(default_factory=dict)

    def check_widths(self) -> None:
        """Refuse rows with more or fewer fields (RecordingError); additional empty fields at the end are accepted."""
        delimiter = self.dialect.delimiter
        for at, lines in self.text.blocks(self.body):
            if any('"' in line or (delimiter == " " and not line.isascii()) for line in lines):
                counts = [len(self.dialect.split(line)) for line in lines]
            elif delimiter == " ":
                counts = [len(line.split()) for line in lines]
            else:
                counts = [line.count(delimiter) + 1 for line in lines]
            for index in np.flatnonzero(np.array(counts) != self.width):
                self._check_width(at + int(index), self.dialect.split(lines[index]))

    def _check_width(self, sample: int, fields: list[str]) -> None:
        if (len(fields) > self.width and not any(fields[self.width :])) or (self.ragged and len(fields) < self.width):
            return
        last = sample == self.body.size - 1
        cut = "; the file seems to be cut off" if last and len(fields) < self.width else ""
        raise self.table.fault(
            f"{len(fields)} fields where {self.width} are expected{cut}", row=int(self.table.rows[sample])
        )

    def load(self, indices: Sequence[int]) -> Array:
        """Return the numbers of some columns, shape (len(indices), samples); NaN where a value is missing."""
        values = np.empty((len(indices), self.body.size))
        for at, lines in self.text.blocks(self.body):
            part = slice(at, at + len(lines))
            fast = None if {*self.stamps, *self.cell_units}.intersection(indices) else self._fast(lines, indices)
            if fast is not None:
                values[:, part] = fast
            else:
                self._slow(lines, indices, at, values[:, part])
        for row, index in enumerate(indices):
            if index in self.stamps:  # precision is lost far from zero
                if not self.stamps[index]:  # no date
                    values[row] = past_midnight(values[row])
                if index in self.milliseconds:
                    values[row] += 1e-3 * self.load([self.milliseconds[index]])[0]
                values[row] -= np.nanmin(values[row]) if np.isfinite(values[row]).any() else 0.0
        return values

    def _fast(self, lines: list[str], indices: Sequence[int]) -> Array | None:
        """Return the numbers by numpy's parser, or None if only `_slow` can read the lines."""
        # A point in a file with decimal commas could separate thousands.
        foreign = '"\u00a0\u202f' + self.dialect.thousands + ("." if self.dialect.decimal == "," else "")
        if any(mark in line for mark in foreign for line in lines):
            return None
        if self.dialect.decimal == ",":
            lines = [line.replace(",", ".") for line in lines]
        delimiter = None if self.dialect.delimiter == " " else self.dialect.delimiter
        try:
            return np.loadtxt(lines, delimiter=delimiter, comments=None, usecols=tuple(indices), ndmin=2).T
        except ValueError:
            return None  # an empty field, a word for a missing value, or text

    def _slow(self, lines: list[str], indices: Sequence[int], at: int, values: Array) -> None:
        """Read the lines from sample `at` field by field, into `values`."""
        clocks: dict[int, list[str]] = {index: [] for index in indices if index in self.stamps}
        for sample, line in enumerate(lines):
            fields = self.dialect.split(line)
            for target, index in enumerate(indices):
                cell = fields[index] if index < len(fields) else ""
                if index in clocks:
                    clocks[index].append(cell)
                    continue
                value = self.dialect.number(cell.removesuffix(self.cell_units.get(index, "")).rstrip())
                if value is None:
                    raise self._fault(f"'{cell}' is not a number{self._doubt(cell)}", index, at + sample)
                values[target, sample] = value
        for target, index in enumerate(indices):
            if index in clocks:
                values[target], wrong = seconds(clocks[index], self.stamps[index])
                if wrong:
                    raise self._fault(f"'{clocks[index][wrong[0]]}' is no clock time", index, at + wrong[0])

    def _doubt(self, cell: str) -> str:
        """Return what may be meant by a cell with a unit or with another decimal mark, and what to do."""
        if unit := self.dialect.unit_behind(cell):
            return f"; '{unit}' is not the unit of all rows: give every number of the column the same unit, or none"
        mark = "," if self.dialect.decimal == "." else "."
        if not replace(self.dialect, decimal=mark, thousands="", units=False).is_number(cell):
            return ""
        return (
            f" with the decimal mark '{self.dialect.decimal}' that the file has elsewhere; if its '{mark}' separates"
            " thousands, export the numbers without it"
        )

    def _fault(self, text: str, index: int, sample: int) -> Exception:
        return self.table.fault(text, column=self.table.columns[index].name, row=int(self.table.rows[sample]))
