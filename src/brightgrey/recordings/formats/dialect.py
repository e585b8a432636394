"""Dialect of a text file: delimiter and decimal mark, found from the rows of numbers."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from brightgrey.errors import SettingsError, unknown_name

__all__ = ["MISSING", "Dialect", "dialects", "find_dialect"]

NAMED_DELIMITERS = {"tab": "\t", "\\t": "\t", "semicolon": ";", "comma": ",", "space": " "}
# In order of preference where they explain a file equally well; a space stands for any white space.
DELIMITERS = ("\t", ";", "|", ",", " ")
# Texts that loggers and spreadsheets write for a missing value.
MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "?"})
NUMBERS = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)


@dataclass(frozen=True)
class Dialect:
    """Delimiter (a space means any white space) and decimal mark of a file."""

    delimiter: str
    decimal: str

    def split(self, line: str) -> list[str]:
        """Cut a line into its fields, without quotes and white space around them."""
        if '"' in line:
            fields = next(csv.reader([line.strip()], delimiter=self.delimiter, skipinitialspace=True))
            if self.delimiter == " ":
                fields = [field for field in fields if field]
        elif self.delimiter == " ":
            fields = line.split()
        else:
            fields = line.split(self.delimiter)
        return [field.strip() for field in fields]

    def is_number(self, field: str) -> bool:
        """Return True if a field holds a number, infinity included."""
        return bool(NUMBERS[self.decimal].fullmatch(field) or INFINITE.fullmatch(field))

    def number(self, field: str) -> float | None:
        """Return the value of a field: NaN if it is missing, None for text."""
        if field.casefold() in MISSING:
            return float("nan")
        return float(field.replace(",", ".")) if self.is_number(field) else None


def dialects(delimiter: str | None, decimal: str | None) -> list[Dialect]:
    """Return all dialects that a user's choice leaves; None leaves any.

    Raises
    ------
    SettingsError
        For an unknown delimiter or decimal mark.
    """
    delimiter = NAMED_DELIMITERS.get(delimiter or "", delimiter)
    if delimiter is not None and delimiter not in DELIMITERS:
        raise SettingsError(unknown_name("delimiter", delimiter, NAMED_DELIMITERS))
    if decimal not in (None, ".", ","):
        raise SettingsError(f"decimal mark '{decimal}' is neither '.' nor ','")
    if delimiter == decimal == ",":
        raise SettingsError("delimiter and decimal mark cannot both be a comma")
    return [
        Dialect(d, mark)
        for d in ([delimiter] if delimiter else DELIMITERS)
        for mark in ([decimal] if decimal else (".", ","))
        if d != mark
    ]


def find_dialect(lines: Sequence[str], candidates: Sequence[Dialect]) -> tuple[Dialect, float]:
    """Return the dialect in which most fields are numbers.

    Parameters
    ----------
    lines : sequence of str
        Lines of the file, not empty; headers among them do no harm.
    candidates : sequence of Dialect

    Returns
    -------
    dialect : Dialect
    score : float
        Share of numbers among the fields of the lines that have the usual number of fields (at least two).
    """

    def score(dialect: Dialect) -> float:
        rows = [dialect.split(line) for line in lines]
        width = Counter(len(row) for row in rows).most_common(1)[0][0]
        if width < 2:
            return 0.0
        total = 0.0
        for row in rows:
            if len(row) == width:
                present = [field for field in row if field.casefold() not in MISSING]
                total += sum(map(dialect.is_number, present)) / max(len(present), 1)
        return total / len(rows)

    scores = [score(dialect) for dialect in candidates]
    best = max(scores)
    return candidates[scores.index(best)], best
