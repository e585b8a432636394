"""Result of a self-test in the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from brightgrey.cli.terminal.overview import plain_table
from brightgrey.cli.terminal.results import as_json, screen, sentences
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words, structure_in_words

if TYPE_CHECKING:
    from brightgrey.self_test.schema import SelfTest, SimulatedDrivePart

__all__ = ["self_test"]


def self_test(found: SelfTest, folder: Path, *, quiet: bool, json: bool) -> None:
    """Print the counts and sentences of a self-test."""
    if json:
        as_json(found.model_dump(mode="json"))
        return
    if quiet:
        return
    console = screen()
    if found.verdicts:
        _drives(console, found)
        _verdicts(console, found)
    if found.found.parameters:
        _parameter_table(console, found.found)
    sentences(found.sentences)
    console.print(f"Results are in {folder}: selftest.json, report.html", soft_wrap=True)


def _drives(console: Console, found: SelfTest) -> None:
    table = plain_table("simulated drive", "structure again", "among minimal", "effect noticed")
    for drive in found.drives:
        size = ", ".join(f"{name} = {part.value:.3g} {part.unit}" for name, part in drive.size.items())
        about = {
            "found": "the found model",
            "equivalent": f"equivalent: {structure_in_words(Structure.parse(drive.structure))}",
            "with effect": f"with {effect_in_words(Placed.parse(drive.effect)) if drive.effect else ''}, {size}",
        }[drive.kind]
        table.add_row(about, str(drive.found_again), str(drive.among_minimal), str(drive.noticed or ""))
    console.print(table)
    console.print()


def _verdicts(console: Console, found: SelfTest) -> None:
    table = plain_table("effect", "verdict", "the same again")
    for effect, verdict in found.verdicts.items():
        count = found.stable[effect]
        table.add_row(
            effect_in_words(Placed.parse(effect)),
            verdict,
            str(count),
            style="yellow" if count.hits < count.of else None,
        )
    console.print(table)
    console.print()


def _parameter_table(console: Console, drive: SimulatedDrivePart) -> None:
    table = plain_table("parameter", "simulated", "unit", "in the 95 % interval", "mean error/std", "spread")
    for name, part in drive.parameters.items():
        mean = "" if part.mean_error is None else f"{part.mean_error:+.2f}"
        spread = "" if part.spread is None else f"{part.spread:.2f}"
        table.add_row(name, f"{part.value:.5g}", part.unit, str(part.covered), mean, spread)
    console.print(table)
    console.print()
