"""Does the fit of the true structure reach the true optimum? Random drives, from bounds found in the data only.

True structures are drawn from all of the paper's grammar, their parameters over two decades
(`brightgrey.excitation.random_drives`), the recording comes from the reference solver with white noise and rounding to
a quarter of it. A fit succeeds if its residual sum of squares is at most 1.02 times that of the true parameters.
Errors of parameters are medians over runs in which the recording shows the parameter: the standard deviation
by the fit is below the goal.
"""

from __future__ import annotations

import argparse
import re
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from brightgrey.estimation import fit, predict
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording, Signal
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.simulation.reference import UnsettledError, reference

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
    y = np.round((v + size * rng.standard_normal(v.size)) / step) * step
    t = e.dt * np.arange(e.samples)
    outputs = (Signal("velocity", "velocity", "rad/s"),)
    return Recording("made", t, u, y[None], Signal("torque", "input", "N m"), outputs), values


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


def wilson(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    share = hits / count
    centre = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * np.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    return centre - half, centre + half


def share(runs: list[Run]) -> str:
    """How many of `runs` reach the optimum, in words."""
    if not runs:
        return "none"
    hits = sum(run.ratio <= ENOUGH for run in runs)
    low, high = (100 * limit for limit in wilson(hits, len(runs)))
    return f"{hits} of {len(runs)} = {100 * hits / len(runs):.1f} % (95 % interval {low:.1f} to {high:.1f} %)"


def report(noise: float, runs: list[Run], lost: list[str]) -> None:
    print(f"\nnoise {100 * noise:g} %: the optimum is reached in {share(runs)}; {len(lost)} without reference")
    for text, inside in (("without", False), ("with", True)):
        print(f"  {text} backlash: {share([run for run in runs if ('backlash' in run.structure) == inside])}")
    seconds = sorted(run.seconds for run in runs)
    print(
        f"CPU time per fit: median {np.median(seconds):.2f} s, mean {np.mean(seconds):.2f} s, most {seconds[-1]:.1f} s"
    )
    for run in sorted(runs, key=lambda r: -r.ratio):
        if run.ratio > ENOUGH:
            print(f"  {run.ratio:8.3g}  {run.number} {run.structure}, {run.outcome}\n            {run.text}")
    pooled: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for run in runs:
        for name, pair in run.errors.items():
            family = next(f for f, pattern in FAMILIES.items() if re.fullmatch(pattern, name))
            pooled[family].append(pair)
    print("median error of parameters (of those that the recording shows to within the goal)")
    for family in FAMILIES:
        if pooled[family]:
            error, std = np.array(pooled[family]).T
            goal = GOALS.get(family, np.inf)
            shown = std <= goal
            unit = "samples" if family in ("delay", "current control") else "%"
            factor = 1.0 if unit == "samples" else 100.0
            print(
                f"  {family:16s} {factor * np.median(error):8.3g} {unit:8s} of all {len(error):4d},"
                f" {factor * np.median(error[shown]) if shown.any() else np.nan:8.3g} of {shown.sum()} shown,"
                f" goal {factor * goal:g}"
            )


def main() -> None:
    limit_blas_threads()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="drives at each noise level")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--only", type=int, nargs="*", help="numbers of single drives")
    parser.add_argument("--noise", type=float, nargs="*", default=[1e-3, 1e-2])
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    numbers = options.only or range(options.count)
    for noise in options.noise:
        jobs = [(options.seed, number, noise, options.starts) for number in numbers]
        with ProcessPoolExecutor(options.workers) as pool:
            results = []
            for result in pool.map(examine, jobs):
                results.append(result)
                if isinstance(result, Run):
                    line = f"{result.number:4d} {result.ratio:9.4g} {result.seconds:6.1f} s  {result.structure}"
                    print(line, flush=True)
        report(noise, [r for r in results if isinstance(r, Run)], [r for r in results if isinstance(r, str)])


if __name__ == "__main__":
    main()
