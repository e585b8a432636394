"""Verdicts on drives with something that no structure of the function set has.

    python bench/outside.py run 0 200 --seed 38     drives 0 to 199, added to the file of the seed
    python bench/outside.py table --seed 38

The kinds of drives are in support/foreign_drives.py. Asked is whether a mass or a gap is called *needed* that the drive
has not, and whether the certificate says that the recording holds something unexplained. That is due if the foreign
effect matters: the best fit of all leaves a residual whose RMS is more than 5 % above the noise.
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
from brightgrey.search.decision import decide_structures
from brightgrey.search.lattice import has
from support.foreign_drives import KINDS, ForeignDrive
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, drives_left, read_rows, row_arguments
from support.statistics import share_of

MATTERS = 1.05
NOISE = 2e-3


def examine(drive: ForeignDrive, pool: ThreadPoolExecutor) -> dict[str, object]:
    """One row of the file."""
    recording = drive.recording(NOISE)
    task = identification_task([recording], None, {}, {}, None)
    begin = time.process_time()
    decision = decide_structures(task, PAPER, seed=drive.seed, executor=pool)
    seconds = time.process_time() - begin
    found = decision.evidence
    least = min(found.refined.values(), key=lambda r: r.cost)
    weight = float(task.problem(least.structure).weights[0])
    noise = NOISE * float(np.abs(drive.v).max())
    return {
        "code": code_version(),
        "seed": drive.seed,
        "number": drive.number,
        "kind": drive.kind,
        "truth": str(drive.truth),
        "motion": drive.motion,
        "remains": float(np.sqrt(least.cost / recording.samples)) / weight / noise,
        "minimal": [str(r.structure) for r in found.minimal],
        "verdicts": {c.effect: c.verdict for c in found.cards},
        "unexplained": list(found.certificate.unexplained),
        "seconds": round(seconds, 1),
    }


def false_needed(row: Mapping) -> list[str]:
    """Masses and gaps that are called needed and are not there. A fifth mass may show as any number of masses."""
    truth = PAPER.parse(row["truth"])
    asked = ("two_mass", "three_mass", "four_mass", "backlash")
    return [e for e in asked if row["verdicts"].get(e) == "needed" and not has(truth, e)]


def matters(row: Mapping) -> bool:
    """True if the best fit leaves clearly more than the noise."""
    return bool(row["remains"] > MATTERS)


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Shares by kind of drive."""
    body = []
    for kind in (*KINDS, "all"):
        some = [r for r in rows if kind in (r["kind"], "all")]
        felt = [r for r in some if matters(r)]
        quiet = [r for r in some if not matters(r)]
        body.append(
            [
                kind,
                str(len(some)),
                share_of([bool(false_needed(r)) for r in some]),
                share_of([bool(r["unexplained"]) for r in felt]),
                share_of([bool(r["unexplained"]) for r in quiet]),
                f"{np.mean([r['seconds'] for r in some]):.0f}" if some else "",
            ]
        )
    header = ["drive has", "drives", "mass or gap falsely *needed*", "said, where it matters", "said, else", "CPU s"]
    return [Table("Drives with something that no structure explains", header, body)]


def line(r: Mapping) -> str:
    """One drive in words."""
    said = "said" if r["unexplained"] else "not said"
    return (
        f"{r['number']:4d} {r['kind']}, {r['truth']} ({r['motion']}) {r['seconds']} s: {r['minimal'][0]}"
        f" of {len(r['minimal'])}, leaves {r['remains']:.2f} of the noise, {said}, false: {false_needed(r)}"
    )


def run(options: argparse.Namespace, path: Path) -> None:
    code_version()  # before anybody changes it while rows are made
    left = drives_left(path, options.seed, options.first, options.last)
    with ThreadPoolExecutor(1) as pool:
        add_rows(
            path,
            left,
            lambda number: [examine(ForeignDrive(options.seed, number, list(PAPER.structures())), pool)],
            line,
        )


def main() -> None:
    limit_blas_threads()
    parser = row_arguments(__doc__, last=200, seed=38)
    options = parser.parse_args()
    path = RESULTS / f"outside_seed{options.seed}.jsonl.gz"
    if options.what == "run":
        run(options, path)
    rows = read_rows(path)
    if rows:
        publish("recovery", tables(rows), to_file=options.save)


if __name__ == "__main__":
    main()
