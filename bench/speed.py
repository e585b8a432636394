"""Speed of the simulator, as ratios measured in one run: against scalar C and against scipy, with the errors beside.

The drive is that of the paper's experiment (two masses, Coulomb, viscous and Stribeck friction; 1,800 samples at
1 kHz); many parameter sets at once, one thread. Rounds of all contestants alternate, and medians of CPU times
are quoted, so that the ratios hold when the machine's speed drifts or others use it, too.
"""

from __future__ import annotations

import ctypes
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import reference
from brightgrey.simulation.settings import tolerances
from support.results import Table, arguments, publish

NAMES = ("J1", "J2", "c1", "d1", "M_C", "f_v", "M_S", "omega_S")
E = PAPER_EXPERIMENT
U = E.torque()


def compiled_c(folder: Path) -> ctypes.CDLL:
    """Compile bench/speed/one_drive.c."""
    library = folder / "one_drive.so"
    source = Path(__file__).with_name("speed") / "one_drive.c"
    options = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC"]
    subprocess.run(["gcc", *options, str(source), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def by_c(library: ctypes.CDLL, sets: np.ndarray) -> np.ndarray:
    """Velocities, shape (samples, K), of the scalar C program."""
    y = np.empty((sets.shape[1], len(U)))
    level = tolerances("fast")
    pointer = ctypes.POINTER(ctypes.c_double)
    table = np.ascontiguousarray(sets.T)
    library.simulate(
        table.ctypes.data_as(pointer),
        ctypes.c_int(sets.shape[1]),
        U.ctypes.data_as(pointer),
        ctypes.c_int(len(U)),
        *(ctypes.c_double(v) for v in (E.dt, E.f_tanh, level.error * E.speed, level.change * E.speed)),
        y.ctypes.data_as(pointer),
    )
    return y.T


def by_kernel(sets: np.ndarray, level: str) -> np.ndarray:
    """Velocities, shape (samples, K), of our simulator, assembly of the systems included."""
    system = assemble(PAPER.parse(E.structure), dict(zip(NAMES, sets, strict=True)), E.f_tanh)
    x0 = np.zeros(len(system.states))
    return response(system, U, E.dt, x0, Settings(E.f_tanh, E.speed, level)).y[0]  # type: ignore[arg-type]


def by_scipy(values: np.ndarray) -> np.ndarray:
    """Velocity, shape (samples,), by LSODA with a right-hand side in plain floats."""
    from math import exp, tanh

    J1, J2, c, d, M_C, f_v, M_S, omega_S = values.tolist()
    u, dt, f_tanh, last = U.tolist(), E.dt, E.f_tanh, len(U) - 2

    def rates(t: float, x: np.ndarray) -> list[float]:
        q1, q2, v1, v2 = x.tolist()
        i = min(int(t / dt), last)
        torque = u[i] + (u[i + 1] - u[i]) * (t / dt - i)
        shaft = c * (q1 - q2) + d * (v1 - v2)
        friction = f_v * v1 + tanh(f_tanh * v1) * (M_C + M_S * exp(-abs(v1) / omega_S))
        return [v1, v2, (torque - shaft - friction) / J1, shaft / J2]

    t = E.dt * np.arange(len(U))
    return solve_ivp(rates, (0, t[-1]), np.zeros(4), "LSODA", t, rtol=1e-6, max_step=1e-3).y[2]


def by_scipy_on_the_model() -> np.ndarray:
    """Velocity, shape (samples,), by LSODA on the assembled state space: the way that needs no code for this drive."""
    system = assemble(PAPER.parse(E.structure), E.values, E.f_tanh)
    t = E.dt * np.arange(len(U))

    def rates(time: float, x: np.ndarray) -> np.ndarray:
        return system.derivative(x, float(np.interp(time, t, U)))

    return solve_ivp(rates, (0, t[-1]), system.rest(), "LSODA", t, rtol=1e-6, max_step=1e-3).y[2]


def seconds(run: Callable[[], object]) -> float:
    """Wall time of one call."""
    begin = time.perf_counter()
    run()
    return time.perf_counter() - begin


def fresh(code: str, folder: str) -> float:
    """Wall time of a fresh Python process with the kernel's cache in `folder`."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
    return seconds(lambda: subprocess.run([sys.executable, "-c", code], check=True, env=environment))


FIRST = (
    "from brightgrey.excitation import PAPER_EXPERIMENT as E; from brightgrey.kit import PAPER, assemble;"
    "from brightgrey.simulation import Settings, response; s = assemble(PAPER.parse(E.structure), E.values, E.f_tanh);"
    "response(s, E.torque(), E.dt, s.rest(), Settings(E.f_tanh, E.speed))"
)


def measure(sets: np.ndarray, rounds: int, folder: str) -> tuple[dict[str, list[float]], dict[str, float], float]:
    """CPU times per set in s and errors over the peak of all contestants, and the difference of C and `fast`."""
    known = reference(E.structure, E.values, U, E.dt, f_tanh=E.f_tanh)[0]
    peak, true, count = np.abs(known).max(), sets[:, 0], sets.shape[1]
    c = compiled_c(Path(folder))
    apart = float(np.abs(by_c(c, sets) - by_kernel(sets, "fast")).max() / peak)
    contestants: dict[str, tuple[Callable[[], np.ndarray], int]] = {
        "fast": (lambda: by_kernel(sets, "fast"), count),
        "accurate": (lambda: by_kernel(sets, "accurate"), count),
        "scalar C": (lambda: by_c(c, sets), count),
        "LSODA, floats": (lambda: by_scipy(true)[:, None], 1),
        "LSODA, model": (lambda: by_scipy_on_the_model()[:, None], 1),
    }
    errors = {name: float(np.abs(run()[:, 0] - known).max() / peak) for name, (run, _) in contestants.items()}
    times: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, (run, many) in contestants.items():
            begin = time.thread_time()
            run()
            times[name].append((time.thread_time() - begin) / many)
    return times, errors, apart


def tables(times: dict[str, list[float]], errors: dict[str, float], first: float, later: float) -> list[Table]:
    """Speed and error of the contestants, their ratios, and times of a fresh process."""

    def ratio(slow: str, quick: str) -> float:
        return statistics.median(a / b for a, b in zip(times[slow], times[quick], strict=True))

    speeds = [
        [name, f"{1e9 * statistics.median(taken) / len(U):.1f}", f"{errors[name]:.1e}"] for name, taken in times.items()
    ]
    ratios = [["fast", "scalar C", f"{ratio('scalar C', 'fast'):.1f}", "3"]]
    for slow in ("LSODA, floats", "LSODA, model"):
        ratios.append(["accurate", slow, f"{ratio(slow, 'accurate'):.0f}", "500"])
        ratios.append(["fast", slow, f"{ratio(slow, 'fast'):.0f}", "5000"])
    fresh_process = [
        ["first compile to first simulation", f"{first:.1f}", "20"],
        ["later start to first simulation", f"{later:.2f}", "2"],
    ]
    return [
        Table("Time of the simulators", ["simulator", "ns per sample and set", "error over the peak"], speeds),
        Table("Ratios of times", ["simulator", "against", "times as fast", "goal"], ratios),
        Table("Fresh process", ["until", "s", "goal, at most"], fresh_process),
    ]


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--sets", type=int, default=512)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    true = np.array([E.values[name] for name in NAMES])
    sets = true[:, None] * np.exp(rng.uniform(-0.2, 0.2, (len(NAMES), options.sets)))
    sets[:, 0] = true
    with tempfile.TemporaryDirectory() as folder:
        times, errors, apart = measure(sets, options.rounds, folder)
        first = fresh(FIRST, folder)
        later = min(fresh(FIRST, folder) for _ in range(3))
    print(f"{E.structure}, {len(U)} samples, {options.sets} sets at once, {os.cpu_count()} cores, one thread")
    print(f"scalar C and fast differ by {apart:.1e} of peak: the same scheme and steps")
    publish("speed", tables(times, errors, first, later), to_file=options.save)


if __name__ == "__main__":
    main()
