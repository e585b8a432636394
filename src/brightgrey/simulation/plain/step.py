"""Attempt of a step, and the quantities that must not leave their intervals in it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.simulation.plain.state import Simulation

__all__ = ["Step", "Watched", "try_step", "watched_quantities"]


@dataclass(frozen=True)
class Watched:
    """Course of a quantity over a step, at moments that are parts of it, and the interval in which it has to stay."""

    course: list[float]
    low: float
    high: float
    moments: list[float]

    def leaves(self) -> bool:
        """True if it leaves its interval, by a parabola through 0, h/3 and h or through neighbours."""
        slack = 1e-12 * (abs(self.course[0]) + abs(self.course[-1])) + 1e-300
        seen = self.course[1:]
        if len(self.course) == 3:
            s0, s1, s2 = self.course
            slope = 4.5 * (s1 - s0) - 0.5 * (s2 - s0)
            bend = s2 - s0 - slope
            peak = -0.5 * slope / bend if bend else -1.0
            seen = [s0 + peak * (slope + peak * bend) if 0.0 < peak < 1.0 else s2, s2]
        else:
            for s0, s1, s2 in zip(self.course, self.course[1:], self.course[2:], strict=False):
                rise, bend = 0.5 * (s2 - s0), 0.5 * (s2 + s0) - s1
                if abs(rise) < 2.0 * abs(bend):
                    seen.append(s1 - rise * rise / (4.0 * bend))
        return not all(self.low - slack < s < self.high + slack for s in seen)

    def part_inside(self) -> float:
        """Approximate part of the step before it leaves its interval; 1 if it stays."""
        for (t0, s0), (t1, s1) in pairwise(zip(self.moments, self.course, strict=True)):
            if not self.low <= s1 <= self.high:
                limit = self.high if s1 > self.high else self.low
                return t0 + (t1 - t0) * max((limit - s0) / (s1 - s0), 0.0)
        return 1.0


class Step(NamedTuple):
    """Attempt of a step: state at its end, ports and forces at both stages, and what decides whether it is accepted."""

    end: Array
    port: tuple[Array, Array]
    force: tuple[Array, Array]
    change: float  #: Last change of Newton's method.
    error: float
    inside: list[Array]  #: States within the step.


def watched_quantities(run: Simulation, step: Step) -> list[Watched]:
    """Quantities that may end the present modes: those of limited states, then those of dry friction."""
    states = [run.x, *step.inside, step.end]
    moments = [0.0, 1.0 / 3.0, 1.0] if len(states) == 3 else list(np.linspace(0.0, 1.0, len(states)))
    watched = [Watched([run.watched(b, x) for x in states], *run.interval(b), moments) for b in range(len(run.modes))]
    for k in run.friction.dry:
        side, z = run.friction.sides[k], run.x[run.low.stopped[k]]
        course = [side * z, *(side * port[k] for port in step.port)]
        if side == 0.0:
            course = [run.force[k], *(force[k] for force in step.force)]
        elif z == 0.0:  # it breaks away, and bends more than a parabola
            course[1:] = [min(course[1:])] * 2
        watched.append(Watched([float(w) for w in course], *run.friction.interval(k), [0.0, 1.0 / 3.0, 1.0]))
    return watched


def try_step(run: Simulation, h: float, value: float, slope: float, kink: float, until: float) -> Step:
    """Two-stage Radau IIA step. A mass that sticks has the row v = 0 at both stages, and its friction is free."""
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
    sticks = np.isin(np.arange(2 * m) % max(m, 1), run.friction.sticking)
    z[sticks] = 0.0
    if m:
        for _ in range(run.tolerance.newton):
            phi, by_port = (np.concatenate(pair) for pair in zip(run.laws(z[:m]), run.laws(z[m:]), strict=True))
            phi[sticks], by_port[sticks] = -z[sticks], -1.0
            F = np.linalg.solve(np.diag(~sticks * 1.0) - by_port[:, None] * through, phi + by_port * (a - z))
            change = float(np.abs(a + through @ F - z).max())
            z = a + through @ F
    bend = np.abs(run.force - (1.5 * F[:m] - 0.5 * F[m:])) * np.abs(run.low.G[:, :, 0]).max(axis=1, initial=0.0)
    error = float(bend.max(initial=0.0) * h)
    parts = round((run.points + 1) * h / (run.tick * run.ticks))
    spans = [h * i / parts for i in range(1, parts)] if parts > 2 else [h / 3.0]
    end, *inside = (state + per_force @ F for state, per_force in map(free, (h, *spans)))
    change, error = (change, error) if m else (-1.0, -1.0)
    return Step(end, (z[:m], z[m:]), (F[:m], F[m:]), change, error, inside)
