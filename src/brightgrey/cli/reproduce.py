"""``brightgrey reproduce``: the experiment of the paper's section 4."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options import genetic
from brightgrey.cli.options.common import CORES, Json, Quiet, Seed, Workers

__all__ = ["reproduce"]


def reproduce(
    seeds: Annotated[int, typer.Option("--seeds", min=1, metavar="N", help="Number of seeds.")] = 1,
    preset: genetic.Preset = "paper",
    population: genetic.Population = None,
    generations: genetic.Generations = None,
    iterations: genetic.Iterations = None,
    estimator: genetic.Estimator = None,
    criterion: genetic.CriterionName = None,
    p_clone: genetic.Clone = None,
    k_p: genetic.Kp = None,
    mutation: genetic.Mutation = None,
    elite: genetic.Elite = None,
    max_remutations: genetic.MaxRemutations = None,
    neighbours: genetic.Neighbours = None,
    seed: Seed = 0,
    workers: Workers = CORES,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = Path("reproduction"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Repeat the paper's experiment: find a known two-mass drive by genetic programming.

    Writes figure6.png to figure9.png, as numbered in the paper, and the tables runs.csv, generations.csv and
    history.csv to DIR.
    """
    chosen = genetic.genetic_settings(
        preset,
        mutation,
        population=population,
        generations=generations,
        iterations=iterations,
        estimator=estimator,
        criterion=criterion,
        p_clone=p_clone,
        k_p=k_p,
        elite=elite,
        max_remutations=max_remutations,
        n_neighbours=neighbours,
    )
    from brightgrey.cli.terminal import progress as live
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder

    check_folder(out)
    from brightgrey.paper.reproduction import reproduce as repeat

    with live.steps("reference drive", silent=quiet or json) as display:
        done = repeat(
            chosen,
            seeds=seeds,
            seed=seed,
            workers=workers,
            progress=lambda number, step: display(step, f"seed {number}"),
        )
    done.write(out)
    show.reproduction(done, out, quiet=quiet, json=json)
