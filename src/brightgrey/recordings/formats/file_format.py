"""Declaration of a file format that recordings may have; what no format recognises is read as delimited text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from brightgrey.recordings.formats.table import Table

__all__ = ["FileFormat"]


@dataclass(frozen=True)
class FileFormat:
    """One format, declared as ``FORMAT`` in a module of this folder.

    Attributes
    ----------
    title : str
        Name that users know, e.g. ``MATLAB``.
    recognises : callable
        ``recognises(start) -> bool``; `start` holds the first bytes of the file. Its name says nothing.
    read : callable
        ``read(path, like) -> Table``; `like` names the input column, for files whose columns differ in length. Raises
        RecordingError for a file that is damaged or holds no columns.
    text : bool
        True for a kind of text, which `read` takes from `text.read_text` and which may be compressed by gzip.
    """

    title: str
    recognises: Callable[[bytes], bool]
    read: Callable[[Path, str], Table]
    text: bool = False
