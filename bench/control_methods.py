"""Kalman filter, limit cycles and fault detection on simulated and measured drives.

    python bench/control_methods.py consistency [--runs N] [--seed S]
    python bench/control_methods.py cycles [--runs N] [--seed S]
    python bench/control_methods.py faults [--runs N] [--seed S] [--structure S]
    python bench/control_methods.py emps

Recordings of `consistency` and `faults` come from the reference solver (random drives in plausible ranges, the torque
of the paper's experiment), with white noise of 0.05 % of the peak speed and quantisation of half of it.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from brightgrey import identify
from brightgrey.control.design.closed_loop import closed_loop
from brightgrey.control.design.controllers import OutputFeedback
from brightgrey.control.faults.detection import FaultCase, FaultFinding, detect_faults, fault_groups
from brightgrey.control.filters.extended_kalman import Noise, extended_kalman_filter
from brightgrey.control.filters.gaussian_sum import gaussian_sum_filter
from brightgrey.control.filters.setup import estimate_noise, prepare
from brightgrey.control.filters.unscented_kalman import unscented_kalman_filter
from brightgrey.control.limit_cycles.describing_function import predict_limit_cycles
from brightgrey.control.linear.analysis import analyse_system
from brightgrey.control.linear.margins import Compensator
from brightgrey.errors import BrightgreyError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import UnsettledError, compare_solvers, reference
from support.drives import rounded, simulated_recording
from support.measured import emps_recording
from support.results import Table, arguments, publish
from support.statistics import share

NOISE = 0.02  # rad/s
STEP = 0.01  # rad/s
SETTINGS = Settings(E.f_tanh, E.speed)
FAULTS = {"friction": 1.5, "backlash": 2.0, "load": 1.3}
MODEL_STD = 0.02  # relative error of the model's parameters, as an identification leaves it
ALL = "all"
FILTER_NAMES = {
    "extended_kalman_filter": "extended",
    "unscented_kalman_filter": "unscented",
    "gaussian_sum_filter": "sum of Gaussians",
}
FAULTY = ("two_mass+coulomb+viscous", "two_mass+coulomb+viscous+backlash")


def simulate(
    structure: Structure,
    values: dict[str, float],
    rng: np.random.Generator,
    *,
    every: int = 1,
    torque: float = 0.0,
    by_reference: bool = True,
    anywhere: bool = False,
) -> Recording:
    """Recording of a drive; `torque` is the size of a disturbance that is not recorded.

    With `anywhere` a gap stands anywhere at the start, its shaft relaxed; else the drive starts pushed forward.
    """
    u = E.torque()[::every]
    dt = E.dt * every
    pushed = u + torque * rng.normal(size=len(u))
    hold = "zoh" if torque else "linear"
    system = assemble(structure, values, E.f_tanh)
    x0 = system.rest(0.0, 0.0, float(u[0]))
    if anywhere:
        for k in range(1, 4):
            if f"lambda{k}" in system.state_names:
                x0[system.state_names.index(f"lambda{k}")] = at = -2.0 * values["alpha"] * rng.random()
                for j in range(k + 1, 5):
                    if f"q{j}" in system.state_names:
                        x0[system.state_names.index(f"q{j}")] = -at
    if by_reference:
        v = reference(structure, values, pushed, dt, f_tanh=E.f_tanh, hold=hold, x0=x0)[0]
    else:
        v = response(system, pushed, dt, x0, Settings(E.f_tanh, E.speed, hold=hold)).y[0, :, 0]
    return simulated_recording(u, rounded(v + NOISE * rng.normal(size=len(v)), STEP), dt=dt, hold=hold)


STRUCTURES = {
    "one_mass+coulomb+viscous+stribeck+gravity": (extended_kalman_filter,),
    "two_mass+coulomb+viscous": (extended_kalman_filter, unscented_kalman_filter),
    "three_mass+coulomb+viscous+stribeck": (extended_kalman_filter,),
    "two_mass+coulomb+viscous+stribeck+gravity+current_control+delay": (extended_kalman_filter,),
    "two_mass+coulomb+viscous+backlash": (extended_kalman_filter, gaussian_sum_filter),
    "two_mass+coulomb+viscous+stribeck+backlash+current_control+delay": (extended_kalman_filter, gaussian_sum_filter),
}


def consistency(runs: int, seed: int, name: str, by_reference: bool) -> list[list[str]]:
    """Share of runs whose summed NIS lies in its 95 % band. Every run has a drive and noises of its own."""
    torque = 0.05
    noise = Noise(torque, np.array([np.hypot(NOISE, STEP / np.sqrt(12.0))]))
    number = list(STRUCTURES).index(name)
    structure = Structure.parse(name)
    totals: dict[str, list[float]] = {run_filter.__name__: [] for run_filter in STRUCTURES[name]}
    spent = dict.fromkeys(totals, 0.0)
    samples = E.samples
    for first in range(0, runs, 100):
        drawn, recordings = [], []
        for run in range(first, min(first + 100, runs)):
            rng = np.random.default_rng([seed, number, run])
            values = random_values(structure.parameters, rng)
            try:
                options = {"torque": torque, "by_reference": by_reference, "anywhere": True}
                recordings.append(simulate(structure, values, rng, **options))
            except UnsettledError:
                continue
            drawn.append(values)
        arrays = {n: np.array([values[n] for values in drawn]) for n in structure.parameters}
        watched = prepare(structure, arrays, recordings, SETTINGS).filter_input
        for run_filter in STRUCTURES[name]:
            begun = time.process_time()
            totals[run_filter.__name__] += list(run_filter(watched, noise).nis.sum(axis=0))
            spent[run_filter.__name__] += time.process_time() - begun
    low, high = chi2.ppf([0.025, 0.975], samples)
    rows = []
    for text, found in totals.items():
        total = np.array(found)
        inside = (low < total) & (total < high)
        odd = ", ".join(f"{t / samples:.3g}" for t in np.sort(total[~inside]))
        std = float(np.std((total - samples) / np.sqrt(2.0 * samples)))
        counts = [share(int(inside.sum()), len(inside), percent=True), str(int(np.sum(total >= high)))]
        rows.append([f"`{name}`", FILTER_NAMES[text], *counts, f"{std:.2f}", f"{spent[text] / len(total):.2g}"])
        print(*rows[-1], f"mean NIS outside: {odd}", sep="; ", flush=True)
    return rows


def fundamental(y: np.ndarray, dt: float) -> tuple[float, float]:
    """Frequency in Hz and amplitude of the strongest oscillation."""
    y = y - y.mean()
    t = dt * np.arange(len(y))
    spectrum = np.abs(np.fft.rfft(y * np.hanning(len(y)), 8 * len(y)))
    first = spectrum.argmax() / (8 * len(y) * dt)

    def fitted(f: float) -> tuple[float, float]:
        M = np.column_stack([np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)])
        c = np.linalg.lstsq(M, y, rcond=None)[0]
        return float(((y - M @ c) ** 2).sum()), float(np.hypot(*c))

    best = minimize_scalar(lambda f: fitted(f)[0], bounds=(0.97 * first, 1.03 * first), method="bounded").x
    return float(best), fitted(best)[1]


def cycle(structure: str, rng: np.random.Generator) -> tuple[float, float] | None:
    """Relative errors of frequency and amplitude of one predicted stable limit cycle, None if there is none."""
    placed = Structure.parse(structure)
    values = {
        "J1": 0.004,
        "J2": 0.016,
        "c1": 5000.0,
        "d1": 2.0,
        "M_C": 0.05,
        "f_v": 0.01,
        "alpha": 0.01,
        "T_1": 2e-3,
        "T_d": 1e-3,
    }
    values = {n: values[n] * float(np.exp(rng.uniform(-0.3, 0.3))) for n in placed.parameters}
    dt, samples = 5e-4, 1600
    system = assemble(placed, values, E.f_tanh)
    # As much gain as makes the drive's most nervous piece unstable by 5 to 40 %.
    soft = Compensator.of([1.0, 5.0], [1.0, 0.0])
    edge = min(
        analyse_system(system, speed=10.0, contact=c).margins(soft, delay=dt / 2).gain for c in ("forward", "gap")
    )
    gain = edge * float(rng.uniform(1.05, 1.4))
    controller = Compensator.of([gain, 5.0 * gain], [1.0, 0.0])
    limit = np.inf if "backlash" in placed.names else 3.0
    found = predict_limit_cycles(
        system, controller, torque=(1e-2, 1e3), omega=(50.0, 4000.0), delay=dt / 2, limit=limit
    )
    stable = [c for c in found if c.stable]
    if not stable:
        return None
    start = system.rest()
    start[system.state_names.index("v1")] = float(stable[-1].outputs[0])
    settings = Settings(E.f_tanh, max(10.0 * float(stable[-1].outputs[0]), 1.0))
    try:
        run = closed_loop(
            system, OutputFeedback(controller, dt, np.zeros(samples)), samples, dt, settings, limit=limit, x0=start
        )
    except BrightgreyError:
        return np.inf, np.inf
    f, a = fundamental(run.y[samples // 2 :, 0], dt)
    return f / stable[-1].frequency - 1.0, a / float(stable[-1].outputs[0]) - 1.0


def cycles(runs: int, seed: int) -> Table:
    rows, good, predicted = [], 0, 0
    for name in (
        "two_mass+coulomb+viscous+current_control+delay",
        "two_mass+viscous+backlash+current_control+delay",
        "two_mass+coulomb+viscous+backlash+current_control+delay",
    ):
        errors = [e for i in range(runs) if (e := cycle(name, np.random.default_rng([seed, i])))]
        f, a = np.abs(np.array(errors)).T if errors else (np.zeros(0), np.zeros(0))
        within = int(np.sum((f <= 0.15) & (a <= 0.15)))
        sizes = [f"{100 * np.median(e):.1f} % ({100 * e.max():.0f} %)" if errors else "" for e in (f, a)]
        rows.append([f"`{name}`", share(within, len(errors), 0, percent=True), f"{len(errors)} of {runs}", *sizes])
        print(*rows[-1], sep="; ", flush=True)
        good, predicted = good + within, predicted + len(errors)
    rows.append(["all", share(good, predicted, 0, percent=True), f"{predicted} of {3 * runs}", "", ""])
    columns = ["loop", "within 15 % in both", "predicted", "error of frequency: median (worst)", "of amplitude"]
    return Table("Limit cycles", columns, rows)


def cases_of(structure: Structure, run: int, seed: int, by_reference: bool) -> list[tuple[str, FaultCase]] | None:
    """One drive, healthy and with each fault; None if it is chaotic. The model is off as after an identification."""
    rng = np.random.default_rng([seed, run])
    kinds = fault_groups(structure)
    truth = random_values(structure.parameters, rng)
    u, dt = E.torque()[::2], 2 * E.dt
    options = {"f_tanh": E.f_tanh, "outputs": ("velocity", "position"), "both": False}
    if "backlash" in structure.names and compare_solvers(structure, truth, u, dt, **options).chaotic:
        return None
    model = {n: v * float(np.exp(MODEL_STD * rng.normal())) for n, v in truth.items()}
    std = {n: MODEL_STD * abs(v) for n, v in model.items()}
    noise = estimate_noise(
        structure, model, simulate(structure, truth, rng, every=2, by_reference=by_reference), SETTINGS
    )
    cases = []
    for broken in (None, *kinds):
        factor = FAULTS[broken.subject] if broken else 1.0
        now = {n: v * (factor if broken and n in kinds[broken] else 1.0) for n, v in truth.items()}
        recording = simulate(structure, now, rng, every=2, by_reference=by_reference)
        cases.append((broken.subject if broken else "", FaultCase(model, recording, noise, std)))
    return cases


def faults(name: str, runs: int, seed: int, by_reference: bool) -> Table:
    """Detections and false alarms; printed anew after every twenty drives."""
    structure = Structure.parse(name)
    cases: list[tuple[str, FaultCase]] = []
    results: list[tuple[FaultFinding, ...]] = []
    left_out = 0
    for first in range(0, runs, 20):
        drawn: list[tuple[str, FaultCase]] = []
        for run in range(first, min(first + 20, runs)):
            try:
                found = cases_of(structure, run, seed, by_reference)
            except UnsettledError:
                found = None
            left_out += found is None
            drawn += found or []
        cases += drawn
        results += detect_faults(structure, SETTINGS, [case for _, case in drawn])
        print(f"{name}: {min(first + 20, runs) - left_out} drives, seed {seed}, {left_out} chaotic ones left out")
        rows = fault_rows(structure, cases, results)
        print(*("; ".join(row) for row in rows), sep="\n", flush=True)
    print_wrong(structure, cases, results)
    columns = ["fault", "detected", "not decidable", "alarmed without cause"]
    chaotic = f", {left_out} chaotic drives left out" if left_out else ""
    return Table(f"Faults of `{name}`, seed {seed}{chaotic}", columns, rows)


def fault_rows(
    structure: Structure, cases: list[tuple[str, FaultCase]], results: list[tuple[FaultFinding, ...]]
) -> list[list[str]]:
    """Shares of detections and false alarms."""
    rows = []
    for subject in (fault.subject for fault in fault_groups(structure)):
        own = [(b, next(f for f in fs if f.subject == subject)) for (b, _), fs in zip(cases, results, strict=True)]
        guilty = [f for b, f in own if b == subject]
        others = [f for b, f in own if b != subject]
        hits, false = (sum(f.verdict == "changed" for f in part) for part in (guilty, others))
        undecided = sum(f.verdict == "not decidable" for f in guilty)
        detected, alarmed = share(hits, len(guilty), percent=True), share(false, len(others), percent=True)
        rows.append([f"{subject} × {FAULTS[subject]:g}", detected, str(undecided), alarmed])
    alarms = [any(f.verdict == "changed" for f in fs) for (b, _), fs in zip(cases, results, strict=True) if not b]
    return [*rows, ["none (healthy recordings)", "", "", share(sum(alarms), len(alarms), percent=True)]]


def print_wrong(
    structure: Structure, cases: list[tuple[str, FaultCase]], results: list[tuple[FaultFinding, ...]]
) -> None:
    """Print every missed fault and every false alarm."""
    for (broken, case), findings in zip(cases, results, strict=True):
        for f in findings:
            if (broken == f.subject) != (f.verdict == "changed"):
                brief = {n: float(f"{v:.2g}") for n, v in case.values.items()}
                print(f"    {broken or 'healthy'}: {f.text}  {brief}")


def emps() -> list[Table]:
    """The filter over the measured axis: size, colour and bias of the innovations."""
    recording = emps_recording()
    model = identify(recording, "one_mass+coulomb+viscous+gravity", starts=2, level="fast").model
    structure, values, settings = model.structure, model.values_si(), model.settings_si()
    noise = estimate_noise(structure, values, recording, settings)
    prepared = prepare(structure, values, recording, settings)
    found = extended_kalman_filter(prepared.filter_input, noise)
    white = found.normalised_innovations[100:, 0, 0]
    speed = found.z[100:, 0, 1]
    sizes = [
        ["disturbing force per sample", f"{noise.torque:.3g} N"],
        ["position noise", f"{noise.outputs[0]:.3g} m"],
        ["mean NIS", f"{float((white**2).mean()):.3f}"],
        ["share of NIS above 3.84", f"{float((white**2 > 3.84).mean()):.4f}"],
    ]
    for lag in (1, 2, 3, 4, 5, 10, 100):
        r = float(np.mean(white[lag:] * white[:-lag]) / np.mean(white**2))
        sizes.append([f"autocorrelation at lag {lag}", f"{r:+.3f}"])
    sizes.append(["limit of a white autocorrelation", f"{1.96 / np.sqrt(len(white)):.3f}"])
    fast, parts = np.abs(speed).max(), []
    for text, where in (
        ("forward", speed > 0.1 * fast),
        ("backward", speed < -0.1 * fast),
        ("near standstill", np.abs(speed) <= 0.1 * fast),
    ):
        w = white[where]
        parts.append([text, f"{w.mean():+.3f} ± {1.96 * w.std() / np.sqrt(len(w)):.3f}", f"{w.std():.3f}", str(len(w))])
    return [
        Table("Innovations of EMPS", ["quantity", "value"], sizes),
        Table("Innovations of EMPS by motion", ["motion", "mean", "standard deviation", "samples"], parts),
    ]


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("what", choices=("consistency", "cycles", "faults", "emps"))
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--structure", default=ALL)
    parser.add_argument("--reference", action="store_true", help="simulate by the reference solver, not the kernel")
    options = parser.parse_args()
    if options.what == "consistency":
        names = [name for name in STRUCTURES if options.structure in (name, ALL)]
        rows = [r for name in names for r in consistency(options.runs, options.seed, name, options.reference)]
        columns = ["structure", "filter", "NIS within its 95 % band", "above it", "standard deviation", "s each"]
        tables = [Table("Consistency of the filters", columns, rows)]
    elif options.what == "cycles":
        tables = [cycles(options.runs, options.seed)]
    elif options.what == "faults":
        names = FAULTY if options.structure == ALL else (options.structure,)
        tables = [faults(name, options.runs, options.seed, options.reference) for name in names]
    else:
        tables = emps()
    publish("control", tables, to_file=options.save)


if __name__ == "__main__":
    main()
