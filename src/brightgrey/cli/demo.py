"""``brightgrey demo``: the paper's experiment on the recording that ships with the package."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import typer

from brightgrey.cli.options.common import CORES, Json, OutputFolder, Quiet, Seed, Verbose, Workers
from brightgrey.cli.options.given_command import given

__all__ = ["demo"]


def demo(
    context: typer.Context,
    out: OutputFolder = Path("demo"),
    seed: Seed = 0,
    workers: Workers = CORES,
    verbose: Verbose = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Identify the drive of the recording that ships with brightgrey.

    Writes report.html, model.json, ranking.csv, fit.svg, run.json and recording.csv to DIR.
    """
    from brightgrey.cli.terminal import progress as live
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder

    check_folder(out)
    from brightgrey.api.demo import demo as identify_demo

    with live.steps("demo", silent=quiet or json) as display:
        result = identify_demo(seed=seed, workers=workers, progress=lambda step: display(step, "demo"))
        result = replace(result, request=given(context))
        result.write(out)
    show.result(result, out, quiet=quiet, json=json, verbose=verbose)
    if result.stopped:
        raise typer.Exit(130)
