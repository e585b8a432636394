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
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from brightgrey.cli.terminal.overview import SCREEN, folded, plain_table, print_overview
from brightgrey.kit.in_words import structure_in_words
from brightgrey.kit.structure import Structure

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
    "reproduction",
    "result",
    "screen",
    "sentences",
    "simulation",
    "stored",
    "text",
    "working",
]

_TOP = 10  # structures of the ranking that are shown
_COMPARED = 3  # tied structures that are shown side by side
PART = "\f"
"""Mark between the parts of a stored text: brief, details, files."""
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


def stored(found: StoredRun, folder: Path, *, quiet: bool, json: bool, verbose: bool) -> None:
    """Print the result of a run that has finished now or earlier."""
    if found.result is not None:
        result(found.result, folder, quiet=quiet, json=json, verbose=verbose)
        if found.stopped and not (quiet or json):
            screen().print("Stopped before the end: the same command goes on from here.")
    elif json:
        print(found.files["model.json"].decode(), end="")
    elif not quiet:
        screen().print(f"The run in {folder} was finished before; its result:", soft_wrap=True)
        brief, _, rest = found.summary.partition(PART)  # empty if the run was made from Python
        details, _, files = rest.partition(PART)
        print(brief + (details if verbose else "") + files, end="")


def text(found: Result, folder: Path) -> str:
    """Text that :func:`result` prints if the output is not a terminal: brief part, details and files, by `PART`."""
    out = io.StringIO()
    console = Console(file=out, width=PIPED_WIDTH, markup=False, emoji=False, highlight=False)
    more = print_overview(console, found)
    out.write(PART)
    _print_details(console, found, more)
    out.write(PART)
    _print_files(console, found, folder)
    return out.getvalue()


def result(found: Result, folder: Path, *, quiet: bool, json: bool, verbose: bool) -> None:
    """Print what was found, how well it fits and where the files are; with `verbose` all verdicts, too."""
    if quiet:
        return
    if json:
        print(found.model.text(), end="")
        return
    console = screen()
    more = print_overview(console, found)
    if verbose:
        _print_details(console, found, more)
    _print_files(console, found, folder)


def _print_details(console: Console, found: Result, more: Sequence[str]) -> None:
    """Print `more` things to mind, fits, verdicts, the certificate, the ranking and what differs for control."""
    from brightgrey.report.text.tables import fit_rows

    for text in more:
        console.print(text, soft_wrap=True)
    console.print()
    _fits(console, fit_rows(found.model))
    console.print()
    if found.evidence is not None:
        _verdict_table(console, found.evidence)
        for sentence in found.evidence.certificate.sentences():
            _bullet(console, sentence)
        console.print()
        _top(console, found.ranking, found.front)
    _print_differences(console, found.differences)
    _bullet(console, f"The structure in commands: {found.model.structure}")


def _print_files(console: Console, found: Result, folder: Path) -> None:
    console.print(f"Results are in {folder}: {', '.join(found.names)}", soft_wrap=True)


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
    """Print the function set; a terminal shows the symbol of each effect, too."""
    from brightgrey.cli.terminal.symbol_sketch import effect_sketch

    console = screen()
    for row in rows:
        console.print(Text.assemble((row["name"], "bold"), f"  {row['title']}"))
        table = Table(box=None, show_header=False, padding=(0, 2, 0, 0), pad_edge=False)
        for parameter in row["parameters"]:
            table.add_row(parameter["name"], parameter["unit"], parameter["about"])
        lines = effect_sketch(row["name"]) if sys.stdout.isatty() else []
        width = max(map(len, lines), default=0)
        sketch = Text("\n".join(lines) if width <= console.width else "", style="cyan")
        beside = Table.grid(padding=(0, 2, 0, 0))
        if SCREEN.beside < width <= console.width:
            console.print(sketch)
        beside.add_row(sketch if width <= SCREEN.beside else "", Group(row["equation"], table))
        console.print(beside)
        console.print()


def _fits(console: Console, rows: Sequence[FitRow]) -> None:
    """One row per output; the recording is left out where it says nothing."""
    several = any(row.on for row in rows)
    table = plain_table("output", *(["recording"] if several else []), "fit/% >", "RMSE >", "unit")
    for row in rows:
        table.add_row(row.output, *([row.recording] if several else []), row.fit_percent, row.rmse, row.unit)
    console.print(table)


def _verdict_table(console: Console, evidence: Evidence) -> None:
    """Verdict on every effect, and the minimal structures if there are several."""
    from brightgrey.report.text.prose import left_out_in_words

    table = plain_table("effect", "verdict", "reason")
    styles = {"needed": "bold", "not decidable": "yellow"}
    for card in evidence.cards:
        table.add_row(card.title, card.verdict, card.reason, style=styles.get(card.verdict))
    if evidence.cards:
        console.print(table)
        console.print()
    if len(evidence.minimal) > 1:
        _bullet(console, "The recording cannot tell these minimal structures apart:")
        for one in evidence.minimal:
            left_out = left_out_in_words(evidence.left_out.get(one.structure, ()))
            _bullet(console, f"{structure_in_words(one.structure)}{f' ({left_out})' if left_out else ''}")
        console.print()
    elif any(evidence.left_out.values()):
        _bullet(console, f"The model {left_out_in_words(evidence.left_out[evidence.first.structure])}.")
        console.print()


def _print_differences(console: Console, tied: Sequence[ControlDifference]) -> None:
    """Print the differences for control between the structure of the model and minimal ones."""
    shown = [*tied[:1], *(d for d in tied[1:] if d.minimal)][:_COMPARED]
    if len(shown) < 2:
        return
    table = plain_table("for control", *(structure_in_words(d.structure) for d in shown))
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
        table.add_row(str(rank), structure_in_words(Structure.parse(row.structure)), *cells)
    console.print(table)
    console.print()


def sentences(texts: Sequence[str]) -> None:
    """Print sentences as items, folded to the window."""
    console = screen()
    for text in texts:
        _bullet(console, text)


def _bullet(console: Console, text: str) -> None:
    console.print(folded(text, console.width, "- "), soft_wrap=True)
