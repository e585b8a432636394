"""Optimum reached by a fit with the width of friction's reversal estimated, and with the gain fixed.

    python bench/friction_width.py run 0 9 --seed 78     drives 0 to 8, added to the file of the seed
    python bench/friction_width.py table --seed 78

Random drives with dry friction and without a gap, each with three gains of friction's sign over the largest speed, from
the reference solver, with white noise of 0.2 % of the peak. The structure is given; eight starts. The optimum counts as
reached within 0.3 % of the least cost of all ways.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from brightgrey.estimation import fit
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.simulation.reference import reference
from support.drives import MOTIONS, excitation, simulated_recording
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, drives_left, read_rows, row_arguments
from support.statistics import share_of

GAINS = (100.0, 1000.0, 1e5)
NOISE = 2e-3
REACHED = 1.003
WAYS = {"width estimated": None, "gain 100": 100.0, "gain 10,000": 1e4}
"""Gain over the largest speed that the fit is told."""


def examine(seed: int, number: int) -> Iterator[dict[str, object]]:
    """Rows of one drive, one for each gain."""
    rng = np.random.default_rng([seed, number])
    candidates = [s for s in PAPER.structures() if s.has_dry_friction and not s.has_hard_limit]
    structure = candidates[int(rng.integers(len(candidates)))]
    values = random_values(structure.parameters, rng)
    e, u = PAPER_EXPERIMENT, excitation(MOTIONS[number % len(MOTIONS)], rng)
    largest = float(np.abs(reference(str(structure), values, u, e.dt, f_tanh=e.f_tanh)[0]).max())
    for gain in GAINS:
        v = reference(str(structure), values, u, e.dt, f_tanh=gain / largest)[0]
        recording = simulated_recording(u, v + NOISE * float(np.abs(v).max()) * rng.standard_normal(v.size))
        speed = scales([recording]).speed
        costs = {
            way: fit(structure, [recording], f_tanh=told and told / speed, patience=0).cost
            for way, told in WAYS.items()
        }
        yield {
            "code": code_version(),
            "seed": seed,
            "number": number,
            "truth": str(structure),
            "gain": gain,
            "costs": costs,
        }


def reached(row: Mapping, way: str) -> bool:
    """True if a way has come to the least cost of all."""
    return bool(row["costs"][way] <= REACHED * min(row["costs"].values()))


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Shares of optima reached, by the gain of the drive."""
    header = ["fit", *(f"drive's gain {gain:,.0f}" for gain in GAINS), "all"]
    body = []
    for way in WAYS:
        columns = [[reached(r, way) for r in rows if r["gain"] in kinds] for kinds in (*((g,) for g in GAINS), GAINS)]
        body.append([way, *map(share_of, columns)])
    return [Table("Least cost reached, by the sharpness that the fit takes", header, body)]


def line(r: Mapping) -> str:
    """One row in words."""
    least = min(r["costs"].values())
    shown = ", ".join(f"{way} {cost / least:.3f}" for way, cost in r["costs"].items())
    return f"{r['number']:4d} {r['truth']}, gain {r['gain']:g}: {shown}"


def run(options: argparse.Namespace, path: Path) -> None:
    code_version()  # before anybody changes it while rows are made
    left = drives_left(path, options.seed, options.first, options.last)
    add_rows(path, left, lambda number: examine(options.seed, number), line)


def main() -> None:
    limit_blas_threads()
    parser = row_arguments(__doc__, last=9, seed=78)
    options = parser.parse_args()
    path = RESULTS / f"friction_width_seed{options.seed}.jsonl.gz"
    if options.what == "run":
        run(options, path)
    rows = read_rows(path)
    if rows:
        publish("recovery", tables(rows), to_file=options.save)


if __name__ == "__main__":
    main()
