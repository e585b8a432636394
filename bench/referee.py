"""Does the border search decide as a fit of every structure does? The same drives and noises as recovery.py.

    python bench/referee.py run 0 100 --seed 34     drives 0 to 99, added to the file of the seed
    python bench/referee.py table --seed 34

The referee fits all 448 structures and decides by the same rules. Both agree if they find the same set of minimal
structures. Where they do not, a row holds the cost that either has reached within each structure in which they differ,
and the least cost of all. Who has the higher one has missed an optimum. Drive k has noise k mod 4 of the four.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from brightgrey.api.to_si import identification_task
from brightgrey.kit import PAPER
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.decision import Decision, decide_structures
from brightgrey.search.lattice import Lattice
from brightgrey.search.task import IdentificationTask
from support.drives import RandomDrive
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, drives_left, read_rows, row_arguments
from support.statistics import share_of

NOISES = (0.0, 1e-3, 1e-2, 5e-2)
MISSED = 2.0
"""A cost that is higher by so many variances of the noise is a missed optimum."""


def decided(task: IdentificationTask, how: str, seed: int, pool: ThreadPoolExecutor) -> tuple[Decision, float]:
    """A decision and its CPU seconds."""
    begin = time.process_time()
    decision = decide_structures(task, PAPER, how=how, seed=seed, executor=pool)
    return decision, round(time.process_time() - begin, 1)


def cost_within(decision: Decision, mask: int) -> float:
    """Least cost of the structures within `mask`, in noise variances of that decision's best fit."""
    lattice, refined = Lattice.of(PAPER), decision.evidence.refined
    return min((r.cost for s, r in refined.items() if not lattice.mask(s) & ~mask), default=np.inf)


def examine(seed: int, number: int, pool: ThreadPoolExecutor) -> dict[str, object]:
    """One row of the file."""
    noise = NOISES[number % len(NOISES)]
    drive = RandomDrive(seed, number, list(PAPER.structures()))
    train = drive.recordings(noise)[0]
    task = identification_task([train], None, {}, {}, None)
    found = {how: decided(task, how, drive.seed, pool) for how in ("border", "exhaustive")}
    minimal = {how: {str(r.structure) for r in d.evidence.minimal} for how, (d, _) in found.items()}
    lattice = Lattice.of(PAPER)
    masks = {s: lattice.mask(PAPER.parse(s)) for s in minimal["border"] ^ minimal["exhaustive"]}
    masks["best of all"] = lattice.everything
    best = min(cost_within(d, lattice.everything) for d, _ in found.values())
    unit = best / sum(r.y.size for r in task.recordings)
    return {
        "code": code_version(),
        "seed": seed,
        "number": number,
        "noise": noise,
        "truth": str(drive.truth),
        "motion": drive.motion,
        "minimal": {how: sorted(some) for how, some in minimal.items()},
        "seconds": {how: seconds for how, (_, seconds) in found.items()},
        "fits": {how: len(d.fitted) for how, (d, _) in found.items()},
        "costs": {
            s: {how: (cost_within(d, mask) - best) / unit for how, (d, _) in found.items()} for s, mask in masks.items()
        },
    }


def missed_by(row: Mapping) -> str:
    """Who has missed an optimum where a row differs: 'border', 'referee', 'both' or 'none'."""
    border = any(c["border"] > c["exhaustive"] + MISSED for c in row["costs"].values())
    referee = any(c["exhaustive"] > c["border"] + MISSED for c in row["costs"].values())
    return {(True, False): "border", (False, True): "referee", (True, True): "both", (False, False): "none"}[
        border, referee
    ]


def agree(row: Mapping) -> bool:
    """True if both have found the same minimal structures."""
    return bool(row["minimal"]["border"] == row["minimal"]["exhaustive"])


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Shares by noise, and the drives in which the two differ."""
    columns = {f"{100 * noise:g} %": [r for r in rows if r["noise"] == noise] for noise in NOISES} | {"all": rows}
    columns = {title: some for title, some in columns.items() if some}
    asked = {
        "drives": lambda some: str(len(some)),
        "same minimal structures": lambda some: share_of([agree(r) for r in some], 1),
        "differ, optimum missed by the border": lambda some: missed(some, "border"),
        "... by the referee": lambda some: missed(some, "referee"),
        "... by both": lambda some: missed(some, "both"),
        "... by none": lambda some: missed(some, "none"),
        "fits of the border, median (most)": lambda some: (
            f"{np.median([r['fits']['border'] for r in some]):g} ({max(r['fits']['border'] for r in some)})"
        ),
        "CPU seconds, border, mean": lambda some: f"{np.mean([r['seconds']['border'] for r in some]):.0f}",
        "CPU seconds, referee, mean": lambda some: f"{np.mean([r['seconds']['exhaustive'] for r in some]):.0f}",
    }
    body = [[what, *(cell(some) for some in columns.values())] for what, cell in asked.items()]
    return [Table("Border search against fits of all structures", ["", *columns], body)]


def missed(rows: Sequence[Mapping], whom: str) -> str:
    """Number of drives that differ for that reason."""
    return str(sum(not agree(r) and missed_by(r) == whom for r in rows))


def line(r: Mapping) -> str:
    """One drive in words."""
    text = f"{r['number']:4d} {r['noise']:5g} {r['truth']} ({r['motion']}) {r['seconds']}"
    if agree(r):
        return text
    border, referee = (set(r["minimal"][how]) for how in ("border", "exhaustive"))
    costs = "; ".join(f"{s}: {c['border']:.1f} / {c['exhaustive']:.1f}" for s, c in r["costs"].items())
    return f"{text}\n     only border: {border - referee}, only referee: {referee - border}; {costs}: {missed_by(r)}"


def run(options: argparse.Namespace, path: Path) -> None:
    code_version()  # before anybody changes it while rows are made
    left = drives_left(path, options.seed, options.first, options.last)
    with ThreadPoolExecutor(1) as pool:
        add_rows(path, left, lambda number: [examine(options.seed, number, pool)], line)


def main() -> None:
    limit_blas_threads()
    parser = row_arguments(__doc__, last=100, seed=34)
    options = parser.parse_args()
    path = RESULTS / f"referee_seed{options.seed}.jsonl.gz"
    if options.what == "run":
        run(options, path)
    rows = read_rows(path)
    for r in rows:
        if not agree(r):
            print(line(r))
    if rows:
        publish("recovery", tables(rows), to_file=options.save)


if __name__ == "__main__":
    main()
