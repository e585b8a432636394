"""Sampling interval that a line above the numbers states: ``Sample interval: 0.001 s``, ``SampleRate;1000 Hz``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.formats.dialect import Dialect
from brightgrey.recordings.formats.header import Lines
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit, parse_unit

__all__ = ["StatedInterval", "stated_interval", "with_interval"]

STATEMENT = re.compile(
    r"\W*(?:(?:sampl(?:e|ing)|abtast)[ _-]?(?:time|zeit|periode?|interval|intervall|step|rate|freq|frequency|frequenz"
    r"|cycle)|(?:scan|logging|recording|trace)[ _-]?(?:interval|rate|freq|frequency|cycle))\s*"
    r"(?:[\[(](?P<unit_before>[^\])]{1,12})[\])])?[\s:=;,|]*"
    r"(?P<number>[+\d.eE-]+(?:,\d+)?)[\s;,|]*[\[(]?(?P<unit_after>[^\s\])(;,|\"']{0,12})",
    re.IGNORECASE,
)
# A recording of every tenth sample has another interval than the one stated.
THINNED = re.compile(r"decimat|downsampl|undersampl", re.IGNORECASE)
GROUPED = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")
"""Ten thousand, or ten with three decimals."""
RATE = re.compile(r"(?P<prefix>[kKM]?)(?:[Hh][Zz]|Hertz|(?:S|Sa|[Ss]amples?)/s(?:ec|econd)?)")
PREFIXES = {"": 1.0, "k": 1e3, "K": 1e3, "M": 1e6}
SHORTEST, LONGEST = 1e-7, 1.0
"""Intervals in s: one that is longer is the duration of a recording."""


@dataclass(frozen=True)
class StatedInterval:
    """A sampling interval, and where it is stated."""

    dt: float  #: In s.
    row: int
    text: str


def stated_interval(lines: Lines, dialect: Dialect) -> StatedInterval | None:
    """Sampling interval that one of the lines states with a unit.

    None if none does, if two contradict each other, or if the number may be read in two ways.

    Parameters
    ----------
    lines : Lines
        Lines above the numbers, comments included.
    dialect : Dialect
        Of the file; a decimal point is understood, too.
    """
    found: list[StatedInterval] = []
    if any(map(THINNED.search, lines.text)):
        return None
    for text, row in zip(lines.text, lines.rows, strict=True):
        match = STATEMENT.match(text) if len(text) < READING.longest_statement else None
        if match is None:
            continue
        number = match["number"].rstrip(",.;")
        value = dialect.number(number)
        value = replace(dialect, decimal=".", thousands="").number(number) if value is None else value
        unit = (match["unit_before"] or match["unit_after"]).strip()
        dt = _seconds(value, unit) if value and 0.0 < value < np.inf and not GROUPED.fullmatch(number) else None
        if dt is not None and SHORTEST <= dt < LONGEST:
            found.append(StatedInterval(dt, row, text.strip()))
    agree = found and all(np.isclose(one.dt, found[0].dt, rtol=1e-6) for one in found)
    return found[0] if agree else None


def _seconds(value: float, unit: str) -> float | None:
    """Return an interval in s from a time or a rate; None for another unit."""
    if match := RATE.fullmatch(unit):
        return 1.0 / max(value * PREFIXES[match["prefix"]], 1e-300)
    parsed = parse_unit(unit) if unit and is_unit(unit) else None
    return value * parsed.si if parsed and parsed.dimension == (("[time]", 1),) else None


def with_interval(table: Table, stated: StatedInterval) -> Table:
    """Add a time without a name as the last column, by which all others are recorded."""
    load, time = table.load, len(table.columns)
    t = stated.dt * np.arange(table.rows.size)

    def load_with_time(indices: Sequence[int]) -> Array:
        own = [i for i in indices if i < time]
        loaded = iter(load(own) if own else ())
        return np.array([next(loaded) if i < time else t for i in indices])

    columns = tuple(replace(column, clock=time) for column in table.columns)
    note = f"row {stated.row} gives the sampling interval of {stated.dt:.6g} s: '{stated.text[:60]}'"
    return replace(table, columns=(*columns, Column("", "", "s")), load=load_with_time, notes=(*table.notes, note))
