"""Options that all commands share, and the reading of their texts."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.groups import OUTPUT, RECORDING, RUN
from brightgrey.errors import SettingsError
from brightgrey.option_texts import number, numbers, pairs

__all__ = [
    "CORES",
    "Json",
    "OutputFolder",
    "Quiet",
    "Seed",
    "Step",
    "Time",
    "Unit",
    "Verbose",
    "Workers",
    "bounds",
    "fixed",
]

CORES = os.cpu_count() or 1
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Print all verdicts, the certificate, the ranking.", rich_help_panel=OUTPUT),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.", rich_help_panel=OUTPUT)]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON instead of tables.", rich_help_panel=OUTPUT)
]


def _folder(text: str) -> Path:
    """Folder of ``--out``; an empty text would be the current one, by mistake."""
    if not text:
        raise typer.BadParameter("it is empty; name a folder, '.' for the current one")
    return Path(text)


OutputFolder = Annotated[Path, typer.Option("--out", metavar="DIR", parser=_folder, help="Folder for the results.")]
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
