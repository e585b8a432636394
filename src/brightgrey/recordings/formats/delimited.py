"""Text files with columns: CSV in every dialect that loggers and spreadsheets write.

The reader finds encoding, delimiter, decimal mark, comment lines (``#``, ``%``, ``//``), lines before the header, and
the header. Units in the header are written as ``torque [N m]``, ``torque (N m)`` or ``torque / N m``, or in a row
below the names. Empty lines are skipped. Without a header the columns are called ``1``, ``2``, ...
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.dialect import MISSING, Dialect, dialects, find_dialect
from brightgrey.recordings.formats.table import Column, Table, list_rows
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit

__all__ = ["read_delimited"]

COMMENTS = ("#", "%", "//")
HEADER_UNIT = re.compile(r"(?P<name>.*?\S)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>.*)\)|\s*/\s*(?P<slash>\S.*))")
# Fields of a header with white space as delimiter: quoted, a name with its unit in brackets, or plain.
HEADER_FIELD = re.compile(r'"[^"]*"|[^\s\[(]+\s*(?:\[[^\]]*\]|\([^)]*\))|\S+')


@dataclass(frozen=True)
class Lines:
    """Lines of a file that are not empty, and their row numbers in the file (from 1)."""

    text: list[str]
    rows: list[int]

    def __getitem__(self, part: slice) -> Lines:
        return Lines(self.text[part], self.rows[part])


def read_delimited(
    path: Path, *, delimiter: str | None = None, decimal: str | None = None, header: bool | None = None
) -> Table:
    """Open a text file with columns.

    Parameters
    ----------
    path : Path
    delimiter : str, optional
        ``,``, ``;``, ``|``, a tab, or a space for any white space.
    decimal : str, optional
        ``.`` or ``,``.
    header : bool, optional
        True if the first line that is no comment names the columns.

    Returns
    -------
    Table

    Raises
    ------
    RecordingError
        For files that are no text, empty, or have no columns of numbers; for rows of uneven length.
    SettingsError
        For an unknown delimiter or decimal mark.
    """
    name = path.name
    lines, comments = _content_and_comments(_decode(path.read_bytes(), name))
    if lines.text and (match := re.fullmatch(r"sep=(.)", lines.text[0])):  # a spreadsheet's own hint
        lines, delimiter = lines[1:], delimiter or match[1]
    if not lines.text:
        raise RecordingError(f"{name}: the file is empty" + (" but for comments" if comments.text else ""))
    dialect = _find_dialect(lines, dialects(delimiter, decimal), decimal, name)
    first = _first_numbers(lines.text, dialect, header, name)
    head, body = lines[:first], lines[first:]
    commented = header is None and first == 0
    if commented:
        head = _header_comment(comments, lines, dialect)
    columns, notes = _named_columns(head, body, dialect, name) if header is not False else ((), ())
    if commented and columns:
        notes = (f"column names are taken from the comment in row {head.rows[0]}",)
    width = len(columns) or _widths(body.text, dialect)[0]
    columns = columns or tuple(Column(str(i + 1), str(i + 1)) for i in range(width))
    if (between := body.rows[-1] - body.rows[0] + 1 - len(body.rows)) > 0:
        notes = (*notes, f"{between} empty or comment lines between the rows of numbers were skipped")
    table = Table(name, columns, np.array(body.rows), lambda indices: np.empty(0), notes)
    _check_widths(body, width, dialect, table)
    return replace(table, load=lambda indices: _parse_numbers(body.text, indices, dialect, table))


def _decode(data: bytes, name: str) -> str:
    """Decode UTF-8, UTF-16 with a byte order mark, or Windows-1252."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encodings = ["utf-16"]
    elif b"\x00" in data[:4096]:
        from brightgrey.recordings.formats import file_formats  # the list of all formats stands above this one

        known = ", ".join(file_format.title for file_format in file_formats())
        raise RecordingError(f"{name}: this is no text file, and no format that is known: delimited text, {known}")
    else:
        encodings = ["utf-8-sig", "cp1252"]
    for encoding in encodings:
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise RecordingError(f"{name}: the text is neither UTF-8 nor UTF-16 nor Windows-1252")


def _content_and_comments(text: str) -> tuple[Lines, Lines]:
    """Split a text into lines with content and comment lines."""
    content, comments = Lines([], []), Lines([], [])
    physical = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    start = 0
    while start < len(physical):
        row, line, end = start + 1, physical[start], start + 1
        if line.count('"') % 2:  # a quoted name may continue on the next lines
            ends = (start + n for n in range(2, 5))
            end = next((e for e in ends if "".join(physical[start:e]).count('"') % 2 == 0), end)
            line = " ".join(physical[start:end])
        start = end
        bare = line.lstrip(" \ufeff")
        if bare:
            kind = comments if bare.startswith(COMMENTS) else content
            kind.text.append(line)
            kind.rows.append(row)
    # A spreadsheet leaves lines of nothing but delimiters where cells have been cleared.
    end = len(content.text)
    while end and not content.text[end - 1].strip(" \t;,|"):
        end -= 1
    return content[:end], comments


def _find_dialect(lines: Lines, candidates: Sequence[Dialect], decimal: str | None, name: str) -> Dialect:
    """Find the dialect of a file from its first lines and from lines spread over it."""
    text = lines.text
    sample = text[: READING.sampled_lines] + text[READING.sampled_lines :: max(1, len(text) // READING.sampled_lines)]
    dialect, score = find_dialect(sample, candidates)
    if score == 0.0:
        raise RecordingError(
            f"{name}: no columns of numbers found; expected rows of two numbers at least, with comma,"
            " semicolon, tab or space between them"
        )
    if decimal is None and dialect.delimiter != "," and dialect.decimal == ".":
        # The sampled lines may hold whole numbers only.
        body = text[len(text) // 2 :]
        if not any("." in line for line in body) and any("," in line for line in body):
            return replace(dialect, decimal=",")
    return dialect


def _first_numbers(text: list[str], dialect: Dialect, header: bool | None, name: str) -> int:
    """Return the index of the first line in which most numeric columns hold a number."""
    if header is False:
        return 0
    tail = [dialect.split(line) for line in (text[1:] or text)[-READING.sampled_lines :]]
    width = max(len(fields) for fields in tail)
    shares = [sum(dialect.is_number(row[i]) for row in tail if i < len(row)) / len(tail) for i in range(width)]
    numeric = [i for i, share in enumerate(shares) if share >= 0.5]
    for index, line in enumerate(text):
        if header and index == 0:
            continue
        fields = [field for i, field in enumerate(dialect.split(line)) if i in numeric]
        present = [field for field in fields if field.casefold() not in MISSING]
        if present and 2 * sum(map(dialect.is_number, present)) >= len(present):
            return index
    raise RecordingError(f"{name}: there are no rows of numbers below the header")


def _header_comment(comments: Lines, lines: Lines, dialect: Dialect) -> Lines:
    """Return the header in the last comment above the numbers, as numpy writes it; empty if it does not fit."""
    above = [(text, row) for text, row in zip(comments.text, comments.rows, strict=True) if row < lines.rows[0]]
    if not above:
        return Lines([], [])
    text = above[-1][0].lstrip(" #%/")
    width = _widths(lines.text, dialect)[0]
    fields = _split_header(text, dialect, width)
    fitting = len(fields) == width and not any(map(dialect.is_number, fields))
    return Lines([text], [above[-1][1]]) if fitting else Lines([], [])


def _split_header(line: str, dialect: Dialect, width: int) -> list[str]:
    """Split a header into `width` fields if possible, without empty fields at its end."""
    fields = dialect.split(line)
    if dialect.delimiter == " " and len(fields) != width:
        fields = [field.strip('"') for field in HEADER_FIELD.findall(line)]
        if len(fields) != width:
            fields = re.split(r"\s{2,}|\t", line.strip())
    while fields and not fields[-1]:
        fields.pop()
    return fields


def _named_columns(head: Lines, body: Lines, dialect: Dialect, name: str) -> tuple[tuple[Column, ...], tuple[str, ...]]:
    """Return the columns named by the lines above the numbers, and notes on skipped lines."""
    if not head.text:
        return (), ()
    low, high = _widths(body.text, dialect)
    rows = [_split_header(line, dialect, low) for line in head.text]
    at = next((i for i, fields in enumerate(rows) if low <= len(fields) <= high), None)
    if at is None:
        raise RecordingError(
            f"{name}: row {head.rows[-1]}: the header has {len(rows[-1])} fields, rows below have {low}"
        )
    columns = [_column_of(field) for field in rows[at]]
    unit_row = next((i for i in range(at + 1, len(rows)) if _are_units(rows[i], len(columns))), None)
    if unit_row is not None:
        for i, unit in enumerate(field.strip("[]() ") for field in rows[unit_row]):
            columns[i] = replace(columns[i], unit=columns[i].unit or (None if unit in MISSING else unit))
    skipped = [i for i in range(len(rows)) if i not in (at, unit_row)]
    notes = []
    if skipped:
        places = list_rows(np.array([head.rows[i] for i in skipped]))
        notes = [f"{places} above the numbers is skipped, beginning '{head.text[skipped[0]][:40]}'"]
    return tuple(columns), tuple(notes)


def _are_units(fields: list[str], width: int) -> bool:
    """Return True if a row below `width` names gives their units."""
    present = [field.strip("[]() ") for field in fields if field.strip("[]() ") not in MISSING]
    return 0 < len(present) <= len(fields) <= width and all(map(is_unit, present))


def _column_of(header: str) -> Column:
    """Return the column with the unit in its header; an index (``axis[1]``) or a remark is part of the name."""
    if match := HEADER_UNIT.fullmatch(header):
        unit = next(filter(None, match.groups()[1:]), "").strip()
        unit = unit[1:-1].strip() if unit.startswith("(") and unit.endswith(")") else unit
        # Text in square brackets is meant as a unit even if it is misspelt.
        if unit and not unit.isdecimal() and (match["square"] or is_unit(unit)):
            return Column(match["name"], header, unit)
    return Column(header, header)


def _widths(text: list[str], dialect: Dialect) -> tuple[int, int]:
    """Return the usual number of fields, without and with columns at the end that are always empty."""
    rows = [dialect.split(line) for line in text[: READING.sampled_lines]]
    high = low = Counter(map(len, rows)).most_common(1)[0][0]
    while low > 1 and not any(row[low - 1] for row in rows if len(row) >= low):
        low -= 1
    return low, high


def _check_widths(body: Lines, width: int, dialect: Dialect, table: Table) -> None:
    """Refuse rows with more or fewer fields; additional empty fields at the end are accepted."""
    text, delimiter = body.text, dialect.delimiter
    plain = not any('"' in line for line in text)
    if plain and delimiter == " ":
        counts = np.array([len(line.split()) for line in text])
    elif plain:
        counts = np.array([line.count(delimiter) for line in text]) + 1
    else:
        counts = np.array([len(dialect.split(line)) for line in text])
    for index in np.flatnonzero(counts != width):
        fields = dialect.split(text[index])
        if len(fields) > width and not any(fields[width:]):
            continue
        cut = "; the file seems to be cut off" if index == len(text) - 1 and len(fields) < width else ""
        raise table.fault(f"{len(fields)} fields where {width} are expected{cut}", row=body.rows[index])


def _parse_numbers(text: list[str], indices: Sequence[int], dialect: Dialect, table: Table) -> Array:
    """Return the numbers of some columns, shape (len(indices), samples), by the fast parser if it can read them."""
    lines, foreign = text, '"'
    if dialect.decimal == ",":
        lines, foreign = [line.replace(",", ".") for line in text], '".'  # a point could separate thousands
    if not any(mark in line for mark in foreign for line in text):
        delimiter = None if dialect.delimiter == " " else dialect.delimiter
        try:
            values = np.loadtxt(lines, delimiter=delimiter, comments=None, usecols=tuple(indices), ndmin=2)
            return np.ascontiguousarray(values.T, dtype=np.float64)
        except ValueError:
            pass  # an empty field, a word for a missing value, or text; the loop below decides
    columns = np.empty((len(indices), len(text)))
    for sample, line in enumerate(text):
        fields = dialect.split(line)
        for target, index in enumerate(indices):
            value = dialect.number(fields[index])
            if value is None:
                column, row = table.columns[index].name, int(table.rows[sample])
                raise table.fault(f"'{fields[index]}' is not a number", column=column, row=row)
            columns[target, sample] = value
    return columns
