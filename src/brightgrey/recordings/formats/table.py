"""Table: the named columns of a file, as the reader of every format makes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from brightgrey.arrays import Array, Indices
from brightgrey.errors import RecordingError, nearest
from brightgrey.recordings.policy import READING

__all__ = ["Column", "Table", "list_rows"]


@dataclass(frozen=True)
class Column:
    """One column: its name, its name with the unit as the file writes it, and the unit if there is one."""

    name: str
    header: str
    unit: str | None = None


@dataclass(frozen=True)
class Table:
    """A file's columns, read on demand.

    Attributes
    ----------
    name : str
        File name without folder.
    columns : tuple of Column
    rows : ndarray of int, shape (samples,)
        Row (line of the file, from 1) of every sample, for messages.
    load : callable
        ``load(indices) -> array, shape (len(indices), samples)``; missing values are NaN. Raises
        RecordingError for text that is not a number.
    notes : tuple of str
        Findings and repairs of the reader.
    unread : str
        Other content of the file, for messages.
    """

    name: str
    columns: tuple[Column, ...]
    rows: Indices
    load: Callable[[Sequence[int]], Array]
    notes: tuple[str, ...] = ()
    unread: str = ""

    def fault(self, text: str, *, column: str | None = None, row: int | None = None) -> RecordingError:
        """Return an error that names file, row and column."""
        place = [] if row is None else [f"row {row}"]
        place += [] if column is None else [f"column '{column}'"]
        return RecordingError(": ".join(part for part in (self.name, ", ".join(place), text) if part))

    def names(self) -> str:
        """List the column names for a message."""
        names = [column.name for column in self.columns if column.name]
        more = f", ... ({len(names)} in all)" if len(names) > READING.listed_columns else ""
        return ", ".join(names[: READING.listed_columns]) + more + (f"; {self.unread}" if self.unread else "")

    def matches(self, name: str) -> list[int]:
        """Return the columns called `name`: by name, by full header, or by a number counted from 1."""
        for attribute in ("name", "header"):
            found = [i for i, column in enumerate(self.columns) if getattr(column, attribute) == name]
            if found:
                return found
        if name.isdecimal() and 1 <= int(name) <= len(self.columns):
            return [int(name) - 1]
        return []

    def find(self, name: str) -> int:
        """Return the index of the column called `name`.

        Raises
        ------
        RecordingError
            If there is none (the message names the nearest) or more than one.
        """
        found = self.matches(name)
        if not found:
            guess = nearest(name, [column.name for column in self.columns])
            hint = f" Did you mean '{guess}'?" if guess else ""
            raise self.fault(f"unknown column '{name}'.{hint} Columns: {self.names()}")
        if len(found) > 1:
            fields = ", ".join(str(i + 1) for i in found)
            raise self.fault(f"{len(found)} columns are called '{name}' (fields {fields}); name them apart")
        return found[0]


def list_rows(rows: Indices) -> str:
    """List rows in words; only the first five are named."""
    first = ", ".join(str(row) for row in rows[:5])
    more = f" and {rows.size - 5} more" if rows.size > 5 else ""
    return f"row{'s' if rows.size > 1 else ''} {first}{more}"
