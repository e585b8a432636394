"""Success rates of the genetic programming, and its speed.

    python bench/genetic.py speed                     one run of the paper's experiment
    python bench/genetic.py rates paper reference 0 100   setting, truth, first seed and the one after the last
    python bench/genetic.py rates tuned others 0 20
    python bench/genetic.py table                     all that was collected so far
    python bench/genetic.py exhaustive 0 10 --seed 18 against all 448 structures: drives 0 to 9 of bench/recovery.py
    python bench/genetic.py exhaustive 0 10 --masses 2 --without backlash

`rates` adds to bench/results/genetic/<setting>_<truth>.csv, one row per seed, so that it can be interrupted and
continued; `exhaustive` adds to bench/results/genetic_exhaustive.jsonl. Data come from the reference
solver without noise. The truths beside the paper's reference are spread over the function set; their values are off
from the assumed ones by 17 to 40 %.

`exhaustive` compares both searches on the same recordings (1 % noise, nothing bounded by the user). *Found*: a fit of
the genetic search is as good, by the criterion, as the best of all structures with an RSS larger by 1 % at most. It is
asked of the whole run, and of its first fits: a quarter of those of the search of all structures, searches for hubs and
further fits of the same structure counted on both sides; and, harder, a quarter of the number of structures.
"""

from __future__ import annotations

import csv
import json
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from brightgrey.effects import registry
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Grammar, Structure
from brightgrey.paper.experiment import reference_recording, task_of
from brightgrey.paper.repetitions import (
    RunSummary,
    repetitions_csv,
    summarise_run,
    summary,
)
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.criteria import Misfit, criterion
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import find_missed_optima
from brightgrey.search.genetic import estimator, evolve, genetic_search
from brightgrey.search.genetic.job_evaluator import JobEvaluator
from brightgrey.search.genetic.lattice_evaluator import LatticeEvaluator
from brightgrey.search.genetic.settings import PAPER_SETTINGS, PROBABILITIES, TUNED_SETTINGS
from brightgrey.search.parallel import thread_pool
from brightgrey.search.task import IdentificationTask
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import UnsettledError
from support.drives import RandomDrive
from support.results import RESULTS, Table, arguments, publish
from support.statistics import effective_samples, share

NOISE = 0.01
# The paper's setting with identification that does not fail, so that only the search of structures is judged.
EXACT = replace(PAPER_SETTINGS, estimator="least-squares", iterations=30, start_from="standard")
CHANGES = {
    "none": {},
    "k_p-0": {"k_p": 0.0},
    "k_p-10": {"k_p": 10.0},
    "bic": {"criterion": "bic"},
    "clone-0": {"p_clone": 0.0},
    "clone-0.5": {"p_clone": 0.5},
    "mutations-twice": {"mutations": {name: 2.0 * p for name, p in PROBABILITIES.items()}},
    "mutations-half": {"mutations": {name: 0.5 * p for name, p in PROBABILITIES.items()}},
    "mutations-none": {"mutations": {}},
    "elite": {"elite": 1},
    "12x9": {"population": 12, "generations": 9},
    "24x4": {"population": 24, "generations": 4},
    "generations-40": {"generations": 40},
    "fresh": {"elite": 1, "max_remutations": 8},
}
SETTINGS = {
    "paper": PAPER_SETTINGS,
    "tuned": TUNED_SETTINGS,
    "tuned-19": replace(TUNED_SETTINGS, criterion="fitness"),
    "paper-50": replace(PAPER_SETTINGS, iterations=50),
    "paper-ls": replace(PAPER_SETTINGS, estimator="least-squares", iterations=30),
    "paper-elite": replace(PAPER_SETTINGS, elite=1),
    **{f"exact-{name}": replace(EXACT, **change) for name, change in CHANGES.items()},
}
OTHERS = (
    "one_mass+coulomb+viscous",
    "one_mass+viscous+gravity+delay",
    "one_mass+coulomb+stribeck+current_control",
    "two_mass+viscous",
    "two_mass+coulomb+viscous+gravity",
    "two_mass+coulomb+backlash",
    "two_mass+coulomb+viscous+current_control+delay",
    "three_mass+coulomb+viscous",
    "three_mass+coulomb+viscous+gravity+backlash",
    "four_mass+coulomb+viscous+stribeck",
)
VALUES = dict(PAPER_EXPERIMENT.values) | {
    "J3": 0.005,
    "J4": 0.003,
    "c2": 180.0,
    "c3": 160.0,
    "d2": 0.06,
    "d3": 0.04,
    "M_G": 0.4,
    "alpha": 0.008,
    "T_1": 0.004,
    "T_d": 0.006,
}
COLUMNS = (
    *("truth", "true structure found", "with extras", "best of last generation", "seen"),
    *("median first generation", "median simulations", "of whole recordings"),
)
COLLECTED = RESULTS / "genetic"


def task(truth):
    values = {name: VALUES[name] for name in PAPER.parse(truth).parameters}
    return task_of(reference_recording(PAPER.parse(truth), values))


def speed(workers: int, seeds: int) -> Table:
    ready = task(PAPER_EXPERIMENT.structure)
    genetic_search(ready, replace(PAPER_SETTINGS, generations=0, iterations=1), 0)  # compiles
    rows = []
    for seed in range(seeds):
        wall, cpu = time.perf_counter(), time.process_time()
        done = genetic_search(ready, PAPER_SETTINGS, seed, workers=workers)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        rows.append([str(seed), f"{wall:.1f}", f"{cpu:.1f}", f"{done.simulations:,}", str(done.identifications)])
        print(*rows[-1], sep="; ", flush=True)
    columns = ["seed", "wall s (at most 10)", "CPU s", "simulations", "identifications"]
    return Table(f"One run of the paper's experiment, {workers} workers", columns, rows)


class CachedEstimator:
    """Estimator that keeps its results from seed to seed; every run still counts its simulations as its own."""

    def __init__(self, estimate) -> None:
        self.estimate, self.known = estimate, {}

    def __call__(self, structure, starts):
        """Identify what has not been identified before."""
        fresh = [start for start in starts if (structure, start) not in self.known]
        if fresh:
            results = self.estimate(structure, fresh)
            self.known |= {(structure, start): result for start, result in zip(fresh, results, strict=True)}
        return [self.known[structure, start] for start in starts]


def rates(setting: str, truths: tuple[str, ...], first: int, last: int) -> None:
    COLLECTED.mkdir(exist_ok=True)
    for truth in truths:
        file = COLLECTED / f"{setting}_{truth}.csv"
        rows = read(file)
        wanted = [seed for seed in range(first, last) if seed not in {r.seed for r in rows}]
        if not wanted:
            continue
        ready, how = task(truth), SETTINGS[setting]
        identify = CachedEstimator(estimator(how.estimator, ready, how.iterations, how.stall_polls))
        for seed in wanted:
            began = time.process_time()
            done = summarise_run(genetic_search(ready, how, seed, identify=identify), PAPER.parse(truth), seed)
            rows.append(done)
            file.write_text(repetitions_csv(rows), encoding="utf-8")
            print(
                setting,
                truth,
                seed,
                done.best_verdict,
                done.best,
                done.first,
                f"{time.process_time() - began:.0f} s",
                flush=True,
            )


def exhaustive(seed: int, first: int, last: int, setting: str, grammar: Grammar, out: Path, whole: bool) -> Table:
    """Both searches on the same drives; rows are added to `out`."""
    rows = [json.loads(text) for text in out.read_text().splitlines()] if out.exists() else []
    structures = list(grammar.structures())
    for number in range(first, last):
        if (setting, seed, number, grammar.name) in {
            (r["setting"], r["seed"], r["number"], r["grammar"]) for r in rows
        }:
            continue
        try:
            drive = RandomDrive(seed, number, structures, PAPER_EXPERIMENT.f_tanh)
        except UnsettledError as why:
            print(f"{number:4d} left out: {why}", flush=True)
            continue
        rows.append(against_all(drive, setting, grammar, structures, whole))
        with out.open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
        print(rows[-1], flush=True)
    return compared([r for r in rows if (r["setting"], r["grammar"]) == (setting, grammar.name)], len(structures))


def part_of_paper(masses: int, without: list[str]) -> Grammar:
    """Part of the paper's grammar, with a name that describes it."""
    left = {
        name: places
        for name, places in PAPER.places.items()
        if name not in without and registry()[name].masses <= masses
    }
    return Grammar(f"{masses} masses, without {', '.join(without) or 'nothing'}", left)


def against_all(drive: RandomDrive, setting: str, grammar: Grammar, structures: list[Structure], whole: bool) -> dict:
    """One drive: the best of all structures, and after how many fits the genetic search had one as good."""
    (recording, _), began, how = drive.recordings(NOISE), time.process_time(), SETTINGS[setting]
    known = scales([recording])
    ready = IdentificationTask((recording,), known, Settings(PAPER_EXPERIMENT.f_tanh, known.speed, "fast"))
    every = FitTable(ready, structures, seed=drive.seed)
    with thread_pool(None) as worker:
        every.add(structures, worker)
        find_missed_optima(every, worker)
    fitted = every.done
    middle = time.process_time()
    if not whole:
        how = replace(how, generations=len(every.log) // 4 // (how.population - how.elite) + 2)
    judge = criterion(how.criterion, how.k_p)
    with thread_pool(None) as worker:
        if how.start_from == "neighbours":
            evaluator = LatticeEvaluator(
                ready,
                structures,
                worker,
                judge,
                options=how.options,
                seed=drive.number,
                generations=how.generations,
            )
        else:
            identify = estimator(how.estimator, ready, how.iterations, how.stall_polls)
            start = ready.default_start if how.start_from == "standard" else None
            evaluator = JobEvaluator(identify, worker, judge, start)
        done = evolve(evaluator, ready.draw, how, grammar=grammar, seed=drive.number)
    ended = time.process_time()
    made = (
        [None if hub else (f.cost, f.free) for hub, f in evaluator.fits.log]
        if how.start_from == "neighbours"
        else [
            (sum(e.result.misfit.rss) * ready.problem(e.job.structure).weights[0] ** 2, e.result.n_parameters)
            for e in done.evaluations
            if not e.repeated
        ]
    )
    row = {
        "setting": setting,
        "grammar": grammar.name,
        "seed": drive.seed,
        "number": drive.number,
        "truth": str(drive.truth),
        "genetic": str(done.best.job.structure),
        "whole": whole,
        "fits": len(made),
        "fits of all": len(every.log),
        "structures": len({e.job.structure for e in done.evaluations}),
        "seconds": [round(middle - began, 1), round(ended - middle, 1)],
    }
    for name, value in judges(ready, fitted).items():
        best = max(fitted.values(), key=lambda f: value(f.cost, f.free))
        least = value(1.01 * best.cost, best.free)
        found = (k for k, fit in enumerate(made, 1) if fit is not None and value(*fit) >= least)
        row |= {name: str(best.structure), f"{name} after": next(found, None)}
    return row


def judges(task: IdentificationTask, fitted: dict) -> dict:
    """Criteria of cost and number of parameters, the larger the better.

    That of the genetic search, BIC with all samples, and that of the ranking, with the number of independent ones.
    """
    (r,), first = task.recordings, next(iter(fitted))
    weight = task.problem(first).weights[0]
    floor = r.samples * float(r.resolution[0]) ** 2 / 12.0
    best = min(fitted.values(), key=lambda f: (f.cost, f.free))
    values = {name: np.array([v]) for name, v in {**task.default_start(best.structure), **best.values}.items()}
    independent = effective_samples(task.problem(best.structure).residuals(values, task.settings)[:, 0])

    def bic(cost: float, free: int) -> float:
        return criterion("bic").value(Misfit((cost / weight**2,), (floor,), r.samples, (1.0,)), free)

    def ranking(cost: float, free: int) -> float:
        rss = max(cost / weight**2, floor, 1e-300)
        return -float(independent * np.log(rss / r.samples) + free * np.log(independent))

    return {"bic": bic, "ranking": ranking}


def compared(rows: list[dict], count: int) -> Table:
    """Table of the shares of drives in which the genetic search found the best of all structures."""
    shares = []
    for name in ("bic", "ranking"):
        for budget, part in (
            ("a quarter of the fits of all", lambda row: row["fits of all"] / 4),
            (f"a quarter of {count} fits", lambda row: count / 4),
            ("the whole run", lambda row: np.inf if row["whole"] else None),
        ):
            asked = [(r[f"{name} after"], part(r)) for r in rows if part(r)]
            hits = sum(k is not None and k <= most for k, most in asked)
            shares.append([name, budget, share(hits, len(asked), percent=True)])
    rows = [r for r in rows if r["whole"]]
    if rows:
        fits, ratios = [r["fits"] for r in rows], [r["seconds"][1] / r["seconds"][0] for r in rows]
        print(f"fits of the whole run: median {np.median(fits):g}, most {max(fits)}")
        print(f"CPU time over that of all {count}: median {np.median(ratios):.2g}, most {max(ratios):.2g}")
    return Table(f"Against all {count} structures", ["criterion", "within", "found"], shares)


def read(file: Path) -> list[RunSummary]:
    if not file.exists():
        return []
    kinds = {f.name: f.type for f in fields(RunSummary)}
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    numbers = {name for name, kind in kinds.items() if "int" in str(kind)}
    return [RunSummary(**{k: (int(v) if v else None) if k in numbers else v for k, v in row.items()}) for row in rows]


def tables() -> list[Table]:
    """Everything that `rates` has collected, by setting: the paper's reference, and all others."""
    rows: dict[str, list[list[str]]] = {}
    for file in sorted(COLLECTED.glob("*.csv")):
        setting, truth = file.stem.split("_", 1)
        s = summary(read(file))
        first = "-" if s.first is None else f"{s.first:g}"
        counts = [share(s.true, s.count, 0), str(s.extras), str(s.last_true), str(s.seen), first]
        where = "the paper's reference" if truth == PAPER_EXPERIMENT.structure else "other references"
        title = f"{setting[0].upper()}{setting[1:]}{chr(39) + 's' if setting == 'paper' else ''} setting on {where}"
        rows.setdefault(title, []).append([f"`{truth}`", *counts, f"{s.simulations:,.0f}", f"{s.passes:,.0f}"])
    return [Table(title, COLUMNS, cells) for title, cells in rows.items()]


def main() -> None:
    limit_blas_threads()
    parser = arguments(__doc__)
    tasks = parser.add_subparsers(dest="task", required=True)
    timed = tasks.add_parser("speed")
    timed.add_argument("--workers", type=int, default=2)
    timed.add_argument("--seeds", type=int, default=2)
    asked = tasks.add_parser("rates")
    asked.add_argument("setting", choices=SETTINGS)
    asked.add_argument("truth", help="reference, others, or a structure")
    asked.add_argument("first", type=int)
    asked.add_argument("last", type=int)
    tasks.add_parser("table")
    against = tasks.add_parser("exhaustive")
    against.add_argument("first", type=int)
    against.add_argument("last", type=int)
    against.add_argument("--seed", type=int, default=18, help="of the drives")
    against.add_argument("--quarter", action="store_true", help="end the genetic search after a quarter of the fits")
    against.add_argument("--masses", type=int, default=4, help="at most")
    against.add_argument("--without", nargs="*", default=[], help="effects that no structure has")
    against.add_argument("--setting", choices=SETTINGS, default="tuned")
    against.add_argument("--out", type=Path, default=RESULTS / "genetic_exhaustive.jsonl")
    given = parser.parse_args()
    if given.task == "speed":
        made = [speed(given.workers, given.seeds)]
    elif given.task == "exhaustive":
        grammar = part_of_paper(given.masses, given.without)
        whole = not given.quarter
        made = [exhaustive(given.seed, given.first, given.last, given.setting, grammar, given.out, whole)]
    else:
        if given.task == "rates":
            known = {"reference": (PAPER_EXPERIMENT.structure,), "others": OTHERS}
            rates(given.setting, known.get(given.truth, (given.truth,)), given.first, given.last)
        made = tables()
    publish("genetic", made, to_file=given.save)


if __name__ == "__main__":
    main()
