"""Options of a recording as texts: of the command line, of a fleet's manifest, of a recording.toml."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from brightgrey.errors import SettingsError

__all__ = [
    "LISTS",
    "NUMBERS",
    "TEXTS",
    "WHOLE_NUMBERS",
    "number",
    "numbers",
    "pairs",
    "reading_arguments",
    "units",
    "window",
]

LISTS = ("output", "unit", "rated", "counts", "gear", "shift", "beside")
"""Options that may be given several times."""
WHOLE_NUMBERS = ("decimate", "actuator")
NUMBERS = ("dt", "input_gain", *WHOLE_NUMBERS)
TEXTS = ("input", "time", "window", "hold", "torque_constant")
WINDOW = "A:B, two times in s"


def number(option: str, text: str, wanted: str) -> float:
    """Finite number; raises SettingsError that names `option` and what is `wanted`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SettingsError(f"{option}: '{text}' is not a number; expected {wanted}")
    return value


def pairs(option: str, texts: Iterable[str], wanted: str) -> dict[str, str]:
    """NAME=SOMETHING, each name once, else SettingsError. The last = divides: names of columns may hold one."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.rpartition("="))
        if not (equals and name and value):
            raise SettingsError(f"{option} '{text}': expected {wanted}")
        if name in pairs:
            raise SettingsError(f"{option} names '{name}' more than once")
        pairs[name] = value
    return pairs


def numbers(option: str, texts: Iterable[str], wanted: str) -> dict[str, float]:
    """Read an option of NAME=NUMBER."""
    return {name: number(f"{option} {name}", value, wanted) for name, value in pairs(option, texts, wanted).items()}


def units(texts: Iterable[str]) -> dict[str, str]:
    """Read ``--unit COLUMN=UNIT``."""
    return pairs("--unit", texts, "COLUMN=UNIT, the unit written like mm/s")


def window(text: str | None) -> tuple[float | None, float | None] | None:
    """Read ``--window A:B`` in s; a missing end is the recording's. Raises SettingsError."""
    if text is None:
        return None
    start, colon, end = (part.strip() for part in text.partition(":"))
    if not colon or not (start or end):
        raise SettingsError(f"--window '{text}': expected {WINDOW}")
    return (
        number("--window", start, WINDOW) if start else None,
        number("--window", end, WINDOW) if end else None,
    )


def reading_arguments(given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of :func:`brightgrey.read_recording` for options as texts and numbers; None is left out.

    Raises
    ------
    SettingsError
        For a text that cannot be read.
    """
    wanted = {name: value for name, value in given.items() if value is not None}
    read: dict[str, tuple[str, Callable[[Any], Any]]] = {
        "output": ("outputs", lambda value: value),
        "unit": ("units", units),
        "window": ("window", window),
        "rated": (
            "rated",
            lambda value: pairs("--rated", value, "NAME=VALUE with a unit, like 'torque=9.84 mN m'"),
        ),
        "counts": ("counts", lambda value: numbers("--counts", value, "COLUMN=N, increments per turn")),
        "gear": ("gear", lambda value: numbers("--gear", value, "COLUMN=RATIO")),
        "shift": ("shift", lambda value: numbers("--shift", value, "COLUMN=S, a time in s")),
    }
    arguments = {}
    for name, value in wanted.items():
        argument, reader = read.get(name, (name, lambda value: value))
        arguments[argument] = reader(value)
    return arguments
