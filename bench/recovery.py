"""Does the tool find the true structure? Random drives of the paper's grammar, all candidates fitted and weighed.

    python bench/recovery.py run 0 50 --noise 0.01 --out recovery.jsonl    drives 0 to 49, added to the file
    python bench/recovery.py run 0 50 --noise 0.01 --masses 2 --without backlash delay
    python bench/recovery.py table --out recovery.jsonl

A drive is known by its number: true structure (of the candidates), values over wide ranges
(`brightgrey.excitation.random_drives`), motion (reversing, chirp, multisine, in turn), colour of the noise, encoder
or not. Data come from the reference solver. `--noise` is the standard deviation over the peak speed. `run` skips what
the file already holds, so that several may add to one file; rows that docs/results.md tells of are kept in
bench/recovery-18.jsonl. Held-out error is that on another motion of the same drive with the same noise. An effect
matters if removing it from the true structure and fitting anew raises that error by more than 5 % (noise counts as
at least 1e-4 of the standard deviation, or nothing but rounding would be left to compare with).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from brightgrey import __version__
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure
from brightgrey.paper.repetitions import wilson_interval
from brightgrey.recordings import Recording, Signal
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.evidence import Evidence, assess_effects, has
from brightgrey.search.exhaustive import fit_all
from brightgrey.search.fitting import Fitted
from brightgrey.search.lattice import added_effects, contains, one_smaller
from brightgrey.search.task import IdentificationTask
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import UnsettledError, reference

Array = NDArray[np.float64]
MOTIONS = ("reversing", "chirp", "multisine")
POLE = 0.9  # of the coloured noise
MATTERS = 1.05
REACHED = 1.02  # times the RSS at the true values
FLOOR = 1e-4


def torque(motion: str, rng: np.random.Generator) -> Array:
    """Excitation in N m, as large as that of the paper's experiment and as long."""
    e = PAPER_EXPERIMENT
    paper = e.torque()
    peak, t = float(np.abs(paper).max()), e.dt * np.arange(e.samples)
    duration = e.samples * e.dt
    if motion == "reversing":
        return np.round(paper, 3)
    if motion == "chirp":  # logarithmic from 1 to 100 Hz
        rate = np.log(100.0) / duration
        u = np.sin(2.0 * np.pi * np.expm1(rate * t) / rate)
    else:  # the first 60 harmonics of the recording's length; lower ones are stronger, to reach about the same speed
        k = np.arange(1, 61)
        phase = rng.uniform(0.0, 2.0 * np.pi, k.size)
        u = np.sum(np.sin(2.0 * np.pi * k[:, None] * t / duration + phase[:, None]) / np.sqrt(k)[:, None], axis=0)
    ramp = np.minimum(1.0, t / 0.02)  # from rest
    return np.round(peak * ramp * u / np.abs(u).max(), 3)


def coloured(count: int, pole: float, rng: np.random.Generator) -> Array:
    """Noise of unit variance: white, or an autoregression of order one."""
    white = rng.standard_normal(count + 200)
    return np.asarray(lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[200:])


class Drive:
    """One true drive with two motions; `y` are its speeds without noise."""

    def __init__(self, seed: int, number: int, candidates: Sequence[Structure]) -> None:
        rng = np.random.default_rng([seed, number])
        self.seed, self.number = seed, number
        self.truth = candidates[int(rng.integers(len(candidates)))]
        self.values = random_values(self.truth.parameters, rng)
        self.motion = MOTIONS[number % 3]
        self.pole = POLE if rng.random() < 0.5 else 0.0
        self.encoder = bool(rng.random() < 1.0 / 3.0)
        kinds = (self.motion, MOTIONS[(number + 1) % 3])
        self.u = [torque(kind, rng) for kind in kinds]
        e = PAPER_EXPERIMENT
        self.y = [reference(str(self.truth), self.values, u, e.dt, f_tanh=e.f_tanh)[0] for u in self.u]

    def recordings(self, noise: float) -> list[Recording]:
        """Recording to identify from, and another one to test on."""
        e, made = PAPER_EXPERIMENT, []
        rng = np.random.default_rng([self.seed, self.number, round(1e6 * noise)])
        for name, u, v in zip(("train", "test"), self.u, self.y, strict=True):
            size = noise * float(np.abs(self.y[0]).max())
            y = v + size * coloured(v.size, self.pole, rng)
            if self.encoder:  # counts that are as coarse as a hundredth of the peak at most
                step = max(1e-3 * float(np.abs(self.y[0]).max()), 0.5 * size)
                y = np.round(y / step) * step
            t = e.dt * np.arange(v.size)
            outputs = (Signal("velocity", "velocity", "rad/s"),)
            made.append(Recording(name, t, u, y[None], Signal("torque", "input", "N m"), outputs))
        return made


def held_out(task: IdentificationTask, fitted: Mapping[Structure, Fitted], test: Recording) -> dict[Structure, float]:
    """Mean squared error of every structure on another recording, with the floor."""
    other = IdentificationTask((test,), task.scales, task.settings)
    floor = (FLOOR * float(test.y.std())) ** 2
    found = {}
    for s, f in fitted.items():
        values = {name: np.array([f.values.get(name, v)]) for name, v in {**task.default_start(s), **f.values}.items()}
        problem = SimulationErrorProblem.of(s, other.recordings, initial="rest")
        cost = float(problem.costs(values, other.settings)[0])
        found[s] = cost / problem.weights[0] ** 2 / test.samples + floor
    return found


def effective(residual: Array) -> float:
    """Samples that tell a variance as well as these: N / (1 + 2 sum of rho^2), lags up to a fifth of them."""
    n = residual.size
    r = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    c = np.fft.irfft(spectrum)[: n // 5]
    rho = c[1:] / c[0] if c[0] > 0.0 else np.zeros(1)
    return float(max(n / (1.0 + 2.0 * np.sum(np.maximum(rho**2 - 1.0 / n, 0.0))), 20.0))


def criteria(
    task: IdentificationTask, fitted: Mapping[Structure, Fitted], error: Mapping[Structure, float]
) -> dict[str, dict[Structure, float]]:
    """All criteria of all structures; less is better."""
    (r,) = task.recordings
    best = min(fitted.values(), key=lambda f: (f.cost, f.free))
    problem = task.problem(best.structure)
    values = {name: np.array([v]) for name, v in {**task.default_start(best.structure), **best.values}.items()}
    n = r.samples
    m = effective(problem.residuals(values, task.settings)[:, 0])
    floor = float(r.resolution[0] * problem.weights[0]) ** 2 / 12.0
    out: dict[str, dict[Structure, float]] = {}
    for s, f in fitted.items():
        mse, d = max(f.cost / n, floor), f.free
        for name, value in (
            ("fitness (19)", mse * (1.0 + 2.0 * d)),
            ("BIC, N", n * np.log(mse) + d * np.log(n)),
            ("BIC, effective N", m * np.log(mse) + d * np.log(m)),
            ("AICc, effective N", m * np.log(mse) + 2.0 * d + 2.0 * d * (d + 1.0) / max(m - d - 1.0, 1.0)),
            ("held-out error", error[s]),
        ):
            out.setdefault(name, {})[s] = float(value)
    return out


def visible(structure: Structure, truth: Structure, optional: Iterable[str]) -> bool:
    """Whether `structure` is within the truth, and all that it lacks is optional."""
    if not contains(truth, structure):
        return False
    missing = {str(p) for p in truth.placed if not p.effect.masses} - set(structure.names)
    masses = {f"{('one', 'two', 'three', 'four')[k]}_mass" for k in range(structure.masses, truth.masses)}
    return missing | masses <= set(optional)


def examine(drive: Drive, noise: float, candidates: Sequence[Structure], pool: ThreadPoolExecutor) -> dict[str, object]:
    """One row of the file."""
    train, test = drive.recordings(noise)
    known = scales([train])
    settings = Settings(f_tanh=PAPER_EXPERIMENT.f_tanh, speed_scale=known.speed, level="fast")
    task = IdentificationTask((train,), known, settings)
    begin = time.process_time()
    fitted = fit_all(task, candidates, seed=drive.seed, executor=pool)
    middle = time.process_time()
    found = assess_effects(task, fitted, seed=drive.seed)
    seconds = [middle - begin, time.process_time() - middle]
    return row(drive, noise, task, fitted, found, test) | {"seconds": [round(s, 1) for s in seconds]}


def row(
    drive: Drive,
    noise: float,
    task: IdentificationTask,
    fitted: Mapping[Structure, Fitted],
    found: Evidence,
    test: Recording,
) -> dict[str, object]:
    """What is kept of one drive at one noise."""
    truth, structures = drive.truth, [j.structure for j in found.minimal]
    error = held_out(task, fitted, test)
    first = {}
    for name, values in criteria(task, fitted, error).items():
        winner = min(values, key=lambda s: (values[s], fitted[s].free))
        first[name] = "truth" if winner == truth else "visible" if visible(winner, truth, found.optional) else "other"
    first["evidence"] = (
        "truth" if structures[0] == truth else "visible" if visible(structures[0], truth, found.optional) else "other"
    )
    matters = {
        name: float(np.sqrt(error[s] / error[truth]))
        for s in one_smaller(truth, fitted)
        for name in added_effects(truth, s)
    }
    problem = task.problem(truth)
    exact = {name: np.array([value]) for name, value in drive.values.items()}
    exact |= {part.name: np.clip([0.0], part.low, part.high) for part in problem.unknown_initial}
    return {
        "code": revision(),
        "seed": drive.seed,
        "number": drive.number,
        "noise": noise,
        "truth": str(truth),
        "motion": drive.motion,
        "pole": drive.pole,
        "encoder": drive.encoder,
        "values": drive.values,
        "candidates": len(fitted),
        "reached": fitted[truth].cost / max(float(problem.costs(exact, task.settings)[0]), 1e-300),
        "minimal": [str(s) for s in structures],
        "optional": list(found.optional),
        "verdicts": {c.effect: c.verdict for c in found.cards},
        "reasons": {c.effect: c.reason for c in found.cards},
        "matters": matters,
        "covered": any(visible(s, truth, found.optional) for s in structures),
        "first": first,
    }


@cache
def revision() -> str:
    """Of the code that makes the rows; without a repository, of the package."""
    asked = ["git", "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(asked, cwd=Path(__file__).parent, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return __version__
    return done.stdout.strip()


def marks(r: Mapping) -> list[str]:
    """What is wrong with a row."""
    truth = PAPER.parse(r["truth"])
    wrong = [e for e, v in r["verdicts"].items() if v == "needed" and not has(truth, e)]
    lost = [e for e, v in r["verdicts"].items() if v == "not needed" and r["matters"].get(e, 0.0) > MATTERS]
    missed = [] if r["covered"] else ["LACKS WHAT DOES NOT MATTER" if covered_but_for_trifles(r) else "NOT COVERED"]
    return missed + [f"NEEDED BUT ABSENT {e}" for e in wrong] + [f"NOT NEEDED BUT MATTERS {e}" for e in lost]


def line(r: Mapping) -> str:
    """One drive in words."""
    kind = f"{r['motion']}{' coloured' if r['pole'] else ''}{' encoder' if r['encoder'] else ''}"
    return (
        f"{r['number']:4d} {r['noise']:5g} {r['truth']} ({kind}) {r['seconds']} s, reached {r['reached']:.4g}:"
        f" {len(r['minimal'])} minimal, first {r['first']['evidence']} {', '.join(marks(r))}"
    )


def rate(hits: Sequence[bool], digits: int = 0) -> str:
    """Share with Wilson's 95 % interval."""
    if not hits:
        return "none"
    low, high = wilson_interval(sum(hits), len(hits))
    return f"{sum(hits)} of {len(hits)} ({100 * low:.{digits}f} to {100 * high:.{digits}f} %)"


def table(rows: Sequence[Mapping]) -> None:
    """Print everything that was collected, in Markdown, and every row with something wrong."""
    drives = len({(r["seed"], r["number"]) for r in rows})
    gaps = sum(has(PAPER.parse(r["truth"]), "backlash") for r in rows)
    print(f"{len(rows)} rows of {drives} drives, {gaps} rows with a gap")
    if not rows:
        return
    levels = sorted({r["noise"] for r in rows})
    columns = {f"{100 * noise:g} %": [r for r in rows if r["noise"] == noise] for noise in levels} | {"all": rows}
    asked: dict[str, Callable[[Sequence[Mapping]], str]] = {
        "a minimal structure ⊆ truth ⊆ it ∪ optional": lambda some: rate([r["covered"] for r in some], 1),
        "... or all it lacks does not matter": lambda some: rate([covered_but_for_trifles(r) for r in some], 1),
        "minimal structures, median (most)": lambda some: sizes([len(r["minimal"]) for r in some]),
        "optimum of the truth reached": lambda some: rate([r["reached"] <= REACHED for r in some]),
        "effects called *needed* that are there": lambda some: rate(flat(by_effect(some, "needed")), 1),
        "effects that matter called *not needed*": lambda some: rate(flat(by_effect(some, "not needed")), 1),
        "truth first by evidence": lambda some: rate([r["first"]["evidence"] == "truth" for r in some]),
    }
    for name in reversed(rows[0]["first"]):
        asked[f"truth or its visible part first by {name}"] = lambda some, name=name: rate(
            [r["first"][name] != "other" for r in some]
        )
    print_table("", columns, {what: [cell(some) for some in columns.values()] for what, cell in asked.items()})
    effects = list(rows[0]["verdicts"])
    for title, hits in (
        ("called *needed*: is there", lambda some: by_effect(some, "needed")),
        ("is there: called *needed*", recalled),
        ("matters: called *not needed*", lambda some: by_effect(some, "not needed")),
    ):
        found = [hits(some) for some in columns.values()]
        print_table(title, columns, {f"`{e}`": [rate(one.get(e, [])) for one in found] for e in effects})
    seconds = [sum(r["seconds"]) for r in rows]
    mean, median = np.mean(seconds), np.median(seconds)
    print(f"\nCPU seconds of a row: mean {mean:.0f}, median {median:.0f}, most {max(seconds):.0f}\n")
    for r in filter(marks, rows):
        print(line(r))


def print_table(title: str, columns: Collection[str], rows: Mapping[str, Sequence[str]]) -> None:
    """Print a Markdown table."""
    print(f"\n{title}\n" if title else "")
    print(f"| | {' | '.join(columns)} |")
    print("|" + "---|" * (1 + len(columns)))
    for name, cells in rows.items():
        print(f"| {' | '.join((name, *cells))} |")


def flat(hits: Mapping[str, Sequence[bool]]) -> list[bool]:
    """Of all effects together."""
    return [h for some in hits.values() for h in some]


def sizes(counts: Sequence[int]) -> str:
    """Median and largest."""
    return f"{np.median(counts):g} ({max(counts)})"


def recalled(rows: Sequence[Mapping]) -> dict[str, list[bool]]:
    """Of effects that are there: whether each is called needed."""
    found: dict[str, list[bool]] = {}
    for r in rows:
        truth = PAPER.parse(r["truth"])
        for effect, verdict in r["verdicts"].items():
            if has(truth, effect):
                found.setdefault(effect, []).append(verdict == "needed")
    return found


def covered_but_for_trifles(r: Mapping) -> bool:
    """Whether a minimal structure lies within the truth, and what it lacks is optional or does not matter."""
    known = {*r["optional"], *(effect for effect, rise in r["matters"].items() if rise <= MATTERS)}
    return any(visible(PAPER.parse(s), PAPER.parse(r["truth"]), known) for s in r["minimal"])


def by_effect(rows: Sequence[Mapping], what: str) -> dict[str, list[bool]]:
    """Of effects called needed: whether each is there. Of those that matter: whether each is called not needed."""
    found: dict[str, list[bool]] = {}
    for r in rows:
        truth = PAPER.parse(r["truth"])
        for effect, verdict in r["verdicts"].items():
            if what == "needed" and verdict == "needed":
                found.setdefault(effect, []).append(has(truth, effect))
            elif what == "not needed" and r["matters"].get(effect, 0.0) > MATTERS:
                found.setdefault(effect, []).append(verdict == "not needed")
    return found


def run(options: argparse.Namespace) -> None:
    revision()  # before anybody changes it while rows are made
    candidates = [
        s for s in PAPER.structures() if s.masses <= options.masses and not set(s.names) & set(options.without)
    ]
    done = {(r["seed"], r["number"], r["noise"]) for r in read(options.out)}
    with ThreadPoolExecutor(options.workers) as pool, options.out.open("a") as file:
        for number in range(options.first, options.last):
            left = [noise for noise in options.noise if (options.seed, number, noise) not in done]
            if not left:
                continue
            try:
                drive = Drive(options.seed, number, candidates)
            except UnsettledError as why:
                print(f"{number:4d} left out: {why}", flush=True)
                continue
            for noise in left:
                r = examine(drive, noise, candidates, pool)
                file.write(json.dumps(r) + "\n")
                file.flush()
                print(line(r), flush=True)


def read(path: Path) -> list[dict]:
    """Rows collected so far."""
    return [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []


def main() -> None:
    limit_blas_threads()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("run", "table"))
    parser.add_argument("first", type=int, nargs="?", default=0, help="number of the first drive")
    parser.add_argument("last", type=int, nargs="?", default=10, help="and of the one after the last")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=float, nargs="*", default=[0.0, 1e-3, 1e-2, 5e-2])
    parser.add_argument("--masses", type=int, default=4, help="at most, in all candidates")
    parser.add_argument("--without", nargs="*", default=[], help="effects that no candidate has")
    parser.add_argument("--workers", type=int, default=1, help="threads")
    parser.add_argument("--out", type=Path, default=Path("recovery.jsonl"))
    options = parser.parse_args()
    if options.what == "run":
        run(options)
    table(read(options.out))


if __name__ == "__main__":
    main()
