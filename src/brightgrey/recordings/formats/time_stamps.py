"""Clock times and dates as loggers write them, in seconds from the first one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.formats.dialect import MISSING

__all__ = ["are_stamps", "first_day", "is_stamp", "past_midnight", "seconds"]

STAMP = re.compile(
    r"(?:(?P<date>\d{4}-\d\d-\d\d|\d{4}/\d\d/\d\d|\d{8}|\d{1,2}\.\d{1,2}\.(?:\d\d){1,2}|\d{1,2}/\d{1,2}/\d{4}"
    r"|\d{1,2}[- ][a-z]{3}[- ]\d{4}|\d{1,6} days?)[T_ ]\s*)?"
    r"(?P<hour>\d{1,2}):(?P<minute>[0-5]\d):(?P<second>[0-5]\d(?:[.,]\d{1,12}|:\d{3})?)"
    r"(?:\s?(?P<half>[AP])\.?M\.?|(?P<zone>Z|\s?[+-]\d\d:?\d\d|\s?UTC))?",
    re.ASCII | re.IGNORECASE,
)
DAY = 86400.0
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


def is_stamp(text: str) -> bool:
    """Return True for a clock time with or without a date, e.g. ``2024-01-01 00:00:00.000``."""
    return len(text) < 64 and bool(STAMP.fullmatch(text))


def are_stamps(texts: Sequence[str]) -> bool:
    """Return True if there are texts, and most of those that are not empty are clock times."""
    present = [text for text in texts if text]
    return bool(present) and 2 * sum(map(is_stamp, present)) > len(present)


def first_day(texts: Sequence[str]) -> float:
    """Return the number of the day of the first clock time, 0 if it has no date."""
    matches = (STAMP.fullmatch(text) for text in texts if len(text) < 64)
    return next((_ordinal(match["date"]) or 0.0 for match in matches if match), 0.0)


def seconds(texts: Sequence[str], day: float) -> tuple[Array, list[int]]:
    """Return the seconds of clock times since the start of a `day`, and the numbers of the texts that are none.

    Days are told apart by their dates, so that a recording may pass midnight; see `past_midnight` for times without a
    date. A date with slashes that begins with the day or the month is read with the month first.
    """
    values, wrong = np.full(len(texts), np.nan), []
    days: dict[str | None, float | None] = {}
    for i, text in enumerate(texts):
        match = STAMP.fullmatch(text) if len(text) < 64 else None
        if match and match["date"] not in days:
            days[match["date"]] = _ordinal(match["date"])
        today = days[match["date"]] if match else None
        if match and today is not None:
            hour = int(match["hour"])
            if match["half"]:
                hour = hour % 12 + 12 * (match["half"] in "pP")
            second = float(match["second"].replace(",", ".").replace(":", "."))
            values[i] = DAY * (today - day) + 3600 * hour + 60 * int(match["minute"]) + second
        elif text.casefold() not in MISSING:
            wrong.append(i)
    return values, wrong


def past_midnight(t: Array) -> Array:
    """Return clock times without a date in s with a day added wherever they fall by more than half a day."""
    present = np.flatnonzero(np.isfinite(t))
    falls = np.diff(t[present]) < -0.5 * DAY
    if not falls.any():
        return t
    later = t.copy()
    later[present[1:]] += DAY * np.cumsum(falls)
    return later


def _date_part(text: str) -> int:
    """Return a number of a date; a month may be a word, which is 0 if it is none."""
    if text.isdigit():
        return int(text)
    return MONTHS.index(text.casefold()) + 1 if text.casefold() in MONTHS else 0


def _ordinal(text: str | None) -> float | None:
    """Return the number of a day, 0 without a date, None for a date that does not exist."""
    if text is None:
        return 0.0
    parts = [_date_part(part) for part in re.split(r"[-./ ]", text)]
    if "day" in text:
        return float(parts[0])
    if len(parts) == 1:
        parts = [parts[0] // 10000, parts[0] // 100 % 100, parts[0] % 100]
    if parts[0] > 31:
        year, month, day = parts
    elif "/" not in text:
        day, month, year = parts
    else:
        month, day, year = parts
    try:
        return float(date(year, month, day).toordinal())
    except ValueError:
        return None
