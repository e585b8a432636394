"""Header of a text file with columns: names and units in the lines above the numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.dialect import DELIMITERS, MISSING, Dialect
from brightgrey.recordings.formats.table import TIME_NAME, Column, skipped_rows
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit, parse_unit

__all__ = ["Lines", "column_of", "header_comment", "named_columns", "split_header"]

# In brackets at the end, after a slash, after the word "in", or as a number of turns per time: "n 1/min".
HEADER_UNITS = (
    re.compile(r"(?P<name>.*\S)\s+in\s+(?P<unit>\S.*)"),
    re.compile(r"(?P<name>.*\S)\s+(?P<unit>1/[a-z]+)"),
    re.compile(r"(?P<name>.*[^\s/])\s*/?\s*(?P<unit>\[[^\[\]]*\]|\{[^{}]*\}|\([^()]*\))"),
    re.compile(r"(?P<name>.*?\S)\s*(?P<unit>\(.*\)|/\s*\S.*)"),
)
# Fields of a header with white space as delimiter: quoted, a name with its unit in brackets, or plain.
HEADER_FIELD = re.compile(r'"[^"]*"|[^\s\[(]+\s*(?:\[[^\]]*\]|\([^)]*\))|\S+')
# Word before the names in a comment, or before the units in their row.
CAPTION_WORD = re.compile(r"(columns?|fields?|names?|units?|einheit(en)?|spalten?)\s*:?", re.IGNORECASE)


@dataclass(frozen=True)
class Lines:
    """Lines of a file that are not empty, and their row numbers in the file (from 1)."""

    text: list[str]
    rows: list[int]

    def __getitem__(self, part: slice) -> Lines:
        return Lines(self.text[part], self.rows[part])


def named_columns(
    head: Lines, widths: tuple[int, int], dialect: Dialect, name: str, hint: str = ""
) -> tuple[tuple[Column, ...], tuple[str, ...]]:
    """Return the columns named by the lines above the numbers, and notes on skipped lines.

    With a row of units the names are the line above it that has as many fields as the numbers. Without one they are
    the first such line that names a time, else the first one with units, else the first one. All others are a preamble
    or remarks. Where there are only remarks of one field, the columns have no names.

    Parameters
    ----------
    head : Lines
    widths : (int, int)
        Usual number of fields of the numbers, without and with columns at the end that are always empty.
    dialect : Dialect
    name : str
        Of the file.
    hint : str
        Further advice for the error.

    Raises
    ------
    RecordingError
        If no line has as many fields as the numbers have.
    """
    if not head.text:
        return (), ()
    low, high = widths
    rows = [split_header(line, dialect, low) for line in head.text]
    fitting = [i for i, fields in enumerate(rows) if low <= len(fields) <= high]
    if not fitting and low > 2 and all(len(fields) == 1 for fields in rows):
        return (), (skipped_rows(np.array(head.rows), "above", head.text[0]), "no row names the columns")
    if not fitting:
        raise RecordingError(
            f"{name}: row {head.rows[-1]}: the header has {len(rows[-1])} fields, rows below have {low}:"
            f" give it one name for each of them{hint}"
        )
    unit_row = next((i for i in reversed(range(1, len(rows))) if _are_units(rows[i], high)), None)
    if unit_row is not None and fitting[0] < unit_row:
        above = [i for i in fitting if i < unit_row]
        at = max((i for i in above if _are_names(rows[i], dialect)), default=above[-1])
    else:
        names = [i for i in fitting if _are_names(rows[i], dialect)]
        found = {i: [column_of(field) for field in rows[i]] for i in names}
        timed = (i for i in names if any(TIME_NAME.fullmatch(column.name) for column in found[i]))
        with_units = (i for i in names if any(column.unit for column in found[i]))
        unit_row, at = None, next(timed, next(with_units, next(iter(names), fitting[0])))
    columns = [column_of(field) for field in rows[at]]
    if unit_row is not None:
        for i, unit in enumerate(_units_in(rows[unit_row])[: len(columns)]):
            columns[i] = replace(columns[i], unit=columns[i].unit or (None if unit in MISSING else unit))
    columns = [_time_of(column) if not column.name else column for column in columns]
    skipped = [i for i in range(len(rows)) if i not in (at, unit_row)]
    notes = []
    if skipped:
        notes = [skipped_rows(np.array([head.rows[i] for i in skipped]), "above", head.text[skipped[0]])]
    return tuple(columns), tuple(notes)


def header_comment(comments: Lines, first_row: int, width: int, dialect: Dialect) -> Lines:
    """Return the header in the last comment above the numbers, as numpy writes it, or in the one above its units.

    It is empty if no comment fits.
    """
    above = [(text, row) for text, row in zip(comments.text, comments.rows, strict=True) if row < first_row]
    if not above:
        return Lines([], [])
    last = [
        (re.sub("^" + CAPTION_WORD.pattern + r"(?<=:)\s*", "", text.lstrip(" #%/!"), count=1), row)
        for text, row in above[-2:]
    ]
    fields = [split_header(text, dialect, width) for text, _ in last]
    fitting = [len(row) == width and not any(map(dialect.is_number, row)) for row in fields]
    if not fitting[-1]:
        return Lines([], [])
    named = last if all(fitting) and _are_units(fields[-1], width) else last[-1:]
    return Lines([text for text, _ in named], [row for _, row in named])


def split_header(line: str, dialect: Dialect, width: int) -> list[str]:
    """Split a header into `width` fields if possible, without empty fields at its end; its delimiter may be another."""
    fields = dialect.split(line)
    if len(fields) == 1 < width:
        others = (
            replace(dialect, delimiter=mark).split(line)
            for mark in DELIMITERS
            if mark in line and mark != dialect.decimal
        )
        fields = next((found for found in others if len(found) == width and all(found)), fields)
    if dialect.delimiter == " " and len(fields) != width:
        fields = [field.strip('"') for field in HEADER_FIELD.findall(line)]
        if len(fields) != width:
            fields = re.split(r"\s{2,}|\t", line.strip())
    while fields and not fields[-1]:
        fields.pop()
    # Names with commas between them above numbers with spaces.
    marked = len(fields) > 1 and any(all(field.endswith(mark) for field in fields[:-1]) for mark in ",;")
    return [field.rstrip(",;") for field in fields] if marked else fields


def column_of(header: str) -> Column:
    """Return the column with the unit in its header; an index (``axis[1]``) or a remark is part of the name."""
    for pattern in HEADER_UNITS if len(header) < READING.longest_header else ():
        match = pattern.fullmatch(header)
        written = match["unit"] if match else ""
        unit = written.removeprefix("/").strip()
        unit = unit[1:-1].strip() if unit[:1] + unit[-1:] in ("()", "[]", "{}") else unit
        # Text in square brackets is meant as a unit even if it is misspelt.
        if match and unit and not unit.isdecimal() and (written.startswith("[") or is_unit(unit)):
            return Column(match["name"], header, unit)
    return Column(header, header)


def _are_names(fields: list[str], dialect: Dialect) -> bool:
    """Return True for different texts none of which is a number, unless the first names a property (``Date:``)."""
    present = [field for field in fields if field]
    distinct = len(set(present)) == len(present)
    return distinct and not any(map(dialect.is_number, fields)) and not fields[0].endswith(":")


def _units_in(fields: list[str]) -> list[str]:
    units = [field.strip("[](){} ") for field in fields]
    return ["", *units[1:]] if units and CAPTION_WORD.fullmatch(units[0]) else units


def _are_units(fields: list[str], width: int) -> bool:
    """Return True if a row below names gives their units."""
    present = [unit for unit in _units_in(fields) if unit not in MISSING]
    return 0 < len(present) <= len(fields) <= width and all(map(is_unit, present))


def _time_of(column: Column) -> Column:
    """Return a column without a name as the time if its unit is one of time."""
    if column.unit and is_unit(column.unit) and parse_unit(column.unit).dimension == (("[time]", 1),):
        return replace(column, name="time", header="time")
    return column
