"""``brightgrey fleet``: many axes with the same options."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from brightgrey.cli.options.common import Json, OutputFolder, Quiet
from brightgrey.cli.options.estimation import EstimationOptions
from brightgrey.cli.options.groups import with_options
from brightgrey.cli.options.recording import RecordingOptions
from brightgrey.cli.options.run import RunOptions
from brightgrey.cli.options.structure import SEARCHES, StructureOptions

if TYPE_CHECKING:
    from brightgrey.api.fleet.fleet import Fleet, Member

__all__ = ["fleet"]


@with_options
def fleet(
    manifest: Annotated[
        Path,
        typer.Argument(
            metavar="MANIFEST", help="CSV file with one row per axis, or TOML file with one table [[axis]] per axis."
        ),
    ],
    columns: RecordingOptions,
    structures: StructureOptions,
    estimation: EstimationOptions,
    run: RunOptions,
    out: OutputFolder = Path("fleet"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Identify many axes with the same options, and find those that differ from the others.

    Each axis has a folder in DIR and a row in DIR/summary.csv. The manifest may name the options of a recording for
    each axis; they replace those of the command line. An axis with an unusable recording does not stop the others. The
    same command continues an interrupted run. A budget counts for each axis.
    """
    from brightgrey.api.fleet.manifest import read_manifest
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder

    axes = read_manifest(manifest)
    check_folder(out)
    structure = structures.checked(tuple(name for name in SEARCHES if name != "genetic"))
    run.check(structure)
    arguments = estimation.arguments()
    from brightgrey.api.fleet.fleet import identify_fleet
    from brightgrey.cli.terminal.signals import stop_on_signal

    with stop_on_signal() as stop, run.workforce.executor() as executor:
        found = identify_fleet(
            axes,
            out,
            columns.read,
            structure,
            search=structures.search,
            grammar=structures.grammar,
            require=structures.require or (),
            exclude=structures.exclude or (),
            seed=run.seed,
            workers=run.workers,
            executor=executor,
            budget=run.budget,
            stop=stop,
            restart=run.restart,
            done=_announce(len(axes), silent=quiet or json),
            summary=show.text,
            check=not run.no_check,
            **arguments,
        )
    _show(found, out, quiet=quiet, json=json)
    stop.exit_with_signal()
    if all(m.model is None for m in found.members):
        first = found.members[0]
        typer.echo(f"brightgrey: no axis could be identified; {first.name}: {first.error}", err=True)
        raise typer.Exit(2)


def _announce(count: int, *, silent: bool) -> Callable[[Member], None]:
    """Callback that names each finished axis on a terminal's stderr."""
    from brightgrey.cli.terminal.results import screen

    console, number = screen(stderr=True), 0

    def announce(member: Member) -> None:
        nonlocal number
        number += 1
        if not silent and console.is_terminal:
            outcome = member.error or ("+".join(member.model.effects) if member.model else "")
            console.print(f"{number} of {count} {member.name}: {outcome}", soft_wrap=True)

    return announce


def _show(found: Fleet, folder: Path, *, quiet: bool, json: bool) -> None:
    from brightgrey.cli.terminal.overview import plain_table
    from brightgrey.cli.terminal.results import as_json, screen

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
    compared = f"{different} differ from the others" if found.quantities else "too few to say which one differs"
    console.print(f"{done} of {len(rows)} axes identified, {len(rows) - done} failed, {compared}")
    console.print(f"The table is in {folder / 'summary.csv'}", soft_wrap=True)
