"""Location of events: limits that are reached or left, and masses that stop or break away, in a short span."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from brightgrey.arrays import Array
from brightgrey.simulation.kernel.machine.memory_layout import SERIES_TERMS
from brightgrey.simulation.kernel.tolerances import TOLERANCES
from brightgrey.simulation.plain.state import FREE, Simulation

__all__ = ["pass_events"]


def pass_events(run: Simulation, span: float, value: float, slope: float) -> None:
    """Integrate over a short span through all its events, with friction linearised at each of them."""
    n, left = len(run.x), span
    for _ in range(200):
        M, holding = _tangent(run, value, slope)
        start, before = np.concatenate([run.x, [1.0, 0.0, 1.0]]), run.x

        def state(s: float, M: Array = M, start: Array = start) -> Array:
            return np.asarray(expm(M * s) @ start)

        moment, which, side = left if run.modes else _reach(M, start, n, left), -1, 0
        for number, (row, low, high) in enumerate(_limit_rows(run, holding)):
            grid = np.linspace(0.0, moment, 5)
            for s, e in pairwise(grid):
                at = float(row @ state(e))
                slack = 1e-13 * abs(at) + 1e-300
                if at > high + slack or at < low - slack:
                    limit, side_b = (high, 1) if at > high + slack else (low, -1)

                    def miss(s: float, row: Array = row, limit: float = limit) -> float:
                        return float(row @ state(s)) - limit

                    begin = miss(s)
                    moment = s if begin * side_b >= 0.0 else brentq(miss, s, e, xtol=1e-18, rtol=1e-14)
                    which, side = number, side_b
                    break
        run.x = state(moment)[:n]
        run.friction.stop(run.x, before)
        left -= moment
        value += slope * moment
        if which >= 0:
            _switch(run, which, side, value)
        if left <= 1e-12 * span:
            return
    run.x = np.full(n, np.nan)


def _reach(M: Array, start: Array, n: int, span: float) -> float:
    """Part of `span` that the kernel's power series reaches; it takes new tangents there.

    Not for gaps: their dampers may relax in nanoseconds, and the kernel leaves them out of its series.
    """
    terms = [start]
    for k in range(1, SERIES_TERMS):
        terms.append(M @ terms[-1] * span / k)
    size = np.abs(terms)[:, :n]
    rounding = TOLERANCES.series_rounding
    for k in range(4, SERIES_TERMS):
        if (size[k] + size[k - 1] < size[:k].sum(axis=0) * rounding + 1e-300).all():
            return span
    for halved in range(60):
        powers = 0.5 ** (halved * np.arange(SERIES_TERMS))
        part = size * powers[:, None]
        if (part[-1] < part[:-2].sum(axis=0) * (100.0 * rounding) + 1e-300).all():
            return span * float(powers[1])
    return span * float(powers[1])


def _tangent(run: Simulation, value: float, slope: float) -> tuple[Array, dict[int, Array]]:
    """Matrix of the motion (x, 1, t, 1) with laws as tangents, and rows of the friction that masses at rest need."""
    n = len(run.x)
    H, K, G = run.low.H[:, :, 0], run.low.through[:, 0], run.low.G[:, :, 0]
    z = H @ run.x + K * value
    phi, by_port = run.laws(z)
    M = np.zeros((n + 3, n + 3))
    M[:n, :n] = run.matrix() + G.T @ (by_port[:, None] * H)
    M[:n, n] = run.low.B[:, 0] * value + run.low.c[:, 0] + G.T @ (phi + by_port * (K * value - z))
    M[:n, n + 1] = (run.low.B[:, 0] + G.T @ (by_port * K)) * slope
    M[n + 1, n + 2] = 1.0
    states = {k: run.low.stopped[k] for k in run.friction.sticking}
    holding = {k: -M[state] / G[k, state] for k, state in states.items()}
    M[list(states.values())] = 0.0
    return M, holding


def _limit_rows(run: Simulation, holding: dict[int, Array]) -> list[tuple[Array, float, float]]:
    """Row over (x, 1, t, 1) that gives each watched quantity, and its interval; as in `watched_quantities`."""
    n = len(run.x)
    unit = np.eye(n + 3)
    rows = []
    for b, element in enumerate(run.low.limited):
        assert element.limits is not None
        rate = np.concatenate([element.H[0].reshape(-1), np.zeros(3)])
        rows.append((unit[element.limits.state] if run.modes[b] == FREE else rate, *run.interval(b)))
    for k in run.friction.dry:
        side = run.friction.sides[k]
        row = side * unit[run.low.stopped[k]] if side else holding[k]
        rows.append((row, *run.friction.interval(k)))
    return rows


def _switch(run: Simulation, which: int, side: int, value: float) -> None:
    """Change the mode whose watched quantity reached the end `side` of its interval."""
    if which >= len(run.modes):
        k = run.friction.dry[which - len(run.modes)]
        if run.friction.sides[k] == 0.0:
            run.friction.sides[k] = -float(side)  # friction pushes to `side`, and the mass yields to the other
        else:
            run.x[run.low.stopped[k]] = 0.0
            run.friction.sides[k] = run.friction.side_of(k, run.needed(k, value))
        return
    limits = run.low.limited[which].limits
    assert limits is not None
    if run.modes[which] == FREE:
        run.x[limits.state] = run.interval(which)[1 if side > 0 else 0]
        run.modes[which] = side
    else:
        run.modes[which] = FREE
