"""``brightgrey fleet``: many axes with the same options."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brightgrey.cli import identify as one
from brightgrey.cli.options import common as options
from brightgrey.cli.options.common import (
    CORES,
    Dask,
    Json,
    MaxEvaluations,
    MaxSeconds,
    Processes,
    Quiet,
    Restart,
    Seed,
    Step,
    Time,
    Unit,
    Workers,
)
from brightgrey.errors import SettingsError

if TYPE_CHECKING:
    from brightgrey.api.fleet.fleet import Fleet, Member
    from brightgrey.recordings import Recording

__all__ = ["fleet"]

SEARCHES = ("auto", "exhaustive")
Manifest = Annotated[
    Path,
    typer.Argument(metavar="MANIFEST", help="CSV with a row, or TOML with a table [[axis]], for each axis."),
]
Input = Annotated[str | None, typer.Option("--input", metavar="NAME", help="Column of the input.")]
Output = Annotated[
    list[str] | None, typer.Option("--output", metavar="NAME[:KIND]", help="Measured column. May be repeated.")
]
Search = Annotated[
    str | None, typer.Option("--search", metavar="auto|exhaustive", help="How structures are searched for.")
]


def fleet(
    manifest: Manifest,
    input: Input = None,
    output: Output = None,
    structure: one.StructureOption = None,
    search: Search = None,
    require: one.Require = None,
    exclude: one.Exclude = None,
    time: Time = None,
    dt: Step = None,
    input_gain: one.Gain = 1.0,
    unit: Unit = None,
    window: one.Window = None,
    decimate: one.Decimate = 1,
    hold: one.Hold = "linear",
    bound: one.Bound = None,
    fix: one.Fix = None,
    f_tanh: one.Sharpness = None,
    initial: one.Begin = "auto",
    seed: Seed = 0,
    workers: Workers = CORES,
    processes: Processes = False,
    dask: Dask = None,
    max_evaluations: MaxEvaluations = None,
    max_seconds: MaxSeconds = None,
    restart: Restart = False,
    out: one.Out = Path("fleet"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Identify many axes with the same options, and say which of them differs from its siblings.

    Each axis gets a folder in DIR and a row in DIR/summary.csv. What a row of the manifest says about its columns goes
    before the options here. A recording that cannot be used stops nothing; the same command goes on after an
    interruption. Budgets are those of each axis.
    """
    from brightgrey.api.fleet.manifest import read_manifest
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder

    axes = read_manifest(manifest)
    check_folder(out)
    chosen = one.checked_structure(structure, search, (*(require or ()), *(exclude or ())), SEARCHES)
    one.check_for_search(chosen, processes, dask, max_evaluations, max_seconds)
    wanted: dict[str, Any] = {"bounds": options.bounds(bound or ()), "fixed": options.fixed(fix or ())}
    read = _reader(
        {
            "input": input,
            "output": output,
            "time": time,
            "dt": dt,
            "input_gain": input_gain,
            "unit": unit,
            "window": window,
            "decimate": decimate,
            "hold": hold,
        }
    )
    from brightgrey.api.fleet.fleet import identify_fleet
    from brightgrey.cli.terminal.signals import signals
    from brightgrey.estimation.problem.initial_state import check_initial
    from brightgrey.runs import Budget, Workforce

    workforce, budget = Workforce(workers, processes, dask), Budget(max_evaluations, max_seconds)
    with signals() as stop, workforce.executor() as executor:
        found = identify_fleet(
            axes,
            out,
            read,
            chosen,
            **wanted,
            search=search,
            require=require or (),
            exclude=exclude or (),
            f_tanh=f_tanh,
            initial=check_initial(initial),
            seed=seed,
            workers=workers,
            executor=executor,
            budget=budget,
            stop=stop,
            restart=restart,
            done=_teller(len(axes), silent=quiet or json),
            summary=show.text,
        )
    _show(found, out, quiet=quiet, json=json)
    if stop.told:
        stop.leave()
    if all(m.model is None for m in found.members):
        raise typer.Exit(2)


def _reader(given: Mapping[str, Any]) -> Callable[[Path, Mapping[str, Any]], Recording]:
    """Reads a recording with the options of its axis, and those `given` where it has none."""
    from brightgrey.recordings import read_recording
    from brightgrey.recordings.recording import check_hold

    def read(path: Path, own: Mapping[str, Any]) -> Recording:
        asked = {**given, **own}
        for name in ("input", "output"):
            if not asked[name]:
                raise SettingsError(f"{path}: neither the manifest nor --{name} says which column is the {name}")
        return read_recording(
            path,
            input=asked["input"],
            outputs=asked["output"],
            time=asked["time"],
            dt=asked["dt"],
            input_gain=asked["input_gain"],
            units=options.units(asked["unit"] or ()),
            window=options.window(asked["window"]),
            decimate=asked["decimate"],
            hold=check_hold(asked["hold"]),
        )

    return read


def _teller(count: int, *, silent: bool) -> Callable[[Member], None]:
    """Says on a terminal's stderr which axis is done."""
    from brightgrey.cli.terminal.results import screen

    console, number = screen(stderr=True), 0

    def tell(member: Member) -> None:
        nonlocal number
        number += 1
        if not silent and console.is_terminal:
            said = member.error or ("+".join(member.model.effects) if member.model else "")
            console.print(f"{number} of {count} {member.name}: {said}", soft_wrap=True)

    return tell


def _show(found: Fleet, folder: Path, *, quiet: bool, json: bool) -> None:
    from brightgrey.cli.terminal.results import as_json, plain_table, screen

    rows = [
        {
            "name": m.name,
            "structure": None if m.model is None else "+".join(m.model.effects),
            "stopped": m.stopped,
            "differs": list(m.differs),
            "error": m.error,
        }
        for m in found.members
    ]
    if json:
        as_json(rows)
        return
    if quiet:
        return
    console = screen()
    table = plain_table("axis", "structure", "differs from its siblings", "error")
    for m, row in zip(found.members, rows, strict=True):
        style = "bold" if m.differs else "yellow" if m.error else None
        table.add_row(m.name, str(row["structure"] or "-"), "; ".join(m.differs), m.error or "", style=style)
    console.print(table)
    console.print()
    done = sum(m.model is not None for m in found.members)
    different = sum(bool(m.differs) for m in found.members)
    console.print(
        f"{done} of {len(rows)} axes identified, {len(rows) - done} failed, {different} differ from the others"
    )
    console.print(f"The table is in {folder / 'summary.csv'}", soft_wrap=True)
