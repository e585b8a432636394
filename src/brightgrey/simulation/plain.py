"""Plain implementation of the kernel's method for one system in numpy, slow and easy to read.

Tests compare the compiled kernel with it. Matrix exponentials come from scipy, events from a root finder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.optimize import brentq

from brightgrey.arrays import Array
from brightgrey.kit import StateSpace
from brightgrey.simulation.kernel.lowering import Lowered, lower
from brightgrey.simulation.response import parts_per_sample
from brightgrey.simulation.settings import Settings, Tolerances, stepping_of, tolerances

__all__ = ["plain_response"]

FREE, UPPER, LOWER, CLOSED = 0, 1, -1, 2


@dataclass
class _Simulation:
    """Memory of a simulation in progress. It is mutable, unlike other objects of the package."""

    low: Lowered
    tolerance: Tolerances
    scale: float
    hold: str
    tick: float
    ticks: int
    points: int
    x: Array
    force: Array
    slope: Array
    modes: list[int] = field(default_factory=list)
    propagators: dict[tuple[tuple[bool, ...], float], Array] = field(default_factory=dict)

    def matrix(self) -> Array:
        """System matrix of the present mode, in which free limited states move with their rate."""
        A = self.low.A[:, :, 0].copy()
        for element, mode in zip(self.low.limited, self.modes, strict=True):
            if mode == FREE:
                A += np.outer(element.G.reshape(-1), element.H[0].reshape(-1))
        return A

    def propagator(self, span: float) -> Array:
        """Top rows of the exponential: weights of x, u, its slope, 1, F at the start, its slope."""
        key = (tuple(mode == FREE for mode in self.modes), span)
        if key not in self.propagators:
            n, m = len(self.x), len(self.force)
            M = np.zeros((n + 3 + 2 * m, n + 3 + 2 * m))
            M[:n, :n] = self.matrix()
            M[:n, n], M[n, n + 1], M[:n, n + 2] = self.low.B[:, 0], 1.0, self.low.c[:, 0]
            M[:n, n + 3 : n + 3 + m] = self.low.G[:, :, 0].T
            M[n + 3 : n + 3 + m, n + 3 + m :] = np.eye(m)
            self.propagators[key] = expm(M * span)[:n]
        return self.propagators[key]

    def kink(self, span: float) -> Array:
        """State after a ramp of unit slope (held input: a unit jump) that began `span` ago."""
        column = len(self.x) + (1 if self.hold == "linear" else 0)
        return self.propagator(span)[:, column] if span > 0.0 else np.zeros_like(self.x)

    def laws(self, z: Array) -> tuple[Array, Array]:
        """Force and slope of every channel at its port."""
        force, slope = np.zeros_like(z), np.zeros_like(z)
        for element, k in self.low.smooth:
            phi, slopes = element.law.value((z[k],), tuple(float(np.ravel(p)[0]) for p in element.p))
            force[k] += phi
            slope[k] += slopes[0]
        return force, slope

    def watched(self, b: int, x: Array) -> float:
        """Limited state b if it is free, otherwise its rate."""
        element = self.low.limited[b]
        assert element.limits is not None
        row = element.H[0].reshape(-1)
        return float(x[element.limits.state] if self.modes[b] == FREE else row @ x)

    def interval(self, b: int) -> tuple[float, float]:
        """Interval in which the watched quantity has to stay."""
        limits = self.low.limited[b].limits
        assert limits is not None
        return {
            FREE: (float(np.ravel(limits.lower)[0]), float(np.ravel(limits.upper)[0])),
            UPPER: (0.0, np.inf),
            LOWER: (-np.inf, 0.0),
            CLOSED: (-np.inf, np.inf),
        }[self.modes[b]]


def plain_response(system: StateSpace, u: ArrayLike, dt: float, x0: ArrayLike, settings: Settings) -> Array:
    """Outputs, shape (outputs, samples), of one system at level ``accurate`` or ``fast``.

    Parameters and units as for :func:`brightgrey.simulation.response`.
    """
    u = np.asarray(u, float)
    low = lower(system, dt)
    tolerance = tolerances(settings.level, bool(low.limited))
    bases, levels, points = stepping_of(tolerance, int(parts_per_sample(system, low, dt, settings)[0]))
    ticks = 2**levels
    run = _Simulation(
        low,
        tolerance,
        settings.speed_scale,
        settings.hold,
        dt / (bases * ticks),
        ticks,
        points,
        np.array(x0, float),
        np.zeros(len(low.G)),
        np.zeros(len(low.G)),
    )
    drive = _input_course(u, dt, float(np.ravel(low.delay)[0]), settings.hold)
    for b, element in enumerate(low.limited):
        assert element.limits is not None
        run.modes.append(FREE)
        lower_end, upper_end = run.interval(b)
        state, rate = run.x[element.limits.state], element.H[0].reshape(-1) @ run.x
        at_upper, at_lower = state >= upper_end and rate >= 0.0, state <= lower_end and rate <= 0.0
        run.modes[b] = CLOSED if upper_end <= lower_end else UPPER if at_upper else LOWER if at_lower else FREE
    run.force = run.laws(low.H[:, :, 0] @ run.x + low.through[:, 0] * drive(0.0, 0.0)[0])[0]
    y = np.empty((len(low.outputs), len(u)))
    for k in range(len(u)):
        if k:
            for base in range(bases):
                _step_base(run, drive, (k - 1) * dt, base)
        rates = run.matrix() @ run.x + low.B[:, 0] * drive(k * dt, 0.0)[0] + low.c[:, 0]
        rates += low.G[:, :, 0].T @ run.force
        y[:, k] = np.concatenate([run.x, rates])[list(low.outputs)]
    return y


def _input_course(
    u: Array, dt: float, delay: float, hold: str
) -> Callable[[float, float], tuple[float, float, float, float]]:
    """Delayed input on [t, t + h): value, slope, kink (or jump) inside, and the time from t to the kink."""

    def at(i: int) -> float:
        return float(u[min(max(i, 0), len(u) - 1)])

    def drive(t: float, h: float) -> tuple[float, float, float, float]:
        place = t / dt - delay
        i = int(np.floor(place + 1e-9))
        part = max(place - i, 0.0)
        until = (1.0 - part) * dt
        here, after, later = at(i), at(i + 1), at(i + 2)
        inside = h - until > 1e-9 * dt
        if hold == "linear":
            kink = (later - 2.0 * after + here) / dt if inside else 0.0
            return here + (after - here) * part, (after - here) / dt, kink, until
        return here, 0.0, after - here if inside else 0.0, until

    return drive


def _step_base(
    run: _Simulation, drive: Callable[[float, float], tuple[float, float, float, float]], t: float, base: int
) -> None:
    """Take one base step, in shorter steps where the error or a limit requires it."""
    position, size = 0, run.ticks
    while position < run.ticks:
        begin, h = t + (base * run.ticks + position) * run.tick, size * run.tick
        value, slope, kink, until = drive(begin, h)
        end, F1, F2, change, error, inside = _try_step(run, h, value, slope, kink, until)
        failed = not change < run.tolerance.change * run.scale
        coarse = not error < run.tolerance.error * run.scale
        out = any(_leaves_its_interval(run, b, [run.x, *inside, end]) for b in range(len(run.modes)))
        if size > 1 and (failed or out or coarse):
            size = _next_size(run, size, failed, error, [run.x, *inside, end])
            continue
        if out or failed:
            pieces = [(h, value, slope)]
            if kink:
                after = value + slope * until + (kink if run.hold == "zoh" else 0.0)
                pieces = [
                    (until, value, slope),
                    (h - until, after, slope + (kink if run.hold == "linear" else 0.0)),
                ]
            for span, at, rate in pieces:
                _pass_limits(run, span, at, rate)
            last = pieces[-1][1] + pieces[-1][2] * pieces[-1][0]
            run.force = run.laws(run.low.H[:, :, 0] @ run.x + run.low.through[:, 0] * last)[0]
            run.slope = np.zeros_like(run.force)
        else:
            run.x, run.force, run.slope = end, F2, 1.5 * (F2 - F1) / h
        position += size
        if size < run.ticks and position % (2 * size) == 0 and 8.0 * error < run.tolerance.error * run.scale:
            size *= 2


def _next_size(run: _Simulation, size: int, failed: bool, error: float, states: list[Array]) -> int:
    """Ticks of the next attempt: it ends before the first limit, and its expected error is small enough."""
    if not run.tolerance.long_steps:
        return size // 2
    reached = min((_part_until_limit(run, b, states) for b in range(len(run.modes))), default=1.0)
    after = size // 2
    while after > 1 and after > reached * size:
        after //= 2
    least = max(size // 4, 1)
    ratio = error / (run.tolerance.error * run.scale) / 8.0
    while after > least and ratio >= 1.0:
        after //= 2
        ratio /= 8.0
    return after


def _part_until_limit(run: _Simulation, b: int, states: list[Array]) -> float:
    """Approximate part of a step before the watched quantity leaves its interval; 1 if it stays."""
    low, high = run.interval(b)
    moments = [0.0, 1.0 / 3.0, 1.0] if len(states) == 3 else list(np.linspace(0.0, 1.0, len(states)))
    for (t0, s0), (t1, s1) in pairwise(zip(moments, (run.watched(b, x) for x in states), strict=True)):
        if not low <= s1 <= high:
            limit = high if s1 > high else low
            return t0 + (t1 - t0) * max((limit - s0) / (s1 - s0), 0.0)
    return 1.0


def _try_step(
    run: _Simulation, h: float, value: float, slope: float, kink: float, until: float
) -> tuple[Array, Array, Array, float, float, list[Array]]:
    """Two-stage Radau IIA step: end, F at both stages, last change of Newton, error estimate, states within."""
    n, m = len(run.x), len(run.force)
    H, K = run.low.H[:, :, 0], run.low.through[:, 0]

    def free(span: float) -> tuple[Array, Array]:
        """State after `span` without F, and what each F1 and F2 adds to it."""
        P = run.propagator(span)
        state = P[:, : n + 3] @ np.concatenate([run.x, [value, slope, 1.0]]) + kink * run.kink(
            span - until if kink else 0.0
        )
        start, rate = P[:, n + 3 : n + 3 + m], P[:, n + 3 + m :] * 1.5 / h
        return state, np.hstack([1.5 * start - rate, rate - 0.5 * start])

    stages = (h / 3.0, h)
    ports, S = [], []
    for span in stages:
        state, per_force = free(span)
        seen = (
            value
            + slope * span
            + (kink * (max(span - until, 0.0) if run.hold == "linear" else span > until) if kink else 0.0)
        )
        ports.append(H @ state + K * seen)
        S.append(H @ per_force)
    a, through = np.concatenate(ports), np.vstack(S)
    F = np.concatenate([run.force + run.slope * h / 3.0, run.force + run.slope * h])
    z, change = a + through @ F, 0.0
    if m:
        for _ in range(run.tolerance.newton):
            phi, by_port = (np.concatenate(pair) for pair in zip(run.laws(z[:m]), run.laws(z[m:]), strict=True))
            F = np.linalg.solve(np.eye(2 * m) - by_port[:, None] * through, phi + by_port * (a - z))
            change = float(np.abs(a + through @ F - z).max())
            z = a + through @ F
    bend = np.abs(run.force - (1.5 * F[:m] - 0.5 * F[m:])) * np.abs(run.low.G[:, :, 0]).max(axis=1, initial=0.0)
    error = float(bend.max(initial=0.0) * h)
    parts = round((run.points + 1) * h / (run.tick * run.ticks))
    spans = [h * i / parts for i in range(1, parts)] if parts > 2 else [h / 3.0]
    end, *inside = (state + per_force @ F for state, per_force in map(free, (h, *spans)))
    return end, F[:m], F[m:], change if m else -1.0, error if m else -1.0, inside


def _leaves_its_interval(run: _Simulation, b: int, states: list[Array]) -> bool:
    """True if the watched quantity leaves its interval, by a parabola through 0, h/3 and h or through neighbours."""
    course = [run.watched(b, x) for x in states]
    slack = 1e-12 * (abs(course[0]) + abs(course[-1])) + 1e-300
    low, high = run.interval(b)
    seen = course[1:]
    if len(course) == 3:
        s0, s1, s2 = course
        slope = 4.5 * (s1 - s0) - 0.5 * (s2 - s0)
        bend = s2 - s0 - slope
        peak = -0.5 * slope / bend if bend else -1.0
        seen = [s0 + peak * (slope + peak * bend) if 0.0 < peak < 1.0 else s2, s2]
    else:
        for s0, s1, s2 in zip(course, course[1:], course[2:], strict=False):
            rise, bend = 0.5 * (s2 - s0), 0.5 * (s2 + s0) - s1
            if abs(rise) < 2.0 * abs(bend):
                seen.append(s1 - rise * rise / (4.0 * bend))
    return not all(low - slack < s < high + slack for s in seen)


def _pass_limits(run: _Simulation, span: float, value: float, slope: float) -> None:
    """Integrate over a short span through all its events, with friction linearised at each of them."""
    n, left = len(run.x), span
    for _ in range(200):
        H, K, G = run.low.H[:, :, 0], run.low.through[:, 0], run.low.G[:, :, 0]
        z = H @ run.x + K * value
        phi, by_port = run.laws(z)
        M = np.zeros((n + 3, n + 3))  # x, 1, t, 1
        M[:n, :n] = run.matrix() + G.T @ (by_port[:, None] * H)
        M[:n, n] = run.low.B[:, 0] * value + run.low.c[:, 0] + G.T @ (phi + by_port * (K * value - z))
        M[:n, n + 1] = (run.low.B[:, 0] + G.T @ (by_port * K)) * slope
        M[n + 1, n + 2] = 1.0
        start = np.concatenate([run.x, [1.0, 0.0, 1.0]])

        def state(s: float, M: Array = M, start: Array = start) -> Array:
            return np.asarray((expm(M * s) @ start)[:n])

        moment, which, side = left, -1, 0
        for b in range(len(run.modes)):
            low, high = run.interval(b)
            grid = np.linspace(0.0, moment, 5)
            for s, e in pairwise(grid):
                at = run.watched(b, state(e))
                slack = 1e-13 * abs(at) + 1e-300
                if at > high + slack or at < low - slack:
                    limit, side_b = (high, 1) if at > high + slack else (low, -1)

                    def miss(s: float, b: int = b, limit: float = limit) -> float:
                        return run.watched(b, state(s)) - limit

                    begin = miss(s)
                    moment = s if begin * side_b >= 0.0 else brentq(miss, s, e, xtol=1e-18, rtol=1e-14)
                    which, side = b, side_b
                    break
        run.x = state(moment)
        if which >= 0:
            limits = run.low.limited[which].limits
            assert limits is not None
            if run.modes[which] == FREE:
                run.x[limits.state] = run.interval(which)[1 if side > 0 else 0]
                run.modes[which] = side
            else:
                run.modes[which] = FREE
        left -= moment
        value += slope * moment
        if left <= 1e-12 * span:
            return
    run.x = np.full(n, np.nan)
