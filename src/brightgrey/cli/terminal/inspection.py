"""Content of files in the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from brightgrey.cli.terminal.overview import plain_table
from brightgrey.cli.terminal.results import as_json, screen
from brightgrey.errors import printable

if TYPE_CHECKING:
    from brightgrey.api.inspection import Inspection

__all__ = ["show_inspections"]

MORE = ("over time", "reason")
NARROW = 90
"""Columns of a window that has no room for reasons and courses."""


def show_inspections(found: Sequence[Inspection], *, json: bool) -> None:
    """Print a table of channels for each file, and the command below it."""
    if json:
        as_json([_as_dict(inspection) for inspection in found])
        return
    for number, inspection in enumerate(found):
        if number:
            print()
        _show(inspection)


def _show(inspection: Inspection) -> None:
    console = screen()
    title = f"{Path(inspection.path).name}: {inspection.format}, {inspection.samples} samples"
    console.print(Text(printable(title), "bold"))
    narrow = console.width < NARROW
    table = plain_table("channel", "unit", "every >", "range", "holes", "might be", *([] if narrow else MORE))
    for row, channel in zip(inspection.rows(), inspection.channels, strict=True):
        *cells, reason = map(printable, row)
        more = [] if narrow else [channel.sparkline(), reason]
        table.add_row(*cells, *more, style="dim" if channel.constant else None)
    console.print(table)
    console.print()
    for text in (*inspection.why, *inspection.questions, *inspection.notes):
        console.print(Text(f"- {printable(text)}"))
    console.print()
    if inspection.command:
        console.print(Text(printable(inspection.command)), soft_wrap=True)  # one line, to be copied
    else:
        console.print(Text(printable(f"No command: {inspection.problem}")))


def _as_dict(inspection: Inspection) -> dict[str, Any]:
    """Return the content as plain data."""
    channels = [
        {
            "name": channel.name,
            "unit": channel.unit,
            "dt": channel.dt,
            "samples": channel.samples,
            "missing": channel.missing,
            "held": channel.held,
            "low": _finite(channel.low),
            "high": _finite(channel.high),
            "quantity": meaning.quantity,
            "role": meaning.role,
            "side": meaning.side,
            "reason": meaning.reason,
        }
        for channel, meaning in zip(inspection.channels, inspection.meanings, strict=True)
    ]
    return {
        "path": inspection.path,
        "format": inspection.format,
        "samples": inspection.samples,
        "channels": channels,
        "command": inspection.command,
        "why": list(inspection.why),
        "questions": list(inspection.questions),
        "notes": list(inspection.notes),
        "problem": inspection.problem,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
