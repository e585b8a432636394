"""Calibration of the self-test: what it says beforehand beside what happens with fresh noise.

    python bench/selftest.py run 0 40 --seed 36 [--masses 1] [--draws 20] [--fresh 20] [--noise 0.01] [--whole]
    python bench/selftest.py table --seed 36 [--masses 1]
    python bench/selftest.py real [--only demo|mte360|emps] [--draws 10] [--found-only] [--whole] --save

`run` takes random drives of the paper's grammar by the reference solver (`support/drives.py`), identifies each from one
recording, and makes the self-test of the result, with the found model only. Then it identifies the *true* drive from
recordings with fresh noise. What the self-test predicts stands beside what happens: how often the structure comes out
again, and every verdict; and how often an interval holds the simulated value, or the true one. The drives have up to
`--masses` masses, and the searches are among such structures. `--whole` makes whole identifications in the self-test,
not fast ones; those with fresh noise are always whole.

Rows are kept in bench/results/selftest_seed<seed>[_masses<masses>].jsonl.gz; `run` goes on where the file ends.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from brightgrey import BrightgreyError, Result, SelfTest, demo, identify, selftest
from brightgrey.kit import PAPER
from support.drives import MORE_MASSES, RandomDrive
from support.measured import emps_recording, two_mass_recordings
from support.results import RESULTS, Table, arguments, code_version, publish
from support.rows import add_rows, drives_left, read_rows
from support.statistics import share

BINS = ((0.0, 0.5), (0.5, 0.9), (0.9, 1.0))
"""Predicted shares that are pooled; each holds its upper end."""


def row(drive: RandomDrive, options: argparse.Namespace) -> dict[str, object]:
    """Predicted and observed counts of one drive."""
    begin = time.process_time()
    (train, _) = drive.recordings(options.noise)
    more_masses = MORE_MASSES[options.masses - 1 :]
    result = identify(train, exclude=more_masses, seed=drive.seed, check=False)
    tested = selftest(result, draws=options.draws, fast=not options.whole, found_only=True, seed=drive.seed)
    middle = time.process_time()
    fresh = [identified(drive, options.noise, draw, more_masses) for draw in range(1, options.fresh + 1)]
    made = [r for r in fresh if r is not None]
    verdicts = dict(result.model.evidence or {})
    name, truth = str(result.model.structure), str(drive.truth)
    held = [inside(r, drive.values) for r in made if str(r.model.structure) == truth]
    intervals = [part.covered for part in tested.found.parameters.values()]
    return {
        "seed": drive.seed,
        "number": drive.number,
        "noise": options.noise,
        "masses": options.masses,
        "motion": drive.motion,
        "truth": truth,
        "found": name,
        "whole": options.whole,
        "draws": options.draws,
        "fresh": options.fresh,
        "predicted": tested.found.found_again.hits,
        "observed": sum(str(r.model.structure) == name for r in made),
        "predicted_minimal": tested.found.among_minimal.hits,
        "observed_minimal": sum(name in r.model.ties.minimal for r in made if r.model.ties),
        "verdicts": {
            e: [v, tested.stable[e].hits, sum((r.model.evidence or {}).get(e) == v for r in made)]
            for e, v in verdicts.items()
        },
        "predicted_intervals": [sum(c.hits for c in intervals), sum(c.of for c in intervals)],
        "observed_intervals": [sum(hits for hits, _ in held), sum(of for _, of in held)],
        "seconds": [round(middle - begin, 1), round(time.process_time() - middle, 1)],
        "code": code_version(),
    }


def identified(drive: RandomDrive, noise: float, draw: int, exclude: Sequence[str]) -> Result | None:
    """Result from a recording of the true drive with fresh noise; None if there is none."""
    try:
        return identify(drive.recordings(noise, draw)[0], exclude=exclude, seed=drive.seed, check=False)
    except BrightgreyError:
        return None


def inside(result: Result, values: Mapping[str, float]) -> tuple[int, int]:
    """Count the intervals that hold the true values, and all intervals."""
    known = [(p.ci95, values[n]) for n, p in result.model.parameters.items() if p.ci95 is not None]
    return sum(ci95[0] <= value <= ci95[1] for ci95, value in known), len(known)


def line(r: Mapping) -> str:
    """One row in words."""
    again = f"{r['predicted']}/{r['draws']} predicted, {r['observed']}/{r['fresh']} observed"
    return f"{r['number']:4d} {again}  {r['found']}  (true: {r['truth']})  {r['seconds'][0]} + {r['seconds'][1]} s"


def calibration(title: str, pairs: Sequence[tuple[int, int, int, int]]) -> Table:
    """Predicted against observed shares; pairs of hits and numbers, predicted first."""
    rows = []
    for low, high in BINS:
        inside_bin = [p for p in pairs if low < p[0] / p[1] <= high or (low == 0.0 and p[0] == 0)]
        if inside_bin:
            rows.append([f"{100 * low:.0f} to {100 * high:.0f} %", *_pooled(inside_bin)])
    rows.append(["all", *_pooled(pairs)])
    return Table(title, ["predicted share", "cases", "predicted", "observed", "differ beyond chance"], rows)


def _pooled(pairs: Sequence[tuple[int, int, int, int]]) -> list[str]:
    a, n, b, m = (sum(column) for column in zip(*pairs, strict=True))
    return [str(len(pairs)), share(a, n), share(b, m), str(sum(_differ(*p) for p in pairs))]


def _differ(a: int, n: int, b: int, m: int) -> bool:
    """Fisher's exact test of equal shares at 5 %."""
    from scipy.stats import fisher_exact

    return bool(fisher_exact([[a, n - a], [b, m - b]]).pvalue < 0.05)


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """All tables of the rows."""
    drives = len(rows)
    own = [(r["predicted"], r["draws"], r["observed"], r["fresh"]) for r in rows]
    minimal = [(r["predicted_minimal"], r["draws"], r["observed_minimal"], r["fresh"]) for r in rows]
    verdicts = [(p, r["draws"], o, r["fresh"]) for r in rows for _, p, o in r["verdicts"].values()]
    right = [r for r in rows if r["found"] == r["truth"]]
    held = [
        [share(*map(sum, zip(*(r[key] for r in some), strict=True))) if some else "none" for some in (rows, right)]
        for key in ("predicted_intervals", "observed_intervals")
    ]
    spent = [f"{np.median([r['seconds'][k] for r in rows]):.0f}" for k in (0, 1)]
    about = [
        ["drives", str(drives)],
        ["of these, the first recording gives the true structure", str(len(right))],
        ["intervals that hold the simulated value, in the self-test", held[0][0]],
        ["intervals that hold the true value, with fresh noise and the true structure", held[1][0]],
        ["CPU seconds per drive: identification and self-test, median", spent[0]],
        ["CPU seconds per drive: identifications with fresh noise, median", spent[1]],
    ]
    how = "whole self-test" if rows[0]["whole"] else "fast self-test"
    masses = max(r.get("masses", 4) for r in rows)
    how += f", up to {masses} masses" if masses > 1 else ", one mass"
    return [
        calibration(f"The structure is found again, {how}", own),
        calibration(f"The structure is among the minimal ones, {how}", minimal),
        calibration(f"A verdict is the same again, {how}", verdicts),
        Table(f"Drives, intervals and time, {how}", ["quantity", "value"], about),
    ]


REAL = {
    "demo": lambda: demo(),
    "mte360": lambda: identify(list(two_mass_recordings().values())),
    "emps": lambda: identify(emps_recording()),
}
TITLES = {"demo": "demo", "mte360": "MTE360", "emps": "EMPS"}


def real(options: argparse.Namespace) -> Iterator[Table]:
    """Self-tests of the demo and of measured recordings."""
    for name in REAL if options.only == "all" else (options.only,):
        result = REAL[name]()
        begin, cpu = time.perf_counter(), time.process_time()
        how = {"fast": not options.whole, "found_only": options.found_only, "workers": options.workers}
        tested = selftest(result, draws=options.draws, **how)
        took = f"{time.perf_counter() - begin:.0f} / {time.process_time() - cpu:.0f}"
        yield Table(f"Self-test of {TITLES[name]}", ["quantity", "result"], real_rows(tested, options.found_only, took))


def real_rows(tested: SelfTest, found_only: bool, took: str) -> list[list[str]]:
    """Rows of one self-test."""
    own = tested.found
    fragile = [f"{e} {c.hits} of {c.of}" for e, c in tested.stable.items() if c.hits < c.of]
    covered = [part.covered for part in own.parameters.values()]
    noticed = [f"{d.effect} {d.noticed.hits} of {d.noticed.of}" for d in tested.drives if d.noticed]
    rivals = [f"`{d.structure}` {d.among_minimal}" for d in tested.drives if d.kind == "equivalent"]
    others = (
        []
        if found_only
        else [
            ["rivals that are minimal again if they are simulated", ", ".join(rivals) or "no rival"],
            ["not needed, noticed at its relevant size", ", ".join(noticed) or "no such effect"],
        ]
    )
    simulated = "of the found model" if found_only else "of each drive"
    return [
        ["found", f"`{tested.structure}`"],
        ["self-test", f"{'fast' if tested.fast else 'whole'}, {tested.draws} draws {simulated}"],
        ["structure found again", share(own.found_again.hits, own.found_again.of)],
        ["among the minimal structures", share(own.among_minimal.hits, own.among_minimal.of)],
        ["most frequent structures", ", ".join(f"`{s}` {n}" for s, n in list(own.structures.items())[:3])],
        ["verdicts that changed: the same again in", ", ".join(fragile) or "none changed"],
        *others,
        ["intervals that hold the simulated value", share(sum(c.hits for c in covered), sum(c.of for c in covered))],
        ["wall / CPU seconds", took],
    ]


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("what", choices=("run", "table", "real"))
    parser.add_argument("first", type=int, nargs="?", default=0, help="number of the first drive")
    parser.add_argument("last", type=int, nargs="?", default=40, help="and of the one after the last")
    parser.add_argument("--seed", type=int, default=36)
    parser.add_argument("--noise", type=float, default=0.01, help="standard deviation over the peak")
    parser.add_argument("--masses", type=int, choices=(1, 2, 3, 4), default=4, help="largest number of masses")
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--fresh", type=int, default=20, help="recordings of the true drive with fresh noise")
    parser.add_argument("--whole", action="store_true", help="whole identifications in the self-test")
    parser.add_argument("--found-only", action="store_true", help="`real`: simulate the found model only")
    parser.add_argument("--only", choices=(*REAL, "all"), default="all")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file of the rows, instead of that of the seed in bench/results/")
    options = parser.parse_args()
    kind = ("_whole" if options.whole else "") + (f"_masses{options.masses}" if options.masses < 4 else "")
    path = options.out or RESULTS / f"selftest_seed{options.seed}{kind}.jsonl.gz"
    if options.what == "run":
        candidates = [s for s in PAPER.structures() if s.masses <= options.masses]
        add_rows(
            path,
            drives_left(path, options.seed, options.first, options.last),
            lambda number: [row(RandomDrive(options.seed, number, candidates), options)],
            line,
        )
    elif options.what == "table":
        publish("selftest", tables(read_rows(path)), to_file=options.save)
    else:
        for table in real(options):
            publish("selftest", [table], to_file=options.save)


if __name__ == "__main__":
    main()
