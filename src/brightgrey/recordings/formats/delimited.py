"""Text files with columns: CSV in every dialect that loggers and spreadsheets write.

The reader finds encoding, delimiter, decimal and thousands mark, comment lines (``#``, ``%``, ``//``, ``!``), lines
before the header, and the header. Units in the header are written as ``torque [N m]``, ``torque (N m)`` or
``torque / N m``, or in a row below the names. Empty lines are skipped. Without a header the columns are called ``1``,
``2``, ... Without a time, a line above the header may state the sampling interval. A text that is compressed by gzip is
expanded.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from brightgrey.arrays import Indices
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.dialect import MISSING, Dialect, dialects, find_dialect
from brightgrey.recordings.formats.header import Lines, header_comment, named_columns, split_header
from brightgrey.recordings.formats.numbers import TextNumbers
from brightgrey.recordings.formats.stated_interval import stated_interval, with_interval
from brightgrey.recordings.formats.table import TIME_NAME, Column, Table, list_rows, skipped_rows, with_clocks
from brightgrey.recordings.formats.text import UNKNOWN_ENCODING, Text, read_text
from brightgrey.recordings.formats.time_stamps import are_stamps, first_day
from brightgrey.recordings.policy import READING
from brightgrey.recordings.units.parser import is_unit, parse_unit

__all__ = ["read_delimited"]

COMMENTS = ("#", "%", "//", "!")
MILLISECONDS = re.compile(r"(ms|msec|milli[ _]?(s|sec\w*|sek\w*))(\s*[\[(]ms[\])])?", re.IGNORECASE)
FRACTION = re.compile(r":\d\d([.,]\d|:\d{3})")
LEADING_WORD = re.compile(r"[^\W\d_][^\d]*")


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
    candidates = dialects(delimiter, decimal)
    text = read_text(path)
    if text is None:
        from brightgrey.recordings.formats import file_formats  # the list of all formats stands above this one

        known = ", ".join(file_format.title for file_format in file_formats())
        raise RecordingError(f"{name}: this is no text file, and no format that is known: delimited text, {known}")
    content = _without_cleared_cells(text, text.content(COMMENTS))
    head, comments = _head(text, name)
    if head.text and (match := re.fullmatch(r"sep=(.)", head.text[0])):  # a spreadsheet's own hint
        head, content = head[1:], content[1:]
        candidates = dialects(delimiter or match[1], decimal) if delimiter or match[1] in "\t;|, " else candidates
    if not content.size:
        raise RecordingError(f"{name}: the file is empty" + (" but for comments" if comments.text else ""))
    spread = _Spread(text, content)
    dialect = _find_dialect(head, spread, candidates, decimal, name)
    first = _first_numbers(head, spread, dialect, header, name)
    body = content[np.searchsorted(content, head.rows[first] - 1) :]
    body, notes = _without_footer(text, body, dialect)
    if text.encoding == UNKNOWN_ENCODING:
        notes.append(
            "the text is neither UTF-8, UTF-16 nor Windows-1252: names may look odd, their numbers stand for them"
        )
    if (between := int(body[-1] - body[0]) + 1 - body.size) > 0:
        notes.append(f"{between} empty or comment lines between the rows of numbers were skipped")
    body, restarts = _without_repeated(text, body, head[:first])
    table = _table(text, body, head[:first], comments, dialect, header, name)
    return replace(table, notes=(*table.notes, *notes, *restarts))


def _table(
    text: Text, body: Indices, head: Lines, comments: Lines, dialect: Dialect, header: bool | None, name: str
) -> Table:
    """Return the table of the numbers in the lines `body` below a `head`."""
    rows = [dialect.split(text.line(i)) for i in body[: READING.sampled_lines].tolist()]
    low, high = _widths(rows)
    commented = header is None and not head.text
    if commented:
        head = header_comment(comments, int(body[0]) + 1, low, dialect)
    above = Lines([*head.text, *comments.text], [*head.rows, *comments.rows])
    numbered = int(_has_row_names(text, body, rows, head, dialect))
    widths = (low - numbered, high - numbered)
    whole = dialect.delimiter == "," and not any("." in field for row in rows for field in row)
    hint = "; if commas are the decimal marks as well, export with semicolons or tabs between the columns" * whole
    columns, notes = named_columns(head, widths, dialect, name, hint) if header is not False else ((), ())
    columns = (*(Column("", ""),) * numbered, *columns) if columns else ()
    if commented and columns:
        notes = (f"column names are taken from the comment in row {head.rows[0]}",)
    width = len(columns) or low
    columns = columns or tuple(Column(str(i + 1), str(i + 1)) for i in range(width))
    fields = [[row[i] for row in rows if i < len(row)] for i in range(width)]
    stamps = {i: first_day(texts) for i, texts in enumerate(fields) if are_stamps(texts)}
    cell_units = {i: unit for i, texts in enumerate(fields) if (unit := _cell_unit(texts, dialect))}
    _refuse_contradiction(columns, cell_units, name)
    columns = tuple(
        replace(c, name=c.name or "time", unit="s", clock_time=True)
        if i in stamps
        else replace(c, unit=c.unit or cell_units.get(i, "").strip("()[]") or None, first=_first(fields[i], dialect))
        for i, c in enumerate(columns)
    )
    notes = (*notes, *_one_value_per_row(columns, fields, dialect))
    rising = {i for i, texts in enumerate(fields) if _is_rising(texts, dialect)}
    table = Table(name, with_clocks(columns, rising), body + 1, lambda indices: np.empty(0), notes)
    behind = {i: i + 1 for i in stamps if _are_milliseconds(columns[i + 1 : i + 2], fields[i])}
    numbers = TextNumbers(text, body, width, dialect, stamps, table, cell_units, milliseconds=behind)
    numbers.check_widths()
    table = replace(table, load=numbers.load)
    stated = None if _has_time(table.columns, fields[0], dialect) else stated_interval(above, dialect)
    return with_interval(table, stated) if stated else table


def _has_row_names(text: Text, body: Indices, rows: list[list[str]], head: Lines, dialect: Dialect) -> bool:
    """Return True if the header lacks a name for the first column, in which rows are counted in quotes, as R does."""
    counted = [row[0] for row in rows] == [str(i + 1) for i in range(len(rows))]
    if not (counted and head.text and text.line(int(body[0])).lstrip().startswith('"')):
        return False
    return len(split_header(head.text[-1], dialect, len(rows[0]) - 1)) == len(rows[0]) - 1


def _refuse_contradiction(columns: Sequence[Column], cell_units: Mapping[int, str], name: str) -> None:
    """Refuse a header whose unit is not that behind the numbers (RecordingError)."""
    for i, unit in cell_units.items():
        above = columns[i].unit or unit
        header, cells = (parse_unit(text) if is_unit(text) else None for text in (above, unit.strip("()[]")))
        if header and cells and (header.si, header.dimension) != (cells.si, cells.dimension):
            raise RecordingError(
                f"{name}: column '{columns[i].name}': its header gives the unit '{above}', its numbers have '{unit}':"
                " take one of them out"
            )


def _cell_unit(fields: list[str], dialect: Dialect) -> str:
    """Return the unit that stands behind every number of a column (``0.002 sec``), empty if none does."""
    units = {dialect.unit_behind(field) for field in fields if field.casefold() not in MISSING}
    return units.pop() if len(units) == 1 else ""


def _has_time(columns: Sequence[Column], first: list[str], dialect: Dialect) -> bool:
    """Return True if a column is a time, or if the first one rises as a time may; a number of samples rises by 1."""
    if any(TIME_NAME.fullmatch(c.name) or c.clock_time or c.is_in_time or c.clock is not None for c in columns):
        return True
    numbers = [dialect.number(field) or 0.0 for field in first[:2]]
    return _is_rising(first, dialect) and numbers[-1] - numbers[0] != 1.0


def _are_milliseconds(right: Sequence[Column], stamps: list[str]) -> bool:
    """Return True if the column right of clock times without a fraction holds their milliseconds, by its name."""
    return bool(right and MILLISECONDS.fullmatch(right[0].header)) and not any(map(FRACTION.search, stamps))


def _one_value_per_row(columns: Sequence[Column], fields: list[list[str]], dialect: Dialect) -> list[str]:
    """Return a note if a word in each row seems to say which channel its only number is of."""
    channels = [i for i, c in enumerate(columns) if not (c.clock_time or TIME_NAME.fullmatch(c.name))]
    numeric = [i for i in channels if all(map(dialect.is_number, fields[i]))]
    words: list[set[str]] = [set(fields[i]) for i in channels if not any(map(dialect.is_number, fields[i]))]
    if len(numeric) != 1 or not any(1 < len(found) <= READING.listed_columns for found in words):
        return []
    longest = max(words, key=len)
    names = ", ".join(sorted(longest))
    return [f"each row holds one number, and a word says of what ({names}): write a column for each of them"]


def _is_rising(fields: list[str], dialect: Dialect) -> bool:
    """Return True if every number of a column is larger than the one before."""
    numbers = [dialect.number(field) for field in fields if field.casefold() not in MISSING]
    return len(numbers) > 1 and all(a is not None and b is not None and a < b for a, b in pairwise(numbers))


def _first(fields: list[str], dialect: Dialect) -> float:
    """Return the first number of a column, NaN if it does not begin with one."""
    present = next((field for field in fields if field.casefold() not in MISSING), "")
    number = dialect.number(present)
    return float("nan") if number is None else number


@dataclass(frozen=True)
class _Spread:
    """Lines that stand for a whole file: some at its end, and some spread over it."""

    text: Text
    content: Indices

    def last(self) -> list[str]:
        """Return lines at the end of the file, without the first one."""
        part = self.content[1:] if self.content.size > 1 else self.content
        return [self.text.line(i) for i in part[-READING.sampled_lines :].tolist()]

    def over(self) -> list[str]:
        """Return lines spread over the file beyond its head."""
        step = max(1, self.content.size // READING.sampled_lines)
        return [self.text.line(i) for i in self.content[READING.sampled_lines :: step].tolist()]

    def has_comma_only(self) -> bool:
        """Return True if the second half of the file has commas, and no point."""
        half = int(self.content[self.content.size // 2])
        data = memoryview(self.text.data)[self.text.starts[half] :].tobytes()
        return b"," in data and b"." not in data


def _head(text: Text, name: str) -> tuple[Lines, Lines]:
    """Return the lines with content and the comments of the head of a file; a quoted name may span some lines."""
    content, comments = Lines([], []), Lines([], [])
    physical = text.lines(0, min(len(text), READING.head_lines))
    start = 0
    while start < len(physical):
        row, line, end = start + 1, physical[start], start + 1
        if line.count('"') % 2:
            ends = (start + n for n in range(2, 5))
            end = next((e for e in ends if "".join(physical[start:e]).count('"') % 2 == 0), end)
            line = " ".join(physical[start:end])
        start = end
        bare = line.lstrip(" \t\ufeff")
        if bare:
            kind = comments if bare.startswith(COMMENTS) else content
            kind.text.append(line)
            kind.rows.append(row)
    return content, comments


def _without_cleared_cells(text: Text, content: Indices) -> Indices:
    """Leave out lines of nothing but delimiters at the end, where a spreadsheet has cleared cells."""
    end = content.size
    while end and not text.line(int(content[end - 1])).strip(" \t;,|"):
        end -= 1
    return content[:end]


def _without_footer(text: Text, body: Indices, dialect: Dialect) -> tuple[Indices, list[str]]:
    """Leave out remarks below the numbers: lines of other width without any number in them, and summaries.

    A summary has a word where the first column has a number or a clock time: ``Min;-1.2;3.4``.
    """
    first = dialect.split(text.line(int(body[0])))
    numbered = bool(first) and not LEADING_WORD.match(first[0])
    end = body.size
    while end > 1 and body.size - end < READING.footer_lines:
        fields = dialect.split(text.line(int(body[end - 1])))
        named = fields[0] if fields and fields[0].casefold() not in MISSING else ""
        summary = numbered and bool(LEADING_WORD.fullmatch(named))
        if not summary and (len(fields) == len(first) or any(map(dialect.is_number, fields))):
            break
        end -= 1
    if end == body.size:
        return body, []
    return body[:end], [skipped_rows(body[end:] + 1, "below", text.line(int(body[end])))]


def _without_repeated(text: Text, body: Indices, head: Lines) -> tuple[Indices, list[str]]:
    """Leave out lines between the numbers that repeat one of the header: a logger was started again."""
    repeats = [i for line in set(head.text) for i in text.lines_like(line) if i > body[0]]
    if not repeats:
        return body, []
    rows = np.sort(np.array(repeats))
    return np.setdiff1d(body, rows, assume_unique=True), [
        f"{list_rows(rows + 1)} repeat{'' if rows.size > 1 else 's'} the header: skipped; the logger was started again"
    ]


def _find_dialect(
    head: Lines, spread: _Spread, candidates: Sequence[Dialect], decimal: str | None, name: str
) -> Dialect:
    """Find the dialect of a file from its first lines and from lines spread over it."""
    dialect, score = find_dialect([*head.text[: READING.sampled_lines], *spread.over()], candidates)
    if score == 0.0:
        raise RecordingError(
            f"{name}: no columns of numbers found; expected rows of numbers with comma, semicolon, tab or space between"
            " them, or one number in each row"
        )
    # The sampled lines may hold whole numbers only.
    whole = decimal is None and dialect.delimiter != "," and dialect.decimal == "." and not dialect.thousands
    return replace(dialect, decimal=",") if whole and spread.has_comma_only() else dialect


def _first_numbers(head: Lines, spread: _Spread, dialect: Dialect, header: bool | None, name: str) -> int:
    """Return the index of the first line in which most numeric columns hold a number."""
    if header is False:
        return 0
    tail = [dialect.split(line) for line in spread.last()]
    counts = Counter(i for row in tail for i, field in enumerate(row) if dialect.is_number(field))
    numeric = {i for i, count in counts.items() if 2 * count >= len(tail)}
    usual = Counter(map(len, tail)).most_common(1)[0][0]
    names = _last_names([dialect.split(line) for line in head.text], usual, numeric, dialect)
    for index, line in enumerate(head.text):
        if header and index == 0:
            continue
        fields = dialect.split(line)
        # A property in a preamble has another number of fields, and a name among them.
        uneven = len(fields) != usual and not _differ_by_empty(fields, usual)
        if uneven and not (len(fields) > 1 and all(map(dialect.is_number, fields))):
            continue
        candidates = [field for i, field in enumerate(fields) if i in numeric]
        present = [field for field in candidates if field.casefold() not in MISSING]
        numbers = sum(map(dialect.is_number, present))
        if index < names and numbers < len(present):  # a property that is as wide as the numbers
            continue
        if present and 2 * numbers >= len(present):
            return index
    raise RecordingError(f"{name}: there are no rows of numbers below the header")


def _last_names(rows: list[list[str]], width: int, numeric: Set[int], dialect: Dialect) -> int:
    """Return the index of the last row near the beginning with nothing but text in columns of numbers, or -1."""
    last = -1
    for index, fields in enumerate(rows[: READING.preamble_lines]):
        cells = [field for i, field in enumerate(fields[:width]) if i in numeric]
        texts = [field for field in cells if field]
        if len(cells) == len(numeric) and len(texts) > 1 and not any(map(dialect.is_number, texts)):
            last = index
    return last


def _differ_by_empty(fields: list[str], width: int) -> bool:
    """Return True if a row is longer than `width` by nothing but empty fields."""
    return len(fields) > width and not any(fields[width:])


def _widths(rows: list[list[str]]) -> tuple[int, int]:
    """Return the usual number of fields, without and with columns at the end that are always empty."""
    high = low = Counter(map(len, rows)).most_common(1)[0][0]
    while low > 1 and not any(row[low - 1] for row in rows if len(row) >= low):
        low -= 1
    return low, high
