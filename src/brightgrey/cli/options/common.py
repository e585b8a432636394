"""Options that several commands share, and from their texts to values.

Every refusal says what came and what is wanted.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Annotated

import typer

from brightgrey.errors import SettingsError

__all__ = [
    "CORES",
    "Dask",
    "Json",
    "MaxEvaluations",
    "MaxSeconds",
    "Processes",
    "Quiet",
    "Restart",
    "Seed",
    "Step",
    "Time",
    "Unit",
    "Workers",
    "bounds",
    "fixed",
    "number",
    "pairs",
    "units",
    "window",
]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of tables.")]
Seed = Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Seed of all random draws.")]
CORES = os.cpu_count() or 1
Workers = Annotated[
    int,
    typer.Option("--workers", min=1, metavar="N", help="Threads to simulate on. Results do not depend on it."),
]
Processes = Annotated[
    bool, typer.Option("--processes", help="Evaluate in processes of this machine instead of threads.")
]
Dask = Annotated[
    str | None,
    typer.Option("--dask", metavar="ADDRESS", help="Evaluate on the workers of the Dask scheduler at host:port."),
]
MaxEvaluations = Annotated[
    int | None,
    typer.Option(
        "--max-evaluations",
        metavar="N",
        help="Stop a search after so many evaluations in all, with the best so far; the same command goes on.",
    ),
]
MaxSeconds = Annotated[
    float | None,
    typer.Option("--max-seconds", metavar="S", help="Stop a search after so long, with the best so far."),
]
Restart = Annotated[bool, typer.Option("--restart", help="Forget the run that DIR holds, and begin anew.")]
Time = Annotated[
    str | None, typer.Option("--time", metavar="NAME", help="Column of time. Found where its name says it.")
]
Step = Annotated[
    float | None, typer.Option("--dt", metavar="S", help="Sampling time in s, where no column has the time.")
]
Unit = Annotated[
    list[str] | None,
    typer.Option("--unit", metavar="COLUMN=UNIT", help="Unit of a column. May be repeated."),
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
        raise SettingsError(f"{option}: '{text}' is not a number; wanted is {wanted}")
    return value


def pairs(option: str, texts: Iterable[str], wanted: str) -> dict[str, str]:
    """NAME=SOMETHING, each name once, else SettingsError. The last = divides: names of columns may hold one."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.rpartition("="))
        if not (equals and name and value):
            raise SettingsError(f"{option} '{text}': wanted is {wanted}")
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
            raise SettingsError(f"--bound '{name}={value}': wanted is {BOUND}")
        if relative:
            unit = number(where, assumed, BOUND) / 100.0
            pair = [number(where, end.removesuffix("%"), BOUND) * unit for end in (low, high)]
            out[name] = (min(pair), max(pair)) if unit < 0.0 else (pair[0], pair[1])
        else:
            out[name] = (number(where, low, BOUND), number(where, high, BOUND))
    return out


def fixed(texts: Iterable[str]) -> dict[str, float]:
    """Read ``--fix NAME=VALUE``, in the recording's units."""
    return {name: number(f"--fix {name}", value, FIX) for name, value in pairs("--fix", texts, FIX).items()}


def units(texts: Iterable[str]) -> dict[str, str]:
    """Read ``--unit COLUMN=UNIT``."""
    return pairs("--unit", texts, "COLUMN=UNIT, the unit written like mm/s")


def window(text: str | None) -> tuple[float | None, float | None] | None:
    """Read ``--window A:B`` in s; a missing end is the recording's. Raises SettingsError."""
    if text is None:
        return None
    start, colon, end = (part.strip() for part in text.partition(":"))
    if not colon or not (start or end):
        raise SettingsError(f"--window '{text}': wanted is {WINDOW}")
    return (
        number("--window", start, WINDOW) if start else None,
        number("--window", end, WINDOW) if end else None,
    )
