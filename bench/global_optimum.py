"""Does the fit of the true structure reach the true optimum? Random drives, from bounds found in the data only.

True structures are drawn from all of the paper's grammar, their parameters over two decades
(`brightgrey.excitation.random_drives`), the recording comes from the reference solver with white noise and rounding to
a quarter of it. A fit succeeds if its residual sum of squares is at most 1.02 times that of the true parameters.
Errors of parameters are medians over runs in which the recording shows the parameter: the standard deviation
by the fit is below the goal.
"""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from brightgrey.estimation import fit, predict
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.simulation.reference import UnsettledError, reference
from support.drives import rounded, simulated_recording
from support.results import Table, arguments, publish
from support.statistics import share

ENOUGH = 1.02
GOALS = {"inertia": 0.01, "stiffness": 0.02, "friction": 0.03, "gap": 0.05, "delay": 0.2}
FAMILIES = {
    "inertia": r"J\d",
    "stiffness": r"c\d",
    "damping": r"d\d",
    "friction": r"M_C|f_v|M_S|omega_S",
    "constant torque": "M_G",
    "gap": "alpha",
    "current control": "T_1",
    "delay": "T_d",
}


class Run(NamedTuple):
    """One fit: RSS over that of the truth, and relative errors with relative standard deviations by parameter.

    Errors of dead time and of the current control are in samples.
    """

    structure: str
    number: int
    noise: float
    ratio: float
    seconds: float
    outcome: str
    errors: dict[str, tuple[float, float]]
    text: str


def recording_of(structure: str, noise: float, rng: np.random.Generator) -> tuple[Recording, dict[str, float]]:
    """Simulated recording of a random drive, and its parameters."""
    e = PAPER_EXPERIMENT
    values = random_values(PAPER.parse(structure).parameters, rng)
    u = np.round(e.torque(), 3)
    (v,) = reference(structure, values, u, e.dt, f_tanh=e.f_tanh)
    size = noise * float(np.abs(v).max())
    step = 10.0 ** np.floor(np.log10(0.5 * size))
    y = rounded(v + size * rng.standard_normal(v.size), float(step))
    return simulated_recording(u, y), values


def examine(job: tuple[int, int, float, int]) -> Run | str:
    """Fit one random drive; a text if it has no reference solution."""
    seed, number, noise, starts = job
    rng = np.random.default_rng([seed, number])
    structures = list(PAPER.structures())
    structure = structures[int(rng.integers(len(structures)))]
    try:
        recording, true = recording_of(str(structure), noise, rng)
    except UnsettledError as why:
        return f"{number} {structure}: {why}"
    begin = time.process_time()
    found = fit(structure, [recording], f_tanh=PAPER_EXPERIMENT.f_tanh, starts=starts)
    seconds = time.process_time() - begin
    best = predict(structure, true, recording, found.settings)
    rss = found.train["velocity"].rss
    errors = {}
    for name, value in true.items():
        estimate = found.estimates[name]
        size = recording.dt if name in ("T_d", "T_1") else abs(value)
        errors[name] = (abs(estimate.value - value) / size, estimate.std / size)
    pairs = ", ".join(f"{n} {found.estimates[n].value:.4g} ({v:.4g})" for n, v in true.items())
    ratio = rss / float(np.sum((best - recording.y) ** 2))
    return Run(str(structure), number, noise, ratio, seconds, found.outcome.kind, errors, pairs)


def share_reached(runs: Sequence[Run]) -> str:
    """Share of `runs` that reach the optimum, with the 95 % interval."""
    return share(sum(run.ratio <= ENOUGH for run in runs), len(runs), percent=True)


def optimum_row(seed: int, noise: float, runs: Sequence[Run]) -> list[str]:
    """Row of the table of optima: all drives of one seed and noise."""
    seconds = [run.seconds for run in runs]
    parts = [[run for run in runs if ("backlash" in run.structure) == inside] for inside in (False, True)]
    times = f"{np.median(seconds):.2f}, {np.mean(seconds):.1f}, {max(seconds):.0f}"
    return [f"{seed}, {100 * noise:g} %", *(share_reached(part) for part in (runs, *parts)), times]


def error_rows(noise: float, runs: Sequence[Run]) -> list[list[str]]:
    """Rows of the table of parameter errors: one for each family of parameters."""
    pooled: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for run in runs:
        for name, pair in run.errors.items():
            family = next(f for f, pattern in FAMILIES.items() if re.fullmatch(pattern, name))
            pooled[family].append(pair)
    rows = []
    for family in filter(pooled.get, FAMILIES):
        error, std = np.array(pooled[family]).T
        goal = GOALS.get(family, np.inf)
        shown = error[std <= goal]
        unit, factor = ("samples", 1.0) if family in ("delay", "current control") else ("%", 100.0)
        median = f"{factor * np.median(shown):.3g} {unit} of {shown.size}" if shown.size else "none"
        limit = f"{factor * goal:g} {unit}" if np.isfinite(goal) else ""
        rows.append(
            [family, f"{100 * noise:g} %", limit, median, f"{factor * np.median(error):.3g} {unit} of {error.size}"]
        )
    return rows


def main() -> None:
    limit_blas_threads()
    parser = arguments(__doc__)
    parser.add_argument("--count", type=int, default=200, help="drives at each noise level")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--only", type=int, nargs="*", help="numbers of single drives")
    parser.add_argument("--noise", type=float, nargs="*", default=[1e-3, 1e-2])
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    numbers = options.only or range(options.count)
    optima, errors = [], []
    for noise in options.noise:
        jobs = [(options.seed, number, noise, options.starts) for number in numbers]
        runs: list[Run] = []
        with ProcessPoolExecutor(options.workers) as pool:
            for result in pool.map(examine, jobs):
                if isinstance(result, str):
                    print(f"left out: {result}", flush=True)
                    continue
                runs.append(result)
                print(f"{result.number:4d} {result.ratio:9.4g} {result.seconds:6.1f} s  {result.structure}", flush=True)
        for run in sorted((run for run in runs if run.ratio > ENOUGH), key=lambda run: -run.ratio):
            print(f"missed: {run.ratio:8.3g}  {run.number} {run.structure}, {run.outcome}\n            {run.text}")
        optima.append(optimum_row(options.seed, noise, runs))
        errors += error_rows(noise, runs)
    columns = ["seed, noise", "reached", "without backlash", "with backlash", "CPU s: median, mean, most"]
    found = Table(f"Optimum reached, seed {options.seed}", columns, optima)
    columns = ["family", "noise", "goal", "median error where the recording shows it", "of all"]
    publish("global-optimum", [found, Table(f"Errors, seed {options.seed}", columns, errors)], to_file=options.save)


if __name__ == "__main__":
    main()
