"""Errors that a user can act on: what came, what is allowed, the nearest right name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from itertools import islice
from typing import TypeVar

__all__ = [
    "BrightgreyError",
    "RecordingError",
    "SettingsError",
    "StructureError",
    "nearest",
    "one_of",
    "printable",
    "unknown_name",
]

Name = TypeVar("Name", bound=str)


LONGEST_NAME, COMPARED_NAMES = 100, 2000
"""Characters of a name, and number of names, that a wrong name is compared with: a damaged file has any number."""
LONGEST_MESSAGE = 1000
"""Characters of the longest message; the middle of a longer one is left out."""


def printable(text: str) -> str:
    """Return a text as one line without control characters, which a file must not write to a terminal."""
    line = " ".join(text.split()) if "\n" in text or "\t" in text or "\r" in text else text
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in line)


class BrightgreyError(ValueError):
    """Wrong use or unusable input. The message is one line that says what to change."""

    def __init__(self, message: str = "") -> None:
        line = printable(message)
        if len(line) > LONGEST_MESSAGE:
            line = f"{line[: LONGEST_MESSAGE * 3 // 4]} ... {line[-LONGEST_MESSAGE // 5 :]}"
        super().__init__(line)


class StructureError(BrightgreyError):
    """A structure that names an unknown effect or breaks a rule of its grammar."""


class RecordingError(BrightgreyError):
    """A recording that cannot be read or used; names file, column and row where there are any."""


class SettingsError(BrightgreyError):
    """A bound, parameter value or option outside of what is allowed."""


def nearest(name: str, allowed: Iterable[str]) -> str | None:
    """Name in `allowed` that looks most like `name`, or None if nothing comes close."""
    names = [candidate for candidate in islice(allowed, COMPARED_NAMES) if len(candidate) <= LONGEST_NAME]
    folded = {candidate.casefold(): candidate for candidate in names}
    close = difflib.get_close_matches(name[:LONGEST_NAME].casefold(), list(folded), n=1, cutoff=0.5)
    return folded[close[0]] if close else None


def unknown_name(kind: str, name: str, allowed: Iterable[str]) -> str:
    """One line that says which `kind` is unknown, the nearest right name and all allowed ones."""
    names = list(allowed)
    guess = nearest(name, names)
    hint = f" Did you mean '{guess}'?" if guess else ""
    return f"unknown {kind} '{name}'.{hint} Allowed: {', '.join(names)}"


def one_of(kind: str, name: object, allowed: Iterable[Name], *, error: type[BrightgreyError] = SettingsError) -> Name:
    """Return the allowed name that equals `name`; refuse any other with what is allowed and the nearest right name.

    Parameters
    ----------
    kind : str
        What the name stands for, in words: ``'estimator'``.
    name : object
        What came.
    allowed : iterable of str
    error : type, optional
        Class of the error.

    Raises
    ------
    SettingsError
        Or `error`, if `name` is not among the allowed ones.
    """
    names = list(allowed)
    for known in names:
        if known == name:
            return known
    raise error(unknown_name(kind, str(name), names))
