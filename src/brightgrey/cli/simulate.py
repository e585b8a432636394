"""``brightgrey simulate``: a model on a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import Json, Quiet, Step, Time, Unit
from brightgrey.option_texts import units

__all__ = ["simulate"]


def simulate(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model.json of an identification.")],
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording in any format.")],
    time: Time = None,
    dt: Step = None,
    unit: Unit = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write time, input, measured and simulated outputs as CSV."),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate a model with the input of a recording and compare.

    Names, kinds, units and gain of the columns are the model's.
    """
    given = units(unit or ())
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_file, write_file
    from brightgrey.model.model import load_model

    if out:
        check_file(out)
    loaded = load_model(model)
    from brightgrey.api.simulation import read_for
    from brightgrey.api.simulation import simulate as simulate_model

    measured = read_for(loaded, recording, time=time, dt=dt, units=given)
    with show.working("simulating", silent=quiet or json):
        simulation = simulate_model(loaded, measured)
        if out:
            write_file(out, simulation.trace.csv_text().encode())
    show.simulation(simulation, out, quiet=quiet, json=json)
