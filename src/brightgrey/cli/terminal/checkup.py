"""Checks of recordings in the terminal."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from brightgrey.cli.terminal.overview import plain_table
from brightgrey.cli.terminal.results import as_json, screen
from brightgrey.errors import printable

if TYPE_CHECKING:
    from brightgrey.recordings.checks.checkup import Checkup

__all__ = ["show_checkup"]


def show_checkup(found: Checkup, written: Path | None, *, everything: bool, quiet: bool, json: bool) -> None:
    """Print a row for each result, the gravest first, and below them what to do."""
    if json:
        as_json({"grade": found.grade, "results": [asdict(r) for r in found.results]})
        return
    if quiet:
        return
    console = screen()
    shown = found.results if everything else found.of_grade("stop", "mind", "note")
    if shown:
        table = plain_table("grade", "check", "figure")
        for result in shown:
            style = {"stop": "bold", "passed": "dim"}.get(result.grade)
            table.add_row(result.grade, result.check, printable(result.figure or result.sentence), style=style)
        console.print(table)
        console.print()
    for result in shown:
        if result.sentence and result.figure:
            console.print(Text(f"- {printable(result.text)}"))
    counts = {grade: len(found.of_grade(grade)) for grade in ("stop", "mind", "note", "passed")}
    console.print(Text(", ".join(f"{n} {grade}" for grade, n in counts.items())))
    if written:
        console.print(Text(f"Wrote {written}: brightgrey identify {written}"), soft_wrap=True)
