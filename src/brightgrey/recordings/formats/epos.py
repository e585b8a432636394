"""Text exported by the data recorder of maxon EPOS Studio: a preamble, a row of names, a row of units, numbers.

The delimited reader reads the numbers. The preamble says how many samples there have to be, which tells a file that was
cut off.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from brightgrey.recordings.formats.delimited import read_delimited
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.formats.text import first_text, read_text
from brightgrey.recordings.policy import READING

__all__ = ["FORMAT"]

VERSION = re.compile(r'^"?EPOS Studio Version:', re.MULTILINE)
RECORDED = re.compile(r'^"?Recorded samples:"?[^\d\n]*(\d{1,9})', re.MULTILINE)


def is_recorder_text(start: bytes) -> bool:
    """Recognise an export by the program's version in its preamble."""
    return bool(VERSION.search(first_text(start)))


def read_recorder_text(path: Path, like: str = "") -> Table:
    """Open an export of the data recorder; its columns are ``time`` and the recorded objects.

    Raises
    ------
    RecordingError
        As for `read_delimited`, and for a file with fewer samples than its preamble says.
    """
    table = read_delimited(path)
    text = read_text(path)
    preamble = "\n".join(text.lines(0, min(len(text), READING.head_lines))) if text else ""
    match = RECORDED.search(preamble)
    if match and int(match[1]) > table.rows.size:
        raise table.fault(f"{table.rows.size} samples where the preamble says {match[1]}; the file seems to be cut off")
    return replace(table, notes=tuple(note for note in table.notes if "above the numbers" not in note))


FORMAT = FileFormat("maxon EPOS Studio", is_recorder_text, read_recorder_text, text=True)
