"""Genetic programming beside the border search, over the function set `drive`: more than a million structures.

    python bench/genetic_border.py run 0 50 --seed 161
    python bench/genetic_border.py table --seed 161 --save

Drives have one to four masses and two to six effects of all kinds, as in ``bench/recovery.py --truths drive``. Both
searches get the same recording with 1 % noise and nothing else. *Right*: the structure that comes first is the drive's
own, or lacks nothing that matters. What matters is told by the same table of fits for both. *Within the drive*: the
structure has nothing that the drive has not, whatever it lacks. *Covered*: one of the minimal structures is within the
drive, and lacks optional effects alone. Simulations are parameter sets that were simulated.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from brightgrey.api.to_si import identification_task
from brightgrey.estimation.problem import simulation_error
from brightgrey.kit import PAPER, Structure, grammar_named
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.decision import decide_structures
from brightgrey.search.genetic import genetic_search
from brightgrey.search.genetic.settings import TUNED_SETTINGS
from brightgrey.search.lattice import added_effects, contains
from recovery import MATTERS, row
from support.drives import RandomDrive, drawn_structure
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, drives_left, read_rows, row_arguments
from support.statistics import share

NOISE = 0.01
DRIVE = grammar_named("drive")


@contextmanager
def counted() -> Iterator[list[int]]:
    """Parameter sets that are simulated on a recording in the meantime, one number per call."""
    sets: list[int] = []
    simulate = simulation_error.predict_many

    def noted(structure: Structure, values: Mapping[str, np.ndarray], *others, **options):
        sets.append(len(next(iter(values.values()))))
        return simulate(structure, values, *others, **options)

    simulation_error.predict_many = noted
    try:
        yield sets
    finally:
        simulation_error.predict_many = simulate


def both(drive: RandomDrive, pool: ThreadPoolExecutor) -> dict[str, object]:
    """One row of the file: what each of the searches finds, and what it takes."""
    train, test = drive.recordings(NOISE)
    task = identification_task([train], None, {}, {}, None)
    begin = time.process_time()
    with counted() as of_border:
        found = decide_structures(task, DRIVE, seed=drive.seed, executor=pool)
    middle = time.process_time()
    with counted() as of_genetic:
        run = genetic_search(task, TUNED_SETTINGS, drive.seed, executor=pool, grammar=DRIVE)
    seconds = middle - begin, time.process_time() - middle
    known = row(drive, NOISE, task, found, test, pool)
    best = found.evidence.minimal[0].structure, run.best.job.structure
    tried = {e.job.structure for e in run.evaluations}
    return {
        **{name: known[name] for name in ("code", "seed", "number", "noise", "truth", "matters", "covered", "minimal")},
        "border": outcome(drive.truth, best[0], known["matters"], sum(of_border), seconds[0]),
        "genetic": outcome(drive.truth, best[1], known["matters"], sum(of_genetic), seconds[1]),
        "tried": len(tried),
        "truth tried": drive.truth in tried,
    }


def outcome(truth: Structure, found: Structure, matters: Mapping[str, float], simulations: int, seconds: float) -> dict:
    """Structure that comes first, whether it is right, and what it took."""
    within = contains(truth, found)
    lacking = added_effects(truth, found) if within else ()
    right = within and all(matters.get(name, 0.0) <= MATTERS for name in lacking)
    return {
        "first": str(found),
        "within": within,
        "right": right,
        "simulations": simulations,
        "seconds": round(seconds, 1),
    }


def line(r: Mapping) -> str:
    """One drive in words."""
    said = (
        f"{how} {r[how]['first']} ({'right' if r[how]['right'] else 'within' if r[how]['within'] else 'wrong'},"
        f" {r[how]['simulations']:,} simulations, {r[how]['seconds']} s)"
        for how in ("border", "genetic")
    )
    return f"{r['number']:4d} {r['truth']}: {'; '.join(said)}"


def table(rows: Sequence[Mapping]) -> Table:
    """Both searches side by side."""
    cells = []
    for how, name in (("border", "border search"), ("genetic", "genetic programming, preset `tuned`")):
        some = [r[how] for r in rows]
        cells.append(
            [
                name,
                *(share(sum(r[kind] for r in some), len(some), percent=True) for kind in ("right", "within")),
                share(sum(r["covered"] for r in rows), len(rows), percent=True) if how == "border" else "-",
                f"{np.median([r['simulations'] for r in some]):,.0f}",
                f"{np.mean([r['seconds'] for r in some]):.0f}",
            ]
        )
    columns = ["search", "first structure right", "within the drive", "covered", "simulations, median", "CPU s, mean"]
    return Table("Both searches over the function set `drive`", columns, cells)


def main() -> None:
    limit_blas_threads()
    parser = row_arguments(__doc__, last=50, seed=161)
    options = parser.parse_args()
    path = RESULTS / f"genetic_border_seed{options.seed}.jsonl.gz"
    if options.what == "run":
        code_version()  # before anybody changes it while rows are made
        candidates = list(PAPER.structures())

        def rows(number: int) -> Iterator[dict[str, object]]:
            yield both(RandomDrive(options.seed, number, candidates, draw=drawn_structure), pool)

        with ThreadPoolExecutor(1) as pool:
            add_rows(path, drives_left(path, options.seed, options.first, options.last), rows, line)
    publish("genetic-border", [table(read_rows(path))], to_file=options.save)


if __name__ == "__main__":
    main()
