"""Measured recordings of real drives: the tables of docs/validation/real-recordings.md and the README.

    python bench/real_recordings.py [--starts N] [--only emps|mte360|seeds|structures|all|left-out]

Recordings are looked for in ../shared/data beside the repository, or in the folder named by BRIGHTGREY_DATA.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from brightgrey import Recording, Result, identify
from brightgrey.api.to_si import identification_task
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import PAPER, Structure
from brightgrey.numerics.number_format import significant, with_uncertainty
from brightgrey.recordings.window import cut_window
from brightgrey.report.text.tables import friction_width_text
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search import IdentificationTask
from brightgrey.search.decision import decide_structures
from brightgrey.search.lattice import Lattice
from support.measured import DATA, emps_recording, mte360_recording, two_mass_recordings
from support.results import Table, arguments, publish

EMPS = "one_mass+coulomb+viscous+gravity"
MTE360 = "two_mass+coulomb+viscous+gravity"
BEYOND_FRICTION = ("three_mass", "backlash", "current_control", "delay")  # left out for 32 structures
ONE_MASS = ("coulomb", "viscous", "stribeck", "gravity", "current_control", "delay")


def estimate(result: Result, name: str) -> str:
    part = result.model.parameters[name]
    half_width = (part.ci95[1] - part.ci95[0]) / 2 if part.ci95 else None
    value, shown = with_uncertainty(part.value, half_width, digits=3)
    remark = f" (at its {part.at_bound} bound)" if part.at_bound else ""
    return (f"{value} ± {shown}" if shown else value) + remark


def agreeing(result: Result) -> str:
    """Share of the starts that ended within 1 % of the best one's weighted RSS."""
    rss = [start.cost for start in result.fit.starts]
    return f"{sum(value <= 1.01 * min(rss) for value in rss)} of {len(rss)}"


def emps(starts: int) -> list[Table]:
    """Position of the EMPS from its force: width of friction's reversal estimated and given."""
    recording = emps_recording()
    free = identify(recording, EMPS, starts=starts)
    speed = free.model.settings.speed_scale
    runs = [(f"{friction_width_text(free.model.settings)}", free)]
    for share in (100.0, 1000.0):
        found = identify(recording, EMPS, f_tanh=share / speed, starts=starts)
        runs.append((f"within {significant(speed / share, 3)} m/s (given: the largest speed over {share:g})", found))
    rows = []
    for text, result in runs:
        fit = result.model.fit.train["qm"]
        values = [estimate(result, name) for name in ("J1", "f_v", "M_C", "M_G")]
        rows.append(
            [
                text,
                *values,
                f"{1e3 * fit.rmse:.3f}",
                f"{fit.fit_percent:.2f}",
                agreeing(result),
                result.model.outcome.kind,
            ]
        )
    header = [
        "friction reverses",
        "mass J1 in kg",
        "f_v in N s/m",
        "M_C in N",
        "M_G in N",
        "RMSE in mm",
        "fit in %",
    ]
    title = f"EMPS, `{EMPS}`, {recording.samples} samples"
    return [Table(title, [*header, "starts at the optimum", "outcome"], rows), emps_halves(recording, starts)]


def emps_halves(recording: Recording, starts: int) -> Table:
    """One half of the EMPS fitted, the other predicted: width of the reversal estimated, and the old default."""
    middle = float(recording.t[recording.samples // 2])
    halves = {"first": cut_window(recording, end=middle), "second": cut_window(recording, start=middle)}
    rows = []
    for name, train in halves.items():
        (test,) = (half for other, half in halves.items() if other != name)
        free = identify(train, EMPS, test=test, starts=starts)
        smooth = identify(train, EMPS, test=test, f_tanh=100.0 / free.model.settings.speed_scale, starts=starts)
        for result, text in ((free, friction_width_text(free.model.settings)), (smooth, "largest speed over 100")):
            fit = result.model.fit
            rows.append([name, text, f"{1e3 * fit.train['qm'].rmse:.3f}", f"{1e3 * fit.test['qm'].rmse:.3f}"])
    header = ["half fitted", "friction reverses", "RMSE in mm, fitted", "RMSE in mm, other half"]
    return Table(f"EMPS, `{EMPS}`, one half predicted from the other", header, rows)


def mte360(starts: int) -> list[Table]:
    """Motor cart of the MTE360 drive from its voltage: two masses against every one-mass structure."""
    recording = mte360_recording("velocity_response_1_5", "v1")
    two = identify(recording, MTE360, starts=starts)
    names = [
        "+".join(("one_mass", *chosen))
        for size in range(len(ONE_MASS) + 1)
        for chosen in itertools.combinations(ONE_MASS, size)
    ]
    ones = [identify(recording, name, starts=starts) for name in names]
    ones.sort(key=lambda result: result.model.fit.train["v1"].rmse or float("inf"))
    alike = next(r for r in ones if str(r.model.structure) == "one_mass+coulomb+viscous+gravity")
    rows = []
    for result, remark in (
        (two, ""),
        (ones[0], f"best of {len(ones)} one-mass structures"),
        (alike, "same friction and offset"),
    ):
        fit = result.model.fit.train["v1"]
        rows.append(
            [
                f"`{result.model.structure}`",
                remark,
                str(result.ranking[0].n_parameters),
                significant(fit.rmse),
                f"{fit.fit_percent:.2f}",
                f"{result.ranking[0].criterion:.0f}",
                agreeing(result),
                result.model.outcome.kind,
            ]
        )
    header = ["structure", "", "parameters", "RMSE in mm/s", "fit in %", "BIC", "starts at the optimum", "outcome"]
    parameters = [[n, estimate(two, n), two.model.parameters[n].unit] for n in two.model.parameters]
    return [
        Table("MTE360, velocity_response_1_5", header, rows),
        Table(f"MTE360, `{MTE360}`", ["parameter", "estimate", "unit"], parameters),
    ]


def seeds(starts: int, count: int = 20) -> list[Table]:
    """Share of `count` seeds that end within 1 % of the least RSS, without any bound given, at the `fast` level."""
    square, sine_1, sine_3 = two_mass_recordings().values()
    single = mte360_recording("single_axis_square_1_5", "v")
    rows = []
    for name, structure, recordings in (
        ("EMPS", EMPS, [emps_recording()]),
        ("MTE360 square", MTE360, [square]),
        ("MTE360 sine 1 Hz", MTE360, [sine_1]),
        ("MTE360 sine 3 Hz", MTE360, [sine_3]),
        ("MTE360 single axis", EMPS, [single]),
        ("MTE360 square and sine 3 Hz jointly", MTE360, [square, sine_3]),
    ):
        begin = time.process_time()
        test = sine_1 if len(recordings) > 1 else None
        results = [
            identify(recordings, structure, seed=k, starts=starts, level="fast", test=test) for k in range(count)
        ]
        seconds = (time.process_time() - begin) / count
        costs = [result.fit.cost for result in results]
        best = results[costs.index(min(costs))].model.fit
        percent = next(iter(best.train.values())).fit_percent
        unseen = f"{next(iter(best.test.values())).fit_percent:.2f}" if best.test else ""
        agree = sum(cost <= 1.01 * min(costs) for cost in costs)
        rows.append([name, f"`{structure}`", f"{agree} of {count}", f"{percent:.2f}", unseen, f"{seconds:.1f}"])
    header = ["recording", "structure", "seeds at the optimum", "fit in %", "sine 1 Hz, unseen", "CPU s per fit"]
    return [Table("Seeds at the optimum, nothing given", header, rows)]


def structures(exclude: tuple[str, ...]) -> list[Table]:
    """Minimal structures without some effects, and the verdict on a second mass."""
    square, sine_1, sine_3 = two_mass_recordings().values()
    lattice = Lattice.of(PAPER, exclude=exclude)
    rows = []
    for name, recordings in (
        ("EMPS", (emps_recording(),)),
        ("MTE360 single axis", (mte360_recording("single_axis_square_1_5", "v"),)),
        ("MTE360 square", (square,)),
        ("MTE360 square, sine 1 and 3 Hz jointly", (square, sine_1, sine_3)),
    ):
        began, clock = time.process_time(), time.perf_counter()
        with ThreadPoolExecutor(2) as workers:
            task = identification_task(recordings, None, {}, {}, None)
            found = decide_structures(task, PAPER, exclude=exclude, executor=workers).evidence
        card = next(c for c in found.cards if c.effect == "two_mass")
        minimal = ", ".join(f"`{j.structure}`" for j in found.minimal)
        cells = [
            f"{time.process_time() - began:.0f}",
            f"{time.perf_counter() - clock:.0f}",
            str(found.certificate.fitted),
        ]
        rows.append([name, minimal, f"{card.verdict}: {card.reason}", *cells])
    header = ["recording", "minimal", "second mass", "CPU s", "wall s, two workers", "fits"]
    return [Table(f"Structures, {lattice.size} candidates", header, rows)]


def left_out() -> list[Table]:
    """Each MTE360 recording with a second mass predicted from the two others, by the models found from them alone.

    All structures are decided, as `identify` does. One-mass structures are judged in hindsight: the one that predicts
    best counts, not the one that fits best.
    """
    recordings = two_mass_recordings()
    rows = []
    for name, test in recordings.items():
        train = tuple(r for other, r in recordings.items() if other != name)
        task = identification_task(train, None, {}, {}, None)
        with ThreadPoolExecutor(2) as workers:
            found = decide_structures(task, PAPER, executor=workers)
        judge = replace(task, recordings=(test,))

        def unseen(structure: Structure, values: Mapping[str, float], judge: IdentificationTask = judge) -> float:
            own = {n: np.array([values[n]]) for n in (*structure.parameters, FRICTION_WIDTH) if n in values}
            return judge.misfits(structure, own)[0].fit_percent

        ones = {s: unseen(s, f.values) for s, f in found.fitted.items() if s.masses == 1}
        one = max(ones, key=ones.__getitem__)
        card = next(c for c in found.evidence.cards if c.effect == "two_mass")
        predicted = [unseen(j.structure, j.values) for j in found.evidence.minimal]
        first, percent = f"`{found.evidence.minimal[0].structure}`", f"{predicted[0]:.1f}"
        others = f"{min(predicted):.1f} to {max(predicted):.1f} ({len(predicted)})"
        rows.append([name, first, f"{card.verdict}: {card.reason}", percent, others, f"`{one}`", f"{ones[one]:.1f}"])
    header = ["left out", "found", "second mass", "fit to the one left out in %", "of all minimal ones (how many)"]
    header += ["one-mass structure that predicts best", "its fit in %"]
    return [Table("MTE360, each recording predicted from the two others", header, rows)]


def main() -> int:
    limit_blas_threads()
    parser = arguments(__doc__)
    parser.add_argument("--starts", type=int, default=8, help="start points of each fit (default 8)")
    runs: dict[str, Callable[[int], list[Table]]] = {
        "emps": emps,
        "mte360": mte360,
        "seeds": seeds,
        "structures": lambda _: structures(BEYOND_FRICTION),
        "all": lambda _: structures(()),
        "left-out": lambda _: left_out(),
    }
    parser.add_argument("--only", choices=runs, help="one of the tables")
    options = parser.parse_args()
    if not DATA.is_dir():
        print(
            "no recordings: lay them to ../shared/data or name their folder in BRIGHTGREY_DATA",
            file=sys.stderr,
        )
        return 2
    for name, run in runs.items():
        if options.only in (None, name):
            began = time.perf_counter()
            publish("real-recordings", run(options.starts), to_file=options.save)
            print(f"({time.perf_counter() - began:.0f} s)\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
