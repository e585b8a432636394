"""``brightgrey reproduce``: the experiment of the paper's section 4."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import CORES, Json, OutputFolder, Quiet, Seed, Workers
from brightgrey.cli.options.genetic import GeneticOptions
from brightgrey.cli.options.groups import with_options

__all__ = ["reproduce"]


@with_options
def reproduce(
    genetic: GeneticOptions,
    seeds: Annotated[int, typer.Option("--seeds", min=1, metavar="N", help="Number of seeds.")] = 1,
    seed: Seed = 0,
    workers: Workers = CORES,
    out: OutputFolder = Path("reproduction"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Repeat the paper's experiment: find a known two-mass drive by genetic programming.

    DIR receives figure6.png to figure9.png, as numbered in the paper, and the tables runs.csv, generations.csv and
    history.csv.
    """
    settings = genetic.settings()
    from brightgrey.cli.terminal import progress as live
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder

    check_folder(out)
    from brightgrey.paper.reproduction import reproduce as repeat

    with live.steps("reference drive", silent=quiet or json) as display:
        done = repeat(
            settings,
            seeds=seeds,
            seed=seed,
            workers=workers,
            progress=lambda number, step: display(step, f"seed {number}"),
        )
    done.write(out)
    show.reproduction(done, out, quiet=quiet, json=json)
