"""Identification of the demo's drive: time and success against other methods, from the same bounds.

Contestants get the bounds that we find in the recording and starts drawn within them, and try start after start
until the residual sum of squares is at most 1.02 times the optimum's, or their time is up. Ours is timed as users
call it: 8 starts at the `fast` level, the best finished at `accurate`, with uncertainties.

CMA-ES (cma) and CasADi with IPOPT are optional: pip install 'brightgrey[bench]'.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.resources import files
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from brightgrey import read_recording
from brightgrey.estimation import fit, scales
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.simulation import Settings
from support.results import Table, arguments, publish

ENOUGH = 1.02
STRUCTURE = PAPER.parse(E.structure)


class Task(NamedTuple):
    """Recording with what all contestants get."""

    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    search: ParameterSpace
    low: np.ndarray
    high: np.ndarray
    enough: float
    seconds: float

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """Start within the bounds, uniform in the searched scale."""
        return rng.uniform(self.low, self.high)


class _EnoughError(Exception):
    """A contestant has reached the optimum, or its time is up."""


class Clock:
    """Stops a contestant that is done, wherever it is."""

    def __init__(self, task: Task) -> None:
        self.task, self.begin, self.best = task, time.process_time(), np.inf

    @property
    def seconds(self) -> float:
        """CPU time so far."""
        return time.process_time() - self.begin

    def check(self, rss: float) -> None:
        """Stop if `rss` is enough or time is up."""
        self.best = min(self.best, rss)
        if self.best <= self.task.enough or self.seconds > self.task.seconds:
            raise _EnoughError


def by_scipy(task: Task, rng: np.random.Generator, clock: Clock) -> None:
    """Trust-region least squares over LSODA with a right-hand side in plain floats."""
    from math import exp, tanh

    u, last = task.u.tolist(), len(task.u) - 2

    def residual(theta: np.ndarray) -> np.ndarray:
        J1, J2, c, d, M_C, f_v, M_S, omega_S = task.search.from_scaled(theta).tolist()

        def rates(t: float, x: np.ndarray) -> list[float]:
            q1, q2, v1, v2 = x.tolist()
            i = min(int(t / E.dt), last)
            torque = u[i] + (u[i + 1] - u[i]) * (t / E.dt - i)
            shaft = c * (q1 - q2) + d * (v1 - v2)
            friction = f_v * v1 + tanh(E.f_tanh * v1) * (M_C + M_S * exp(-abs(v1) / omega_S))
            return [v1, v2, (torque - shaft - friction) / J1, shaft / J2]

        found = solve_ivp(rates, (0, task.t[-1]), np.zeros(4), "LSODA", task.t, rtol=1e-6, max_step=E.dt)
        r = found.y[2] - task.y if found.success else np.full(task.y.size, 1e3)
        clock.check(float(r @ r))
        return r

    while True:
        least_squares(residual, task.draw(rng), bounds=(task.low, task.high), x_scale="jac", diff_step=1e-4)


def by_cma(task: Task, rng: np.random.Generator, clock: Clock) -> None:
    """CMA-ES over our simulator, restarted with twice the population."""
    import cma

    problem = SimulationErrorProblem.of(STRUCTURE, [RECORDING])
    settings = Settings(f_tanh=E.f_tanh, speed_scale=E.speed, level="fast")
    population = 16
    while True:
        options = {
            "bounds": [0.0, 1.0],
            "popsize": population,
            "seed": int(rng.integers(1, 2**31)),
            "verbose": -9,
            "maxfevals": 200_000,
        }
        evolution = cma.CMAEvolutionStrategy(rng.random(len(task.low)), 0.3, options)
        while not evolution.stop():
            shares = evolution.ask()
            theta = task.low[:, None] + np.transpose(shares) * (task.high - task.low)[:, None]
            rss = problem.costs(task.search.named(task.search.from_scaled(theta)), settings) / problem.weights[0] ** 2
            evolution.tell(shares, np.log(rss).tolist())
            clock.check(float(rss.min()))
        population *= 2


def by_casadi(task: Task, rng: np.random.Generator, clock: Clock) -> None:
    """Multiple shooting (20 samples an interval, Runge-Kutta 4) with IPOPT, from the measured speed."""
    import casadi as ca

    x, p, torque = ca.SX.sym("x", 3), ca.SX.sym("p", 8), ca.SX.sym("u", 2)  # twist, speeds; input at both ends
    J1, J2, c, d, M_C, f_v, M_S, omega_S = (ca.exp(p[i]) for i in range(8))

    def rates(state: ca.SX, u: ca.SX) -> ca.SX:
        shaft = c * state[0] + d * (state[1] - state[2])
        speed = ca.sqrt(state[1] ** 2 + 1e-8)
        friction = f_v * state[1] + ca.tanh(E.f_tanh * state[1]) * (M_C + M_S * ca.exp(-speed / omega_S))
        return ca.vertcat(state[1] - state[2], (u - shaft - friction) / J1, shaft / J2)

    middle = (torque[0] + torque[1]) / 2
    k1 = rates(x, torque[0])
    k2 = rates(x + E.dt / 2 * k1, middle)
    k3 = rates(x + E.dt / 2 * k2, middle)
    k4 = rates(x + E.dt * k3, torque[1])
    step = ca.Function("step", [x, torque, p], [x + E.dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    each = 20
    intervals = (len(task.u) - 1) // each
    inputs = np.stack([task.u[:-1], task.u[1:]])
    shoot = step.mapaccum(each)
    X, P = ca.MX.sym("X", 3, intervals), ca.MX.sym("P", 8)
    ends, residuals = [], [X[1, 0] - task.y[0]]
    for k in range(intervals):
        here = slice(k * each, (k + 1) * each)
        course = shoot(X[:, k], inputs[:, here], ca.repmat(P, 1, each))
        residuals.append(course[1, :].T - task.y[k * each + 1 : (k + 1) * each + 1])
        ends.append(course[:, -1])
    gaps = ca.vertcat(X[:, 0], *[ends[k] - X[:, k + 1] for k in range(intervals - 1)])
    cost = ca.sumsqr(ca.vertcat(*residuals))
    nlp = {"x": ca.vertcat(P, ca.vec(X)), "f": cost, "g": gaps}
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.max_iter": 200, "ipopt.sb": "yes"}
    options["ipopt.max_cpu_time"] = task.seconds
    solver = ca.nlpsol("fit", "ipopt", nlp, options)
    guess = np.zeros((3, intervals))
    guess[1:] = task.y[: intervals * each : each]
    free = np.full(3 * intervals, np.inf)
    while True:
        start = np.concatenate([task.draw(rng), guess.ravel(order="F")])
        lbx, ubx = np.concatenate([task.low, -free]), np.concatenate([task.high, free])
        found = solver(x0=start, lbx=lbx, ubx=ubx, lbg=0.0, ubg=0.0)
        closed = float(ca.norm_inf(found["g"])) < 1e-4
        clock.check(float(found["f"]) if closed else np.inf)


def timed(run: Callable[[Task, np.random.Generator, Clock], None], task: Task, seed: int) -> tuple[float, bool]:
    """CPU time and success of one run."""
    clock = Clock(task)
    with suppress(_EnoughError):
        run(task, np.random.default_rng(seed), clock)
    return clock.seconds, clock.best <= task.enough


def by_brightgrey(enough: float, seed: int) -> tuple[float, bool]:
    begin = time.process_time()
    found = fit(STRUCTURE, [RECORDING], f_tanh=E.f_tanh, seed=seed)
    return time.process_time() - begin, found.train["velocity"].rss <= enough


PATH = files("brightgrey.excitation").joinpath("data/demo.csv")
RECORDING = read_recording(str(PATH), input="torque", outputs=["velocity:velocity"], time="t")


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--runs", type=int, default=5, help="seeds")
    parser.add_argument("--seconds", type=float, default=20.0, help="time that each run of the others is given")
    options = parser.parse_args()
    limit_blas_threads()  # all on one core
    best = fit(STRUCTURE, [RECORDING], f_tanh=E.f_tanh)  # compiles, and gives the optimum
    search = parameter_space(STRUCTURE, scales([RECORDING]), {}, {})
    low, high = search.to_scaled(search.low), search.to_scaled(search.high)
    enough = ENOUGH * best.train["velocity"].rss
    task = Task(RECORDING.t - RECORDING.t[0], RECORDING.u, RECORDING.y[0], search, low, high, enough, options.seconds)
    rows: list[list[str]] = []

    def add(name: str, runs: Sequence[tuple[float, bool]], reference: float | None = None) -> float:
        """One row; returns the median time."""
        median = statistics.median(seconds for seconds, _ in runs)
        ratio = f"{median / (reference or median):.1f}"
        rows.append([name, f"{median:.3f}", ratio, f"{sum(hit for _, hit in runs)} of {len(runs)}"])
        print(*rows[-1], sep="; ", flush=True)
        return median

    ours = add("brightgrey, whole fit", [by_brightgrey(enough, seed) for seed in range(max(options.runs, 10))])
    for name, needs, run in (
        ("least_squares over solve_ivp", "scipy", by_scipy),
        ("CMA-ES over our simulator", "cma", by_cma),
        ("CasADi, IPOPT, multiple shooting", "casadi", by_casadi),
    ):
        if find_spec(needs) is None:
            print(f"{name:34s} left out: {needs} is not installed (pip install 'brightgrey[bench]')")
            continue
        add(name, [timed(run, task, seed) for seed in range(options.runs)], ours)
    title = f"CPU time until RSS ≤ {ENOUGH} times the optimum, {options.seconds:g} s at most"
    table = Table(title, ["method", "median CPU s", "times ours", "optimum reached"], rows)
    publish("identification", [table], to_file=options.save)


if __name__ == "__main__":
    main()
