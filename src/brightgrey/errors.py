"""Errors that a user can act on: what came, what is allowed, the nearest right name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["BrightgreyError", "RecordingError", "SettingsError", "StructureError", "nearest", "unknown_name"]


class BrightgreyError(ValueError):
    """Wrong use or unusable input. The message is one line that says what to change."""


class StructureError(BrightgreyError):
    """A structure that names an unknown effect or breaks a rule of its grammar."""


class RecordingError(BrightgreyError):
    """A recording that cannot be read or used; names file, column and row where there are any."""


class SettingsError(BrightgreyError):
    """A bound, parameter value or option outside of what is allowed."""


def nearest(name: str, allowed: Iterable[str]) -> str | None:
    """Name in `allowed` that looks most like `name`, or None if nothing comes close."""
    names = list(allowed)
    folded = {candidate.casefold(): candidate for candidate in names}
    close = difflib.get_close_matches(name.casefold(), list(folded), n=1, cutoff=0.5)
    return folded[close[0]] if close else None


def unknown_name(kind: str, name: str, allowed: Iterable[str]) -> str:
    """One line that says which `kind` is unknown, the nearest right name and all allowed ones."""
    names = list(allowed)
    guess = nearest(name, names)
    hint = f" Did you mean '{guess}'?" if guess else ""
    return f"unknown {kind} '{name}'.{hint} Allowed: {', '.join(names)}"
