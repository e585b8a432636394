"""``brightgrey export``: a model in the form of another tool, compared with the native simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import Json, OutputFolder, Quiet, Step, Time, Unit
from brightgrey.option_texts import units

__all__ = ["export"]


def export(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model.json of an identification.")],
    to: Annotated[
        list[str],
        typer.Option(
            "--to",
            metavar="NAME",
            help="c, fmu, matlab, control, modelica or latex. May be repeated.",
            show_default=False,
        ),
    ],
    recording: Annotated[
        Path | None,
        typer.Option("--recording", metavar="FILE", help="Compare on the input of this recording."),
    ] = None,
    time: Time = None,
    dt: Step = None,
    unit: Unit = None,
    out: OutputFolder = Path("export"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a model for another tool, run that tool on it, and print how far it is from the native simulation.

    Without a recording both are run on a test input. The exit code is 1 where an export deviates more than it should.
    """
    given = units(unit or ())
    from brightgrey.cli.terminal import results as show
    from brightgrey.exports.registry import export as export_model
    from brightgrey.exports.registry import exporter
    from brightgrey.model.files import check_folder
    from brightgrey.model.model import load_model

    check_folder(out)
    for name in to:
        exporter(name)
    loaded = load_model(model)
    from brightgrey.api.simulation import read_for

    measured = read_for(loaded, recording, time=time, dt=dt, units=given) if recording else None
    done = []
    for name in to:
        with show.working(f"exporting to {name}", silent=quiet or json):
            done.append(export_model(loaded, name, out, measured))
        if not (quiet or json):
            typer.echo(f"{name}: {', '.join(str(file) for file in done[-1].files)}\n    {done[-1].text}")
    if json:
        show.as_json(
            [
                {
                    "to": e.to,
                    "files": [str(f) for f in e.files],
                    "deviation": e.deviation,
                    "good": e.good,
                    "text": e.text,
                }
                for e in done
            ]
        )
    if not all(e.good for e in done):
        raise typer.Exit(1)
