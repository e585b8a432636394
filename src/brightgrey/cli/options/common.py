"""Options that all commands share, and the reading of their texts."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Annotated

import typer

from brightgrey.cli.options.groups import OUTPUT, RECORDING, RUN
from brightgrey.errors import SettingsError

__all__ = [
    "CORES",
    "Json",
    "Quiet",
    "Seed",
    "Step",
    "Time",
    "Unit",
    "Workers",
    "bounds",
    "fixed",
    "number",
    "numbers",
    "pairs",
    "units",
    "window",
]

CORES = os.cpu_count() or 1
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.", rich_help_panel=OUTPUT)]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON instead of tables.", rich_help_panel=OUTPUT)
]
Seed = Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Seed of all random draws.", rich_help_panel=RUN)]
Workers = Annotated[
    int,
    typer.Option(
        "--workers",
        min=1,
        metavar="N",
        help="Threads of the simulation; the result does not depend on their number.",
        rich_help_panel=RUN,
    ),
]
Time = Annotated[
    str | None, typer.Option("--time", metavar="NAME", help="Column of the time; found by its name if not given.")
]
Unit = Annotated[
    list[str] | None, typer.Option("--unit", metavar="COLUMN=UNIT", help="Unit of a column. Repeat for more.")
]
Step = Annotated[
    float | None,
    typer.Option(
        "--dt", metavar="S", help="Sampling time in s, if there is no column of time.", rich_help_panel=RECORDING
    ),
]

BOUND = "NAME=LOW:HIGH in the recording's units, or 'NAME=LOW%:HIGH% of VALUE'"
FIX = "NAME=VALUE, a number in the recording's units"
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


def bounds(texts: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Read ``--bound NAME=LOW:HIGH``, or ``NAME=LOW%:HIGH% of VALUE``, in the recording's units; SettingsError."""
    out = {}
    for name, value in pairs("--bound", texts, BOUND).items():
        where = f"--bound {name}"
        ends, of, assumed = (part.strip() for part in value.partition(" of "))
        low, colon, high = (part.strip() for part in ends.partition(":"))
        relative = low.endswith("%") and high.endswith("%")
        if not colon or bool(of) != relative or "%" in (low + high).replace("%", "", 2 * relative):
            raise SettingsError(f"--bound '{name}={value}': expected {BOUND}")
        if relative:
            unit = number(where, assumed, BOUND) / 100.0
            pair = [number(where, end.removesuffix("%"), BOUND) * unit for end in (low, high)]
            out[name] = (min(pair), max(pair)) if unit < 0.0 else (pair[0], pair[1])
        else:
            out[name] = (number(where, low, BOUND), number(where, high, BOUND))
    return out


def fixed(texts: Iterable[str]) -> dict[str, float]:
    """Read ``--fix NAME=VALUE``, in the recording's units."""
    return numbers("--fix", texts, FIX)


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
