"""Checks of recordings: what they find among made faults, and what they say of recordings without one.

    python bench/recording_faults.py drives 0 500 --seed 61         simulate drives, kept in a file of the seed
    python bench/recording_faults.py table --seed 61 [--save]       faults on them, and the tables

A drive has a random structure of the paper's, random values, one of three motions, 0.1 to 1 % of noise and, in turn, a
sensor of velocity, of position, or both. Each fault has a size, uniform in the logarithm. A fault *matters* where it
moves a parameter of the true structure by more than two standard deviations. It is named by a check, or by a symptom of
the fit of that structure. No test names more than an ideal one, which knows the true structure and the noise. No check
of two outputs names more than an ideal one, which knows the true motion and the noise. Their powers are computed where
a fault adds something to a signal.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular, toeplitz
from scipy.signal import lfilter
from scipy.special import ndtr

from brightgrey import Recording, Signal, check, estimation, read_recording
from brightgrey.arrays import Array
from brightgrey.errors import BrightgreyError
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.numerics.distributions import norm
from brightgrey.recordings.checks.checkup import all_checks
from brightgrey.recordings.checks.examined import Examined
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.simulation.reference import UnsettledError, reference
from support.drives import AR_POLE, MOTIONS, SHARPNESS, coloured_noise, excitation
from support.measured import DATA
from support.results import RESULTS, Table, publish
from support.statistics import share

DT = PAPER_EXPERIMENT.dt
SENSORS = (("velocity",), ("position",), ("position", "velocity"))
MOVED = 2.0
"""Standard deviations by which a fault that matters moves a parameter."""
CHECK_ERRORS = 3.0
"""Standard errors from which the check of two outputs names a delay."""
IDEAL_LEVEL = 1e-3
"""Probability by chance of the ideal test."""


@dataclass(frozen=True)
class Drive:
    """A simulated drive without noise."""

    number: int
    structure: str
    names: tuple[str, ...]
    values: Array
    f_tanh: float
    u: Array
    position: Array
    velocity: Array


def simulated(seed: int, number: int) -> Drive:
    """Simulate one drive by the reference solver."""
    rng = np.random.default_rng([seed, number])
    structures = list(PAPER.structures())
    truth = structures[int(rng.integers(len(structures)))]
    values = random_values(truth.parameters, rng)
    u = excitation(MOTIONS[number % 3], rng)
    f_tanh = SHARPNESS[number % len(SHARPNESS)] / PAPER_EXPERIMENT.speed
    y = reference(str(truth), values, u, DT, f_tanh=f_tanh, outputs=("position", "velocity"))
    return Drive(number, str(truth), tuple(values), np.array(list(values.values())), f_tanh, u, y[0], y[1])


def file_of(seed: int) -> Path:
    """File of the simulated drives of a seed; they are made anew in minutes, and not kept in the repository."""
    return Path(__file__).parent / "cache" / f"recording_faults_{seed}.npz"


def read_drives(path: Path) -> dict[int, Drive | None]:
    """Drives of a file by number, None for one that the reference cannot settle; none if there is no file."""
    if not path.exists():
        return {}
    plain = np.load(path, allow_pickle=True)["drives"].item()
    return {number: Drive(**fields) if fields else None for number, fields in plain.items()}


def drives(seed: int, first: int, last: int) -> list[Drive]:
    """Drives that the file of the seed holds, after those that lack have been added."""
    path = file_of(seed)
    kept = read_drives(path)
    for number in range(first, last):
        if number in kept:
            continue
        try:
            kept[number] = simulated(seed, number)
        except UnsettledError:
            kept[number] = None
        if number % 10 == 9 or number == last - 1:
            path.parent.mkdir(exist_ok=True)
            plain = {n: asdict(d) if d else None for n, d in kept.items()}
            np.savez_compressed(path, drives=np.array(plain, dtype=object))
            print(f"{number + 1} drives", flush=True)
    return [drive for number, drive in sorted(kept.items()) if drive is not None and first <= number < last]


@dataclass(frozen=True)
class Taken:
    """A recording in the making: noise and sensors, before a fault."""

    drive: Drive
    u: Array
    y: dict[str, Array]
    rng: np.random.Generator

    def recording(self, u: Array | None = None, **outputs: Array) -> Recording:
        """A recording with another input or other outputs."""
        y = {**self.y, **outputs}
        u = self.u if u is None else u
        signals = tuple(Signal(kind, kind, {"position": "rad", "velocity": "rad/s"}[kind]) for kind in y)
        t = DT * np.arange(u.size)
        return Recording(f"{self.drive.number}", t, u, np.array(list(y.values())), Signal("u", "input", "N m"), signals)

    @property
    def last(self) -> str:
        """Kind of the last output."""
        return list(self.y)[-1]

    @property
    def noise(self) -> float:
        """Standard deviation of the noise of the last output."""
        return float(np.std(self.y[self.last] - getattr(self.drive, self.last)))


def taken(seed: int, drive: Drive) -> Taken:
    """Add noise, and in a third of the drives an encoder."""
    rng = np.random.default_rng([seed, drive.number, 1])
    size = float(np.exp(rng.uniform(np.log(1e-3), np.log(1e-2))))
    pole = AR_POLE if rng.random() < 0.5 else 0.0
    encoder = rng.random() < 1.0 / 3.0
    y = {}
    for kind in SENSORS[drive.number // 3 % 3]:
        x = getattr(drive, kind)
        peak = float(np.abs(x).max())
        y[kind] = x + size * peak * coloured_noise(x.size, pole, rng)
        if encoder:
            step = max(1e-3 * peak, 0.5 * size * peak)
            y[kind] = np.round(y[kind] / step) * step
    return Taken(drive, drive.u, y, rng)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw uniformly in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes
    ----------
    name : str
    make : callable
        ``make(taken, size)`` gives the recording with the fault.
    sizes : (float, float)
        Smallest and largest size.
    unit : str
        What the size is.
    checks : tuple of str
        Names of the checks that find it, of which one has to say at least `grade`.
    grades : tuple of str
    needs : str
        Output that the recording has to have; ``both`` for two of them, and empty for any.
    symptoms : tuple of str
        Titles of the symptoms of a fit that name it.
    adds : bool
        True if it adds something to a signal, so that the power of an ideal test is known.
    """

    name: str
    make: Callable[[Taken, float], Recording]
    sizes: tuple[float, float]
    unit: str
    checks: tuple[str, ...]
    grades: tuple[str, ...] = ("stop", "mind")
    needs: str = ""
    symptoms: tuple[str, ...] = ()
    adds: bool = False


def late(y: Array, seconds: float) -> Array:
    """A signal that comes later."""
    k = np.arange(y.size, dtype=float)
    return np.interp(k - seconds / DT, k, y)


def setpoint(x: Array, parts: float) -> Array:
    """A planned course near a signal: cubic polynomials, printed with six digits."""
    knots = np.linspace(0, x.size - 1, round(parts) + 1)
    planned = CubicSpline(knots, np.interp(knots, np.arange(x.size), x))(np.arange(x.size))
    step = 10.0 ** (np.floor(np.log10(np.ptp(planned))) - 6)
    return np.round(planned / step) * step


def repeated(taken: Taken, size: float) -> Array:
    """The last output with a part of its samples repeated."""
    y = taken.y[taken.last].copy()
    for k in np.flatnonzero(taken.rng.random(y.size) < size):
        y[k] = y[k - 1] if k else y[k]
    return y


def outliers(taken: Taken, size: float) -> Array:
    """The last output with three outliers."""
    y = taken.y[taken.last].copy()
    at = taken.rng.choice(y.size - 20, 3, replace=False) + 10
    y[at] += size * np.ptp(y) * taken.rng.choice([-1.0, 1.0], 3)
    return y


def with_last(taken: Taken, y: Array) -> Recording:
    """The recording with another last output."""
    return taken.recording(**{taken.last: y})


def differenced(taken: Taken, size: float) -> Recording:
    """A velocity from the differences of an encoder, of so many counts per sample at the largest speed."""
    step = float(np.abs(taken.drive.velocity).max()) * DT / size
    counts = np.round(taken.drive.position / step + taken.rng.random())
    return taken.recording(velocity=np.diff(counts, prepend=counts[0]) * step / DT)


def lost(taken: Taken, size: float) -> Recording:
    """A part of the recording is lost, and its time is closed."""
    r = taken.recording()
    count = max(1, round(size * r.samples))
    at = int(taken.rng.integers(r.samples // 4, r.samples // 2))
    kept = np.r_[0:at, at + count : r.samples]
    return replace(r, t=r.t[: kept.size], u=r.u[kept], y=r.y[:, kept], resolution=np.empty(0))


def started(taken: Taken, size: float) -> Recording:
    """The recording begins late."""
    r = taken.recording()
    kept = slice(int(size * r.samples), None)
    return replace(r, t=r.t[kept], u=r.u[kept], y=r.y[:, kept], resolution=np.empty(0))


def wrapped(taken: Taken, size: float) -> Recording:
    """A position that wraps around."""
    x, span = taken.y["position"], size * np.ptp(taken.y["position"])
    return taken.recording(position=(x - x.min()) % span)


FAULTS = (
    Fault(
        "sign of the input",
        lambda r, s: r.recording(-r.u),
        (1, 1),
        "",
        ("sign of the input",),
        symptoms=("Input has the wrong sign",),
    ),
    Fault(
        "factor of a velocity",
        lambda r, s: r.recording(velocity=s * r.y["velocity"]),
        (1.02, 60),
        "factor",
        ("outputs",),
        ("stop", "mind", "note"),
        needs="both",
    ),
    Fault(
        "sign of a velocity",
        lambda r, s: r.recording(velocity=-r.y["velocity"]),
        (1, 1),
        "",
        ("outputs",),
        needs="both",
    ),
    Fault(
        "clock skew",
        lambda r, s: r.recording(velocity=late(r.drive.velocity, s) + r.y["velocity"] - r.drive.velocity),
        (2e-4, 2e-2),
        "s",
        ("outputs",),
        needs="both",
        symptoms=("Outputs are not of one time",),
        adds=True,
    ),
    Fault(
        "filtered velocity",
        lambda r, s: r.recording(velocity=lfilter([DT / (s + DT)], [1.0, -s / (s + DT)], r.y["velocity"])),
        (5e-4, 3e-2),
        "s",
        ("outputs",),
        needs="both",
        symptoms=("Outputs are not of one time",),
        adds=True,
    ),
    Fault(
        "swapped channels",
        lambda r, s: r.recording(r.y["velocity"], velocity=r.u),
        (1, 1),
        "",
        ("swapped channels", "sign of the input"),
        needs="velocity",
    ),
    Fault(
        "setpoint",
        lambda r, s: with_last(r, setpoint(getattr(r.drive, r.last), s)),
        (5, 20),
        "parts",
        ("setpoint",),
    ),
    Fault("repeated samples", lambda r, s: with_last(r, repeated(r, s)), (0.02, 0.4), "share", ("repeated samples",)),
    Fault(
        "sampled slower",
        lambda r, s: with_last(r, np.repeat(r.y[r.last][:: round(s)], round(s))[: r.u.size]),
        (2, 10),
        "samples",
        ("repeated samples",),
    ),
    Fault(
        "clipped output",
        lambda r, s: with_last(r, np.clip(r.y[r.last], None, r.y[r.last].max() - s * np.ptp(r.y[r.last]))),
        (0.02, 0.3),
        "of the range",
        ("limits", "setpoint"),
    ),
    Fault(
        "coarse resolution",
        lambda r, s: with_last(r, np.round(r.y[r.last] / (np.ptp(r.y[r.last]) * s)) * np.ptp(r.y[r.last]) * s),
        (0.02, 0.3),
        "of the range",
        ("resolution",),
    ),
    Fault("differenced velocity", differenced, (5, 200), "counts", ("differenced velocity",), needs="velocity"),
    Fault("outliers", lambda r, s: with_last(r, outliers(r, s)), (0.02, 1), "of the range", ("outliers",)),
    Fault("wrapping position", wrapped, (0.2, 0.8), "of the range", ("outliers",), needs="position"),
    Fault(
        "lost samples",
        lost,
        (0.002, 0.1),
        "of the recording",
        ("outliers",),
        needs="position",
        symptoms=("Position jumps",),
        adds=True,
    ),
    Fault(
        "drift of the torque",
        lambda r, s: r.recording(r.u - s * np.abs(r.u).max() * np.linspace(-0.5, 0.5, r.u.size)),
        (0.02, 0.5),
        "of the peak",
        ("drift",),
        ("note",),
        symptoms=("Torque drifts",),
        adds=True,
    ),
    Fault("start in motion", started, (0.05, 0.6), "of the recording", ("start",), ("note",)),
    Fault(
        "closed loop",
        lambda r, s: r.recording(
            r.u - s * np.std(r.u) / max(r.noise, 1e-12) * (r.y[r.last] - getattr(r.drive, r.last))
        ),
        (0.01, 0.5),
        "of the input",
        ("closed loop",),
        ("note",),
    ),
)


def fits(fault: Fault, base: Taken) -> bool:
    """True if a recording can have a fault."""
    if fault.needs == "both":
        return len(base.y) == 2
    if fault.needs == "position":
        return list(base.y) == ["position"]
    return not fault.needs or list(base.y) == [fault.needs]


@dataclass(frozen=True)
class Fitted:
    """Estimates of the true structure's parameters with their standard deviations, and titles of the symptoms."""

    values: Array
    std: Array
    symptoms: tuple[str, ...]


def fitted(drive: Drive, recording: Recording) -> Fitted | None:
    """Fit the true structure from its true values; None if that fails."""
    start = dict(zip(drive.names, drive.values.tolist(), strict=True))
    try:
        fit = estimation.fit(PAPER.parse(drive.structure), (recording,), start=start, starts=1, patience=0, f_tanh=None)
    except BrightgreyError:
        return None
    found = [fit.estimates[name] for name in drive.names]
    std = np.array([e.std if e.std else np.inf for e in found])
    return Fitted(np.array([e.value for e in found]), std, tuple(symptom.title for symptom in fit.symptoms))


def matters(clean: Fitted | None, faulty: Fitted | None) -> bool:
    """True if a fault moves a parameter by more than two standard deviations, or lets the estimation fail."""
    if clean is None:
        return False
    return faulty is None or bool((np.abs(faulty.values - clean.values) > MOVED * clean.std).any())


def ideal_power(seed: int, drive: Drive, fault: Fault, size: float, faulty: Recording) -> float:
    """Power of the likelihood ratio test between the fault and none, of somebody who knows all but the parameters.

    What the fault adds to the outputs is whitened by the noise and freed from what changes of the parameters add, and
    from the position at the start, which is known from noisy samples only.
    """
    base = taken(seed, drive)
    noise = {kind: y - getattr(drive, kind) for kind, y in base.y.items()}
    bare = fault.make(replace(base, y={kind: getattr(drive, kind) for kind in noise}), size)
    settings = estimation.settings_for((faulty,), scales((faulty,)), drive.f_tanh)
    settings = replace(settings, level="accurate")

    def predicted(values: Array) -> Array:
        named = dict(zip(drive.names, values.tolist(), strict=True))
        return estimation.predict(PAPER.parse(drive.structure), named, bare, settings)

    true = predicted(drive.values)
    changes = [bare.y - true]
    for k in range(len(drive.names)):
        step = 1e-4 * np.abs(drive.values[k]) * (np.arange(len(drive.names)) == k)
        changes.append((predicted(drive.values + step) - true) / 1e-4)
    changes += [np.ones_like(true) * (np.array(list(noise)) == "position")[:, None]]
    white = np.column_stack([np.concatenate(list(map(whitened, c, noise.values()))) for c in changes])
    if not np.isfinite(white).all():
        return float("nan")
    added, known = white[:, 0], white[:, 1:]
    known = known / np.maximum(np.linalg.norm(known, axis=0), 1e-300)
    left = added - known @ np.linalg.lstsq(known, added, rcond=1e-10)[0]
    limit = float(norm.isf(0.5 * IDEAL_LEVEL))
    return float(ndtr(np.linalg.norm(left) - limit))


def check_power(seed: int, drive: Drive, fault: Fault, size: float) -> float:
    """Power of the best test without a model of the drive, of somebody who knows the true motion and the noise.

    A velocity and a position are compared by the differences of the position, whose noise has a known covariance. What
    the fault adds is freed from a constant and a factor. The level is that of the check, three standard errors.
    """
    base = taken(seed, drive)
    noise = {kind: y - getattr(drive, kind) for kind, y in base.y.items()}
    bare = fault.make(replace(base, y={kind: getattr(drive, kind) for kind in noise}), size)

    def differences(x: Array) -> Array:
        return np.asarray(np.diff(x, axis=0) / DT)

    def means(x: Array) -> Array:
        return np.asarray(0.5 * (x[1:] + x[:-1]))

    covariance = differences(differences(autoregressive(noise["position"])).T)
    covariance += means(means(autoregressive(noise["velocity"])).T)
    added = means(bare.y[1] - drive.velocity) - differences(bare.y[0] - drive.position)
    known = np.column_stack([np.ones(added.size), means(drive.velocity)])
    factor = np.linalg.cholesky(covariance)
    white = solve_triangular(factor, np.column_stack([added, known]), lower=True)
    left = white[:, 0] - white[:, 1:] @ np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=None)[0]
    return float(ndtr(np.linalg.norm(left) - CHECK_ERRORS))


def autoregressive(noise: Array) -> Array:
    """Covariance of the first-order autoregression of a noise, shape (samples, samples)."""
    pole = noise_pole(noise)
    return np.asarray(np.var(noise) * toeplitz(pole ** np.arange(noise.size)))


def noise_pole(noise: Array) -> float:
    """Pole of the first-order autoregression of a noise, 0 for one that is white."""
    pole = float(noise[1:] @ noise[:-1] / (noise @ noise))
    return pole if pole > 0.5 * AR_POLE else 0.0


def whitened(x: Array, noise: Array) -> Array:
    """A signal whitened by the first-order autoregression of a noise, in its standard deviations."""
    pole = noise_pole(noise)
    new = x - pole * np.concatenate([[0.0], x[:-1]])
    return np.asarray(new / (np.std(noise) * np.sqrt(1.0 - pole**2)))


def clean_rows(all_drives: Sequence[Drive], seed: int) -> Iterator[list[str]]:
    """Rows of what is said of recordings without a fault, by check."""
    said: dict[tuple[str, str], int] = {}
    worst = {"stop": 0, "mind": 0}
    for drive in all_drives:
        results = check(taken(seed, drive).recording()).results
        for key in {(r.check, r.grade) for r in results if r.grade in worst}:
            said[key] = said.get(key, 0) + 1
        for grade in worst:
            worst[grade] += any(r.grade == grade for r in results)
    for grade, count in worst.items():
        yield [f"any check: {grade}", share(count, len(all_drives))]
    for (name, grade), count in sorted(said.items()):
        yield [f"{name}: {grade}", share(count, len(all_drives))]


def faulty_recordings(
    all_drives: Sequence[Drive], seed: int, number: int, each: int
) -> Iterator[tuple[Drive, float, Recording]]:
    """Drives that can have the fault of a number, with its size and their recording; so many at most."""
    fault, count = FAULTS[number], 0
    for drive in all_drives:
        base = taken(seed, drive)
        if not fits(fault, base) or count == each:
            continue
        count += 1
        size = log_uniform(np.random.default_rng([seed, drive.number, 2, number]), *fault.sizes)
        yield drive, size, fault.make(base, size)


def is_named(fault: Fault, recording: Recording) -> bool:
    """True if one of the checks that find a fault says so."""
    examined = Examined(recording)
    asked = (one for one in all_checks() if one.name in fault.checks)
    return any(result.grade in fault.grades for one in asked for result in one.run(examined))


CLEAN_FITS: dict[tuple[int, int], Fitted | None] = {}
"""Fits of the recordings without a fault, by seed and number of the drive."""


def clean_fit(seed: int, drive: Drive) -> Fitted | None:
    """Fit the recording of a drive without a fault."""
    key = seed, drive.number
    if key not in CLEAN_FITS:
        CLEAN_FITS[key] = fitted(drive, taken(seed, drive).recording())
    return CLEAN_FITS[key]


def named_rows(all_drives: Sequence[Drive], seed: int, each: int, kinds: Sequence[str]) -> Iterator[list[str]]:
    """Rows of the faults: named by a check in all, and by thirds of their sizes; saved ones of other kinds."""
    saved = saved_rows("Made faults") if kinds else {}
    for number, fault in enumerate(FAULTS):
        if kinds and fault.name not in kinds:
            yield saved[fault.name]
            continue
        rows = [(size, is_named(fault, r)) for _, size, r in faulty_recordings(all_drives, seed, number, each)]
        low, high = np.log(fault.sizes)
        thirds = [
            [r for r in rows if low + k * (high - low) / 3 <= np.log(r[0]) <= low + (k + 1) * (high - low) / 3]
            for k in range(3)
        ]
        curve = [f"{sum(r[1] for r in third)} of {len(third)}" for third in thirds]
        span = f"{fault.sizes[0]:g} to {fault.sizes[1]:g} {fault.unit}" if high > low else ""
        row = [fault.name, span, share(sum(r[1] for r in rows), len(rows))]
        row += curve if high > low else ["", "", ""]
        print(row, flush=True)
        yield row


def matter_rows(all_drives: Sequence[Drive], seed: int, each: int, kinds: Sequence[str]) -> Iterator[list[str]]:
    """Rows of the faults where they matter: named by a check, or by a symptom of the fit; and by an ideal test."""
    for number, fault in enumerate(FAULTS):
        if kinds and fault.name not in kinds:
            continue
        by_check, by_any, powers, before = [], [], [], []
        for drive, size, faulty in faulty_recordings(all_drives, seed, number, each):
            found = fitted(drive, faulty)
            if not matters(clean_fit(seed, drive), found):
                continue
            by_check.append(is_named(fault, faulty))
            by_any.append(by_check[-1] or (found is not None and any(t in fault.symptoms for t in found.symptoms)))
            if fault.adds:
                powers.append(ideal_power(seed, drive, fault, size, faulty))
                if fault.needs == "both":  # the input says nothing of a difference of the outputs
                    before.append(check_power(seed, drive, fault, size))
        named = [share(sum(cells), len(cells)) for cells in (by_check, by_any)]
        row = [fault.name, named[0], summed(before), named[1] if fault.symptoms else "", summed(powers)]
        print(row, flush=True)
        yield row


def all_kinds(rows: Sequence[Sequence[str]]) -> list[str]:
    """Row of the faults of all rows together; where a fault has no symptom, its checks alone name it."""
    by_check, by_any = ([row[1] for row in rows], [row[3] or row[1] for row in rows])
    sums = [[sum(int(cell.split()[k]) for cell in cells) for k in (0, 2)] for cells in (by_check, by_any)]
    return ["all kinds", share(*sums[0]), "", share(*sums[1]), ""]


def summed(powers: Sequence[float]) -> str:
    """Sum of the powers that are known, and their number; empty without one."""
    known = [power for power in powers if np.isfinite(power)]
    return f"{sum(known):.1f} of {len(known)}" if known else ""


def saved_rows(title: str) -> dict[str, list[str]]:
    """Rows of the saved table of a title, by their first cell."""
    saved = json.loads((RESULTS / "checks.json").read_text(encoding="utf-8"))
    return {row[0]: row for table in saved["tables"] if table["title"] == title for row in table["rows"]}


def symptom_rows(all_drives: Sequence[Drive], seed: int) -> Iterator[list[str]]:
    """Rows of the symptoms that name a fault, in fits of recordings without one."""
    clean = [found for drive in all_drives if (found := clean_fit(seed, drive)) is not None]
    for title in sorted({title for fault in FAULTS for title in fault.symptoms}):
        yield [title, share(sum(title in found.symptoms for found in clean), len(clean))]


REAL = {
    "KUKA axis 1, both encoders: skew of 3.0 ms": (
        "kuka/data_A_both_encoders.mat",
        {
            "input": "rec.act_torque_abs_nm(1,:)",
            "outputs": ["rec.act_pos_mot_deg(1,:):position", "rec.act_pos_se_deg(1,:):position@2"],
            "time": "time_data.time_cont",
            "units": {"rec.act_torque_abs_nm(1,:)": "N m"}
            | {f"rec.act_pos_{side}_deg(1,:)": "deg" for side in ("mot", "se")},
        },
        "outputs",
    ),
    "KUKA axis 2: repeated samples": (
        "kuka/axis2_FF_A.csv",
        {
            "input": "motor_torque_Nm",
            "outputs": "position_deg:position",
            "units": {"motor_torque_Nm": "N m", "position_deg": "deg"},
        },
        "repeated samples",
    ),
    "MTE360: differenced velocity": (
        "mte360/velocity_response_1_5.mat",
        {"input": "u", "outputs": "v1:velocity", "units": {"u": "V", "v1": "mm/s"}},
        "differenced velocity",
    ),
    "EMPS: closed loop": (
        "emps/DATA_EMPS.mat",
        {"input": "vir", "outputs": "qm:position", "units": {"vir": "V", "qm": "m"}},
        "closed loop",
    ),
    "EMPS with its sign turned": (
        "emps/DATA_EMPS.mat",
        {"input": "vir", "outputs": "qm:position", "units": {"vir": "V", "qm": "m"}, "input_gain": -1.0},
        "sign of the input",
    ),
    "TX40 joint 1, current and angle in two files: 18 % repeated": (
        "tx40/curr_data.csv",
        {
            "input": "Joint_1",
            "outputs": "pos_read_data.Joint_1:position",
            "beside": [DATA / "tx40" / "pos_read_data.csv"],
            "dt": 2e-4,
            "units": {"Joint_1": "A", "pos_read_data.Joint_1": "deg"},
        },
        "repeated samples",
    ),
    "Pendulum: hole of 22 ms": (
        "pendulum/sac_with_hole.csv",
        {"input": "torque", "outputs": "position:position", "units": {"torque": "N m", "position": "rad", "time": "s"}},
        "file",
    ),
    "UR10e joint 1: steps of 12 ms": (
        "ur10e/joint_1.csv",
        {"input": "14", "outputs": "2:position", "time": "1", "units": {"14": "A", "2": "rad", "1": "s"}},
        "file",
    ),
}
"""Recorded files, with what is known of them, and the check that says it."""


def real_rows() -> Iterator[list[str]]:
    """Rows of what the checks say of recorded files."""
    for title, (name, options, wanted) in REAL.items():
        found = check(read_recording(DATA / name, **options))
        said = [f"{r.grade}: {r.figure or r.sentence}" for r in found.results if r.check == wanted]
        counts = ", ".join(f"{len(found.of_grade(grade))} {grade}" for grade in ("stop", "mind", "note"))
        yield [title, said[0], counts]


TABLES = ("clean", "named", "matter", "symptoms", "real")
"""Tables that can be made."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("drives", "table"))
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("last", type=int, nargs="?", default=500)
    parser.add_argument("--seed", type=int, default=61)
    parser.add_argument("--each", type=int, default=100, help="recordings with each fault")
    parser.add_argument("--fits", type=int, default=40, help="recordings with each fault that are fitted")
    parser.add_argument("--kinds", nargs="*", default=[], help="faults: only these, beside those saved")
    parser.add_argument("--only", nargs="+", choices=TABLES, default=TABLES, help="these tables")
    parser.add_argument("--save", action="store_true", help="write the tables to bench/results/ for docs/validation/")
    options = parser.parse_args()
    limit_blas_threads()
    found = drives(options.seed, options.first, options.last) if options.only != ["real"] else []
    if options.what == "drives":
        return
    tables = []
    if "clean" in options.only:
        rows = list(clean_rows(found, options.seed))
        tables.append(Table("Recordings without a fault", ("said", "recordings"), rows))
    if "named" in options.only:
        rows = list(named_rows(found, options.seed, options.each, options.kinds))
        tables.append(Table("Made faults", ("fault", "sizes", "named", "small", "medium", "large"), rows))
    if "matter" in options.only:
        heads = ("fault", "named by a check", "by an ideal check", "or by a symptom of the fit", "by an ideal test")
        by_fault = saved_rows("Faults that matter") if options.kinds else {}
        for row in matter_rows(found, options.seed, options.fits, options.kinds):
            by_fault[row[0]] = row
            rows = [by_fault[fault.name] for fault in FAULTS if fault.name in by_fault]
            publish("checks", [Table("Faults that matter", heads, [*rows, all_kinds(rows)])], to_file=options.save)
    if "symptoms" in options.only:
        fitted_before = found[: len(SENSORS) * options.fits]  # so many drives give each sensor its fits
        rows = list(symptom_rows(fitted_before, options.seed))
        tables.append(Table("Symptoms of fits without a fault", ("symptom", "fits"), rows))
    if "real" in options.only and DATA.exists():
        tables.append(Table("Recorded files", ("file, and what is known of it", "said", "in all"), list(real_rows())))
    publish("checks", tables, to_file=options.save)


if __name__ == "__main__":
    main()
