"""Table: the named columns of a file, as the reader of every format makes it."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from brightgrey.arrays import Array, Indices
from brightgrey.errors import RecordingError, nearest
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit, parse_unit

__all__ = ["TIME_NAME", "Column", "Table", "list_rows", "skipped_rows", "with_clocks"]

TIME_NAME = re.compile(
    r"(t|tout|time|zeit|time[_ ]?stamps?|(sim(ulation)?|elapsed|rel(ative)?)[_ ]?time)"
    r"([_ ](?P<unit>s|sec|seconds?|ms|us|µs|min))?",
    re.IGNORECASE,
)
"""Name of a column that holds the time."""
SINCE_1970 = (9.8e8, 4.1e9)
"""Seconds from 1970 to 2001, and to 2100."""
NUMBERED = re.compile(r"[ _.]?\d{1,3}")
TIME_OF = re.compile(r"(t|time|zeit)[ _.](?P<after>.+)|(?P<before>.+?)[ _.](t|time|zeit)", re.IGNORECASE)
"""Name of a column that holds the time of another, ``t_torque`` or ``torque.time``."""


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    name : str
        Empty for a column that nobody asks for by name.
    header : str
        Name with the unit, as the file writes it.
    unit : str, optional
    clock : int, optional
        Column of its own time, where channels have different ones.
    clock_time : bool
        True if the file holds clock times (``12:00:00.000``), which are read as seconds.
    first : float
        First number of a column of text; NaN for a text, and where the reader does not know it.
    """

    name: str
    header: str
    unit: str | None = None
    clock: int | None = None
    clock_time: bool = False
    first: float = float("nan")

    @property
    def is_in_time(self) -> bool:
        """True if the file gives it a unit of time, and its numbers are no clock times."""
        unit = self.unit or ""
        return not self.clock_time and is_unit(unit) and parse_unit(unit).dimension == (("[time]", 1),)

    def time_unit(self) -> tuple[str, str]:
        """Return the unit of a time, and why it is none that the file gives: its name, or its size since 1970.

        A time since 1970 (or 2001 to 2100, to be exact) says its unit by its size: the years of one unit are 1000 times
        those of the next.
        """
        if self.unit:
            return self.unit, ""
        match = TIME_NAME.fullmatch(self.name)
        if match and match["unit"]:
            return match["unit"].lower(), "its name says so"
        per_second = {"ms": 1e3, "µs": 1e6, "ns": 1e9}
        since = (unit for unit, many in per_second.items() if SINCE_1970[0] <= self.first / many <= SINCE_1970[1])
        unit = next(since, "s")
        return unit, "" if unit == "s" else "its numbers count from 1970"


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
        ``load(indices) -> array, shape (len(indices), samples)``; missing values are NaN, also behind the end of a
        channel that is shorter than others. Raises RecordingError for text that is not a number.
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
        if not name:
            return []
        for attribute in ("name", "header"):
            found = [i for i, column in enumerate(self.columns) if getattr(column, attribute) == name]
            if found:
                return found
        number = int(name) if name.isascii() and name.isdecimal() and len(name) < 10 else 0
        return [number - 1] if 1 <= number <= len(self.columns) else []

    def find(self, name: str) -> int:
        """Return the index of the column called `name`.

        Raises
        ------
        RecordingError
            If there is none (the message names the nearest) or more than one.
        """
        found = self.matches(name)
        if not found:
            names = [column.name for column in self.columns]
            within = (known for known in names if len(name) > 2 and name.casefold() in known.casefold())
            guess = nearest(name, names) or next(within, None)
            hint = f" Did you mean '{guess}'?" if guess else ""
            raise self.fault(f"unknown column '{name}'.{hint} Columns: {self.names()}")
        if len(found) > 1:
            fields = ", ".join(str(i + 1) for i in found[: READING.listed_columns])
            raise self.fault(
                f"{len(found)} columns are called '{name}' (fields {fields}); give the number of the right one"
            )
        return found[0]


def with_clocks(columns: Sequence[Column], rising: Container[int] = ()) -> tuple[Column, ...]:
    """Return the columns of a text, each with its own time where the file has several times.

    That is so if the first column is a time, and every further time stands left of the channels that belong to it:
    ``t, torque, t, velocity``. A time may be called after its channel: ``t_torque, torque, t_vel, velocity``. It then
    has to be among the `rising` columns, since ``t_motor, motor_speed`` may be a temperature.
    """

    def is_time(index: int) -> bool:
        name = columns[index].name
        if TIME_NAME.fullmatch(name) or TIME_NAME.fullmatch(NUMBERED.sub("", name)):
            return True
        match, after = TIME_OF.fullmatch(name[:200]), columns[index + 1 : index + 2]
        owner = ((match["after"] or match["before"]) if match else "").casefold()
        return bool(index in rising and owner and after and after[0].name.casefold().startswith(owner))

    times = [i for i in range(len(columns)) if is_time(i)]
    apart = all(later - earlier > 1 for earlier, later in pairwise([*times, len(columns)]))
    if len(times) < 2 or times[0] != 0 or not apart:
        return tuple(columns)
    clocked = []
    for begin, end in pairwise([*times, len(columns)]):
        clocked += [columns[begin], *(replace(column, clock=begin) for column in columns[begin + 1 : end])]
    return tuple(clocked)


def skipped_rows(rows: Indices, where: str, text: str) -> str:
    """Return the note that rows above or below the numbers are skipped, the first of which has a text."""
    return f"{list_rows(rows)} {where} the numbers {'are' if rows.size > 1 else 'is'} skipped, beginning '{text[:40]}'"


def list_rows(rows: Indices) -> str:
    """List rows in words; only the first five are named."""
    first = ", ".join(str(row) for row in rows[:5])
    more = f" and {rows.size - 5} more" if rows.size > 5 else ""
    return f"row{'s' if rows.size > 1 else ''} {first}{more}"
