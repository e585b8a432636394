"""Results in the terminal: compact, and useful without colour, when piped and in a narrow window."""

from __future__ import annotations

import io
import json as json_module
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from brightgrey.api.differences import ControlDifference
    from brightgrey.api.result import Result
    from brightgrey.api.resumable import StoredRun
    from brightgrey.api.simulation import Simulation
    from brightgrey.model.ranking import Row
    from brightgrey.paper.reproduction import Reproduction
    from brightgrey.report.text.tables import FitRow
    from brightgrey.search.evidence import Evidence

__all__ = [
    "as_json",
    "effects",
    "plain_table",
    "reproduction",
    "result",
    "screen",
    "simulation",
    "stored",
    "text",
    "working",
]

_TOP = 10  # structures of the ranking that are shown
_COMPARED = 3  # tied structures that are shown side by side
PIPED_WIDTH = 120  # nobody's window: wide enough that no row is folded


def screen(*, stderr: bool = False) -> Console:
    """Make a console that prints names of columns as they are, brackets and all."""
    stream = sys.stderr if stderr else sys.stdout
    given = os.environ.get("COLUMNS", "")
    wide = (not stream.isatty() and not given) or given == "0"  # a window without columns shows nothing
    return Console(stderr=stderr, width=PIPED_WIDTH if wide else None, markup=False, emoji=False, highlight=False)


@contextmanager
def working(what: str, *, silent: bool) -> Iterator[None]:
    """Show on a terminal's stderr that something is going on."""
    from brightgrey.cli.terminal.compilation import compile_kernel

    compile_kernel(silent=silent)
    console = screen(stderr=True)
    if silent or not sys.stderr.isatty():  # FORCE_COLOR makes a terminal of a pipe for rich, but nothing moves there
        yield
        return
    with console.status(Text(what)):
        yield


def as_json(value: Any) -> None:
    """Print `value` as JSON."""
    print(json_module.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


def stored(found: StoredRun, folder: Path, *, quiet: bool, json: bool) -> None:
    """Print the result of a run that has finished now or earlier."""
    if found.result is not None:
        result(found.result, folder, quiet=quiet, json=json)
        if found.stopped and not (quiet or json):
            screen().print("Stopped before the end: the same command goes on from here.")
    elif json:
        print(found.files["model.json"].decode(), end="")
    elif not quiet:
        screen().print(f"The run in {folder} was finished before; its result:", soft_wrap=True)
        print(found.summary, end="")


def text(found: Result, folder: Path) -> str:
    """Text that :func:`result` prints if the output is not a terminal."""
    out = io.StringIO()
    _print_result(Console(file=out, width=PIPED_WIDTH, markup=False, emoji=False, highlight=False), found, folder)
    return out.getvalue()


def result(found: Result, folder: Path, *, quiet: bool, json: bool) -> None:
    """Print parameters, fit, remarks and where the files are."""
    if quiet:
        return
    if json:
        print(found.model.text(), end="")
        return
    _print_result(screen(), found, folder)


def _print_result(console: Console, found: Result, folder: Path) -> None:
    from brightgrey.report.text.tables import FIXED, fit_rows, friction_width_text, parameter_rows, remarks, sentence

    console.print(Text(str(found.model.structure), style="bold"))
    rows = parameter_rows(found.model)
    noted = any(row.note for row in rows)
    table = plain_table("parameter", "estimate >", "unit", *(["note"] if noted else []))
    for row in rows:
        doubtful = row.note and row.note != FIXED
        cells = (row.name, row.estimate, row.unit, *([row.note] if noted else []))
        table.add_row(*cells, style="yellow" if doubtful else None)
    console.print(table)
    if found.model.structure.has_dry_friction:
        console.print(f"Friction reverses {friction_width_text(found.model.settings)}.")
    console.print()
    _fits(console, fit_rows(found.model))
    console.print()
    if found.evidence is not None:
        _evidence(console, found.evidence)
        _certificate(console, found.evidence)
        _top(console, found.ranking, found.front)
    _print_differences(console, found.differences)
    for symptom in found.symptoms:
        _bullet(console, f"{symptom.title}: {symptom.observation}; {symptom.advice}.")
    for text in (sentence(found.model.outcome.text), *remarks(found.model), *found.notes):
        _bullet(console, text)
    names = ", ".join(found.names)
    console.print(f"Results are in {folder}: {names}", soft_wrap=True)


def simulation(done: Simulation, file: Path | None, *, quiet: bool, json: bool) -> None:
    """Print the fit and where the samples are."""
    if quiet:
        return
    if json:
        as_json({name: fit.model_dump() for name, fit in done.fit.items()})
        return
    from brightgrey.report.text.tables import fit_row

    console = screen()
    console.print(Text(f"{done.model.structure} on {done.trace.name}", style="bold"))
    units = {signal.name: signal.unit for signal in done.trace.outputs}
    _fits(console, [fit_row(name, "", fit, units[name]) for name, fit in done.fit.items()])
    for note in done.notes:
        _bullet(console, note)
    if file:
        console.print(f"Samples are in {file}", soft_wrap=True)


def reproduction(done: Reproduction, folder: Path, *, quiet: bool, json: bool) -> None:
    """Print what each seed found, and the rates."""
    if quiet:
        return
    rates = done.summary
    if json:
        as_json(asdict(rates))
        return
    console = screen()
    table = plain_table("seed >", "best structure", "verdict", "true first in generation >", "simulations >")
    for row in done.repetitions:
        first = "-" if row.first is None else str(row.first)
        table.add_row(str(row.seed), row.best, row.best_verdict, first, str(row.simulations))
    console.print(table)
    console.print()
    _bullet(console, f"true structure {done.truth}: best in {_rate(rates.true, rates.count, rates.interval)}")
    either = rates.true + rates.extras
    _bullet(console, f"the same or with redundant extras: {_rate(either, rates.count, rates.lenient)}")
    _bullet(console, f"best of the last generation: {rates.last_true} of {rates.count}")
    first = "-" if rates.first is None else f"{rates.first:g}"
    _bullet(console, f"it was in {rates.seen} of {rates.count} runs at all, first in generation {first} (median)")
    _bullet(console, f"median number of simulations: {rates.simulations:.0f}")
    if any(run.interrupted for run in done.runs):
        _bullet(console, "interrupted: the best so far counts")
    console.print(f"Results are in {folder}: {', '.join(done.names)}", soft_wrap=True)


def _rate(count: int, of: int, interval: tuple[float, float]) -> str:
    low, high = (100.0 * end for end in interval)
    return f"{count} of {of} runs (95 % interval {low:.0f} to {high:.0f} %)"


def effects(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the function set."""
    console = screen()
    for row in rows:
        console.print(Text.assemble((row["name"], "bold"), f"  {row['title']}"))
        console.print(f"  {row['equation']}")
        table = Table(box=None, show_header=False, padding=(0, 1, 0, 2))
        for parameter in row["parameters"]:
            table.add_row(parameter["name"], parameter["unit"], parameter["about"])
        console.print(table)
        console.print()


def plain_table(*columns: str) -> Table:
    """Table without a frame; a column whose name ends in > is aligned to the right."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
    for column in columns:
        right = column.endswith(">")
        table.add_column(column.rstrip("> "), justify="right" if right else "left", overflow="fold")
    return table


def _fits(console: Console, rows: Sequence[FitRow]) -> None:
    """One row per output; `on` is left out where it says nothing."""
    several = any(row.on for row in rows)
    table = plain_table("output", *(["on"] if several else []), "fit/% >", "RMSE >", "unit")
    for row in rows:
        table.add_row(row.output, *([row.on] if several else []), row.fit_percent, row.rmse, row.unit)
    console.print(table)


def _evidence(console: Console, evidence: Evidence) -> None:
    """Verdict on every effect, and the minimal structures if there are several."""
    table = plain_table("effect", "verdict", "reason")
    styles = {"needed": "bold", "not decidable": "yellow"}
    for card in evidence.cards:
        table.add_row(card.effect, card.verdict, card.reason, style=styles.get(card.verdict))
    if evidence.cards:
        console.print(table)
        console.print()
    if len(evidence.minimal) > 1:
        names = "; ".join(str(j.structure) for j in evidence.minimal)
        _bullet(console, f"the recording cannot tell these minimal structures apart: {names}")
        console.print()


def _certificate(console: Console, evidence: Evidence) -> None:
    """Sentences of the certificate, the most important first."""
    titles = [(card.effect, card.title) for card in evidence.cards]
    for sentence in evidence.certificate.sentences(titles):
        _bullet(console, sentence)
    console.print()


def _print_differences(console: Console, tied: Sequence[ControlDifference]) -> None:
    """Print the differences for control between minimal structures."""
    shown = [d for d in tied if d.minimal][:_COMPARED]
    if len(shown) < 2:
        return
    table = plain_table("for control", *(str(d.structure) for d in shown))
    for k, (name, _) in enumerate(shown[0].rows):
        table.add_row(name, *(d.rows[k][1] for d in shown))
    console.print(table)
    console.print()


def _top(console: Console, ranking: Sequence[Row], front: Sequence[Row]) -> None:
    """The first structures of the ranking; `front` are those that none beats in error and number of parameters."""
    ahead = {row.structure for row in front}
    table = plain_table("rank >", "structure", "parameters >", "fit/% >", "BIC >", "tied", "front")
    for rank, row in enumerate(ranking[:_TOP], 1):
        value = "-" if row.criterion is None else f"{row.criterion:.1f}"
        cells = (
            str(row.n_parameters),
            f"{row.fit_percent:.3f}",
            value,
            "yes" if row.tied else "",
            "yes" if row.structure in ahead else "",
        )
        table.add_row(str(rank), row.structure, *cells)
    console.print(table)
    console.print()


def _bullet(console: Console, text: str) -> None:
    lines = wrap(text, max(console.width - 2, 1), break_long_words=False, break_on_hyphens=False)
    console.print("- " + "\n  ".join(lines), soft_wrap=True)
