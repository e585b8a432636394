"""Dialect of a text file: delimiter, decimal mark and thousands mark, found from the rows of numbers."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from brightgrey.errors import SettingsError, unknown_name
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit

__all__ = ["DELIMITERS", "MISSING", "Dialect", "dialects", "find_dialect", "with_thousands"]

NAMED_DELIMITERS = {"tab": "\t", "\\t": "\t", "semicolon": ";", "comma": ",", "space": " "}
# In order of preference where they explain a file equally well; a space stands for any white space.
DELIMITERS = ("\t", ";", "|", ",", " ")
# Texts that loggers and spreadsheets write for a missing value: common ones, spreadsheets in several languages, and the
# runtime libraries of C and .NET.
MISSING = frozenset(
    {
        *("", "nan", "na", "n/a", "null", "none", "-", "--", "---", "?", "<null>", "(null)", "bad", "missing"),
        *("#n/a", "#na", "#nv", "#n/d", "#nd", "#div/0!", "#num!", "#zahl!", "#value!", "#wert!", "#valeur!"),
        *("-nan", "+nan", "nan(ind)", "-nan(ind)", "nan(snan)", "-nan(snan)", "1.#qnan", "-1.#qnan", "1.#ind"),
        *("-1.#ind", "1.#snan", "n. def.", "n.def.", "non numérique"),
    }
)
# Each digit can be matched in one way only: a failing match of a long field takes linear time.
NUMBERS = {
    ".": re.compile(r"[+−-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+−-]?\d+)?|[+−-]?\d*\.\d+[dD][+−-]?\d+", re.ASCII),
    ",": re.compile(r"[+−-]?(?:\d+(?:,\d+)?|,\d+)(?:[eE][+−-]?\d+)?", re.ASCII),
}
INFINITE = re.compile(r"(?P<sign>[+-]?)(?:inf(?:inity)?|∞|1[.]#INF)", re.IGNORECASE)
# Begins with a letter, in brackets or not, and has no digit but in exponents: "s 1" is the field of another delimiter.
UNIT = re.compile(r"[(\[]?[^\W\d_eE](?:[^\d\s]|(?<=\S)\d|\s(?![+−-]?\d))*|[(\[]?[%°‰].{0,3}|-")
# Thousands marks that are nothing else; a plain space is one beside semicolons only.
BLANKS = " \u00a0\u202f"
SURE_MARKS = "'’" + BLANKS
THOUSANDS = {".": ",'’" + BLANKS, ",": ".'’" + BLANKS}
# Python's float reads none of these: the minus sign of typography, and exponents of Fortran.
PLAIN_SIGNS = str.maketrans("−dD", "-ee")
QUOTED_COMMA = re.compile(r'"([+−-]?\d*,\d+)"')
COMMA_GROUPS = re.compile(r"[+−-]?[1-9]\d{0,2}(,\d{3})+")


@dataclass(frozen=True)
class Dialect:
    """Delimiter (a space means any white space), decimal mark and thousands mark (empty for none) of a file."""

    delimiter: str
    decimal: str
    thousands: str = ""
    units: bool = False  #: True if units stand behind numbers (``0.5 N m``).

    def split(self, line: str) -> list[str]:
        """Cut a line into its fields, without quotes and white space around them."""
        if '"' in line:
            fields = self._split_quoted(line.strip())
        elif self.delimiter == " ":
            fields = line.split() if line.isascii() else re.split(r"[ \t]+", line.strip())
        else:
            fields = line.split(self.delimiter)
        return [field.strip() for field in fields]

    def _split_quoted(self, line: str) -> list[str]:
        try:
            fields = next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))
        except csv.Error:  # a field of more than 131,072 characters; no quote can mean anything there
            fields = line.split(self.delimiter)
        return [field for field in fields if field] if self.delimiter == " " else fields

    def is_number(self, field: str) -> bool:
        """Return True if a field holds a number, infinity included; with its unit if units stand behind numbers."""
        return self._is_plain(field) or (self.units and bool(self.unit_behind(field)))

    def unit_behind(self, field: str) -> str:
        """Return the unit behind the number of a field, empty if there is none."""
        match = NUMBERS[self.decimal].match(field) if len(field) < READING.longest_number else None
        unit = field[match.end() :].strip() if match else ""
        return unit if UNIT.fullmatch(unit) and is_unit(unit.strip("()[]")) else ""

    def _is_plain(self, field: str) -> bool:
        if len(field) > READING.longest_number:
            return False
        if self.thousands and self.thousands in field:
            return bool(self._grouped.fullmatch(field))
        return bool(NUMBERS[self.decimal].fullmatch(field) or INFINITE.fullmatch(field))

    def number(self, field: str) -> float | None:
        """Return the value of a field without unit: NaN if it is missing, None for text."""
        if field.casefold() in MISSING:
            return float("nan")
        if not self._is_plain(field):
            return None
        if match := INFINITE.fullmatch(field):
            return float(f"{match['sign']}inf")
        plain = field.replace(self.thousands, "") if self.thousands else field
        return float((plain.replace(",", ".") if self.decimal == "," else plain).translate(PLAIN_SIGNS))

    @cached_property
    def _grouped(self) -> re.Pattern[str]:
        return re.compile(
            rf"[+−-]?[1-9]\d{{0,2}}(?:{re.escape(self.thousands)}\d{{3}})+(?:{re.escape(self.decimal)}\d*)?"
        )


def with_thousands(dialect: Dialect, lines: Sequence[str]) -> Dialect:
    """Return the dialect with the thousands mark that lines show beyond doubt.

    A mark is beyond doubt where a number has two of them or a decimal mark as well (``1.234.567``, ``1,234.5``), or if
    it is an apostrophe or a space. ``1.500`` beside numbers with a decimal comma is not: it may be one and a half.
    """
    found = set()
    for mark in THOUSANDS[dialect.decimal]:
        if mark == dialect.delimiter and not any('"' in line for line in lines):
            continue
        if mark in BLANKS and (dialect.delimiter in ", " or (mark == " " and dialect.delimiter != ";")):
            continue
        sure = replace(dialect, thousands=mark)
        for line in lines:
            fields = sure.split(line) if mark in line else ()
            numbers = [field for field in fields if mark in field and sure.is_number(field)]
            if any(f.count(mark) > 1 or dialect.decimal in f or mark in SURE_MARKS for f in numbers):
                found.add(mark)
                break
    return replace(dialect, thousands=found.pop()) if len(found) == 1 else dialect


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
    ]


def _is_mixed(dialect: Dialect, lines: Sequence[str]) -> bool:
    """Return True if delimiter and decimal mark are one, and no quoted number in the lines shows that it is both."""
    if dialect.delimiter != dialect.decimal:
        return False
    return not any(
        not COMMA_GROUPS.fullmatch(field) for line in lines if '"' in line for field in QUOTED_COMMA.findall(line)
    )


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
        Share of numbers among the fields of the lines that have the usual number of fields (at least two). Without
        such lines, the share of those that are one number, if it is the larger part.
    """
    shown = [with_thousands(dialect, lines) for dialect in candidates if not _is_mixed(dialect, lines)]
    best, score, width = _best_of(shown, lines)
    if score == 1.0:
        return best, score
    with_units, more, _ = _best_of([replace(dialect, units=True) for dialect in shown], lines)
    # One column more, in most lines: a single remark with a number and a unit decides nothing.
    return (with_units, more) if more - score > 0.5 / width else (best, score)


def _best_of(shown: Sequence[Dialect], lines: Sequence[str]) -> tuple[Dialect, float, int]:
    """Return the dialect with the highest score, the score, and the usual number of fields."""

    def scored(dialect: Dialect) -> tuple[float, int]:
        rows = [dialect.split(line) for line in lines]
        width = Counter(len(row) for row in rows).most_common(1)[0][0]
        if width < 2:
            return 0.0, 1
        total = 0.0
        for row in rows:
            if len(row) == width:
                present = [field for field in row if field.casefold() not in MISSING]
                total += sum(map(dialect.is_number, present)) / max(len(present), 1)
        return total / len(rows), width

    found = [scored(dialect) for dialect in shown]
    best = max(score for score, _ in found)
    if best == 0.0:
        found = [(sum(map(dialect.is_number, map(str.strip, lines))) / len(lines), 1) for dialect in shown]
        best = max(score for score, _ in found)
        best = best if best > 0.5 else 0.0
    at = int(np.argmax([score for score, _ in found]))
    return shown[at], best, found[at][1]
