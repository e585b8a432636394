"""Step of the simulation: exponential Radau IIA with two stages.

The linear part, the input and its kink are exact. The channels' forces F are linear in time through the stages at h/3
and h. The method has order 3 and is L-stable, which stiff friction near standstill needs. The forces are found by
Newton's method on the ports, with a fixed number of iterations so that no lane waits for another.
"""

from __future__ import annotations

from typing import Any

from brightgrey.effects.arithmetic import magnitude
from brightgrey.simulation.kernel.law_dispatch import channel_forces, dry_forces
from brightgrey.simulation.kernel.machine.compilation import inlined, inner
from brightgrey.simulation.kernel.machine.memory_layout import end_rows
from brightgrey.simulation.kernel.machine.simd import (
    choose_lanes,
    choose_less,
    get,
    lanes_not_less,
    put,
    real,
    splat,
    whole,
)

__all__ = [
    "accept",
    "accept_some",
    "estimate",
    "lanes_leaving_interval",
    "radau_step",
    "solve_dry_stages",
    "solve_stages",
    "watched_quantity",
]


@inlined
def _linear_part(shape: Any, delayed: Any, table: Any, at: Any, work: Any) -> Any:
    """Product of a row of the step table with state and input, without F."""
    n = shape.n
    total = get(table, at + n + 2, None)
    for j in range(n):
        total = total + get(table, at + j, None) * get(work.x, j, None)
    total = total + get(table, at + n, None) * get(work.drive, 0, None)
    total = total + get(table, at + n + 1, None) * get(work.drive, 1, None)
    if delayed == 1:  # only then the input has a kink within a step
        total = total + get(table, at + n + 3 + 2 * shape.channels, None) * get(work.drive, 2, None)
    return total


@inlined
def _add_forces(shape: Any, table: Any, at: Any, work: Any, total: Any, who: Any) -> Any:
    """Add the effect of F, weights from row `at` of the table on."""
    m = shape.channels
    for k in range(m):
        total = total + get(table, at + k, who) * get(work.F1, k, who)
        total = total + get(table, at + m + k, who) * get(work.F2, k, who)
    return total


@inlined
def _newton_one(shape: Any, plant: Any, table: Any, middle: Any, end: Any, work: Any, who: Any) -> Any:
    """One Newton iteration for a single channel; returns the larger change of the two ports."""
    s1, s2 = get(table, middle, who), get(table, middle + 1, who)
    e1, e2 = get(table, end, who), get(table, end + 1, who)
    a1, a2 = get(work.a1, 0, who), get(work.a2, 0, who)
    z1, z2 = get(work.z1, 0, who), get(work.z2, 0, who)
    f1, d1, f2, d2 = channel_forces(shape, plant, 0, z1, z2, who)
    r1, r2 = f1 + d1 * (a1 - z1), f2 + d2 * (a2 - z2)
    m11, m12 = 1.0 - d1 * s1, d1 * s2
    m21, m22 = d2 * e1, 1.0 - d2 * e2
    scale = 1.0 / (m11 * m22 - m12 * m21)
    f1 = (r1 * m22 + r2 * m12) * scale
    f2 = (r2 * m11 + r1 * m21) * scale
    new1 = a1 + s1 * f1 + s2 * f2
    new2 = a2 + e1 * f1 + e2 * f2
    put(work.F1, 0, who, f1)
    put(work.F2, 0, who, f2)
    put(work.z1, 0, who, new1)
    put(work.z2, 0, who, new2)
    return _larger(magnitude(new1 - z1), magnitude(new2 - z2))


@inner
def _larger(a: Any, b: Any) -> Any:
    """Larger of two; not a number if either is none."""
    return choose_less(a, b, b, choose_less(b, a, a, a + 0.0 * b))


@inner
def _newton(shape: Any, plant: Any, table: Any, middle: Any, stride: Any, end: Any, work: Any, who: Any) -> Any:
    """One Newton iteration for any number of channels: (I - D S) F = phi + D (a - z), then z = a + S F."""
    m = shape.channels
    size = 2 * m
    for k in range(m):
        force1, slope1, force2, slope2 = channel_forces(
            shape, plant, k, get(work.z1, k, who), get(work.z2, k, who), who
        )
        for half in range(2):
            z, a = (work.z1, work.a1) if half == 0 else (work.z2, work.a2)
            row = half * m + k
            weights = middle + k * stride if half == 0 else end + k * size
            force, slope = (force1, slope1) if half == 0 else (force2, slope2)
            put(work.rhs, row, who, force + slope * (get(a, k, who) - get(z, k, who)))
            for j in range(size):
                entry = -(slope * get(table, weights + j, who))
                put(work.M, row * size + j, who, entry + 1.0 if j == row else entry)
    return solve_ports(shape, table, middle, stride, end, work, who)


@inlined
def solve_ports(shape: Any, table: Any, middle: Any, stride: Any, end: Any, work: Any, who: Any) -> Any:
    """Solve ``work.M`` F = ``work.rhs`` for the forces at both stages, and move the ports; the largest change."""
    m = shape.channels
    size = 2 * m
    for i in range(size):
        pivot = 1.0 / get(work.M, i * size + i, who)
        for r in range(i + 1, size):
            factor = get(work.M, r * size + i, who) * pivot
            for j in range(i + 1, size):
                put(
                    work.M,
                    r * size + j,
                    who,
                    get(work.M, r * size + j, who) - factor * get(work.M, i * size + j, who),
                )
            put(work.rhs, r, who, get(work.rhs, r, who) - factor * get(work.rhs, i, who))
    for i in range(size - 1, -1, -1):
        total = get(work.rhs, i, who)
        for j in range(i + 1, size):
            total = total - get(work.M, i * size + j, who) * get(work.rhs, j, who)
        put(work.rhs, i, who, total / get(work.M, i * size + i, who))
    for k in range(m):
        put(work.F1, k, who, get(work.rhs, k, who))
        put(work.F2, k, who, get(work.rhs, m + k, who))
    change = splat(0.0, who)
    for k in range(m):
        z1 = _add_forces(shape, table, middle + k * stride, work, get(work.a1, k, who), who)
        z2 = _add_forces(shape, table, end + k * size, work, get(work.a2, k, who), who)
        change = _larger(change, magnitude(z1 - get(work.z1, k, who)))
        change = _larger(change, magnitude(z2 - get(work.z2, k, who)))
        put(work.z1, k, who, z1)
        put(work.z2, k, who, z2)
    return change


@inlined
def lanes_leaving_interval(shape: Any, work: Any, b: Any, points: Any, end: Any, who: Any) -> Any:
    """Lanes in which the watched quantity of limited state b leaves its interval during a step.

    Its values within the step stand in ``work.inner_watched``, and `end` is the value at the end of the step. Parabolas
    between these values show an exit and a return between two points. The slack is rounding: a quantity that rests at
    its limit does not leave it.
    """
    s0, s1 = get(work.watched, b, who), get(work.inner_watched, b * shape.points, who)
    slack = (magnitude(s0) + magnitude(end)) * 1e-12 + 1e-300
    low, high = get(work.low, b, who) - slack, get(work.high, b, who) + slack
    out = lanes_not_less(end, high) | lanes_not_less(low, end)
    if points == 1:  # at 0, h/3 and h
        slope = (s1 - s0) * 4.5 - (end - s0) * 0.5
        bend = (end - s0) - slope
        peak = slope * -0.5 / bend
        extreme = s0 + peak * (slope + peak * bend)
        extreme = choose_less(0.0, peak, choose_less(peak, 1.0, extreme, end), end)
        return out | lanes_not_less(extreme, high) | lanes_not_less(low, extreme)
    for i in range(points):
        s2 = end
        if i < points - 1:
            s2 = get(work.inner_watched, b * shape.points + i + 1, who)
        # The parabola's extreme lies within the two intervals if |rise| < 2 |bend|, and rise^2 / 4 bend beyond s1.
        rise, bend = (s2 - s0) * 0.5, (s2 + s0) * 0.5 - s1
        room = choose_less(bend, 0.0, bend * (s1 - high), bend * (s1 - low)) * 4.0
        beyond = choose_less(room, rise * rise, float("inf"), s1)
        seen = choose_less(magnitude(rise), magnitude(bend) * 2.0, beyond, s1)
        out |= lanes_not_less(seen, high) | lanes_not_less(low, s1)
        s0, s1 = s1, s2
    return out


@inlined
def watched_quantity(shape: Any, plant: Any, work: Any, b: Any, state: Any, who: Any) -> Any:
    """Watched quantity of limited state b: the state itself where it is free, otherwise its rate."""
    total = splat(0.0, who)
    for j in range(shape.n):
        total = total + get(plant.rate, b * shape.n + j, who) * get(state, j, who)
    return choose_less(0.5, get(work.free, b, who), get(state, whole(plant.limited, b), who), total)


@inlined
def stage_guess(shape: Any, table: Any, middle: Any, stride: Any, end: Any, h: Any, work: Any, who: Any) -> None:
    """First guess of forces and ports at both stages: F goes on as before."""
    m = shape.channels
    for k in range(m):
        force, rate = get(work.force, k, who), get(work.slope, k, who) * h
        put(work.F1, k, who, force + rate * (1.0 / 3.0))
        put(work.F2, k, who, force + rate)
    for k in range(m):
        put(work.z1, k, who, _add_forces(shape, table, middle + k * stride, work, get(work.a1, k, who), who))
        put(work.z2, k, who, _add_forces(shape, table, end + k * 2 * m, work, get(work.a2, k, who), who))


@inlined
def solve_stages(
    shape: Any,
    plant: Any,
    call: Any,
    table: Any,
    middle: Any,
    stride: Any,
    end: Any,
    h: Any,
    work: Any,
    who: Any,
) -> Any:
    """Solve for F1 and F2; return the lanes in which Newton's method failed.

    ``work.a1`` and ``work.a2`` hold the ports without F. The effect of each F1 and F2 on the ports is in `table`. It is
    there from row `middle` on for h/3, with `stride` rows per port, and from row `end` on for the end of the step.
    """
    m = shape.channels
    stage_guess(shape, table, middle, stride, end, h, work, who)
    change = splat(0.0, who)
    for _ in range(shape.newton):
        if m == 1:
            change = _newton_one(shape, plant, table, middle, end, work, who)
        else:
            change = _newton(shape, plant, table, middle, stride, end, work, who)
    return lanes_not_less(change, splat(real(call.numbers, 2), who))


@inner
def solve_dry_stages(
    shape: Any, plant: Any, call: Any, table: Any, middle: Any, stride: Any, end: Any, h: Any, work: Any, who: Any
) -> Any:
    """As `solve_stages` with exact friction: (s I - d S) F = phi + d (a - z), where rows of rest have s = 0.

    Such a row says z = 0: s = 0, d = -1 and phi = -z.
    """
    m = shape.channels
    size = 2 * m
    stage_guess(shape, table, middle, stride, end, h, work, who)
    for k in range(m):
        moves = _moves(plant, work, k, who)
        put(work.z1, k, who, moves * get(work.z1, k, who))
        put(work.z2, k, who, moves * get(work.z2, k, who))
    change = splat(0.0, who)
    for _ in range(shape.newton):
        for k in range(m):
            z1, z2 = get(work.z1, k, who), get(work.z2, k, who)
            moves = _moves(plant, work, k, who)
            rests = 1.0 - moves
            if whole(plant.stopped, k) >= 0:
                f1, d1, f2, d2 = dry_forces(shape, plant, k, z1, z2, get(work.side, k, who), who)
                f1, d1 = moves * f1 - rests * z1, moves * d1 - rests
                f2, d2 = moves * f2 - rests * z2, moves * d2 - rests
            else:
                f1, d1, f2, d2 = channel_forces(shape, plant, k, z1, z2, who)
            for j in range(size):
                put(work.M, k * size + j, who, -d1 * get(table, middle + k * stride + j, who))
                put(work.M, (m + k) * size + j, who, -d2 * get(table, end + k * size + j, who))
            put(work.M, k * size + k, who, get(work.M, k * size + k, who) + moves)
            put(work.M, (m + k) * (size + 1), who, get(work.M, (m + k) * (size + 1), who) + moves)
            put(work.rhs, k, who, f1 + d1 * (get(work.a1, k, who) - z1))
            put(work.rhs, m + k, who, f2 + d2 * (get(work.a2, k, who) - z2))
        change = solve_ports(shape, table, middle, stride, end, work, who)
    return lanes_not_less(change, splat(real(call.numbers, 2), who))


@inlined
def _moves(plant: Any, work: Any, k: Any, who: Any) -> Any:
    """0 where the mass of channel k sticks, else 1."""
    if whole(plant.stopped, k) < 0:
        return splat(1.0, who)
    side = get(work.side, k, who)
    return choose_less(0.0, side * side, splat(1.0, who), splat(0.0, who))


@inlined
def estimate(shape: Any, plant: Any, call: Any, h: Any, work: Any, who: Any) -> Any:
    """Write the error estimate to ``work.error``; return the lanes in which it is too large."""
    error = splat(0.0, who)
    for k in range(shape.channels):
        # Difference between F at the start and its extrapolation from the stages: the curvature over the step.
        bend = get(work.force, k, who) - (get(work.F1, k, who) * 1.5 - get(work.F2, k, who) * 0.5)
        error = _larger(error, magnitude(bend) * get(plant.gain, k, who))
    error = error * h
    put(work.error, 0, who, error)
    return lanes_not_less(error, splat(real(call.numbers, 1), who))


@inlined
def radau_step(shape: Any, plant: Any, call: Any, table: Any, h: Any, points: Any, work: Any) -> Any:
    """Step from ``work.x`` to ``work.end``: (lanes in which Newton's method failed, lanes with too large an error).

    ``call.numbers`` holds the tolerated error estimate and the tolerated last change of Newton.
    Watched quantities at the step's `points` are written to ``work.inner_watched``.
    """
    n, m = shape.n, shape.channels
    width = n + 4 + 2 * m
    stage = end_rows(n, m)
    for i in range(n):
        put(work.end, i, None, _linear_part(shape, call.delayed, table, i * width, work))
    failed, coarse = 0, 0
    if m > 0:
        for k in range(m):
            put(work.a1, k, None, _linear_part(shape, call.delayed, table, stage + k * width, work))
            a2 = get(plant.K, k, None) * (get(work.drive, 0, None) + get(work.drive, 1, None) * h)
            for i in range(n):
                a2 = a2 + get(plant.H, k * n + i, None) * get(work.end, i, None)
            put(work.a2, k, None, a2)
        coupling = stage + (m + shape.limits * shape.points) * width
        if shape.dry == 1:
            failed = solve_dry_stages(shape, plant, call, table, stage + n + 3, width, coupling, h, work, None)
        else:
            failed = solve_stages(shape, plant, call, table, stage + n + 3, width, coupling, h, work, None)
        coarse = estimate(shape, plant, call, h, work, None)
        for i in range(n):
            start = i * width + n + 3
            put(work.end, i, None, _add_forces(shape, table, start, work, get(work.end, i, None), None))
    for b in range(shape.limits):
        for i in range(points):
            row = b * shape.points + i
            at = stage + (m + row) * width
            value = _linear_part(shape, call.delayed, table, at, work)
            put(work.inner_watched, row, None, _add_forces(shape, table, at + n + 3, work, value, None))
    return failed, coarse


@inlined
def accept(shape: Any, plant: Any, work: Any, h: Any, who: Any) -> None:
    """Accept a step of length h."""
    for c in range(shape.channels):
        f1, f2 = get(work.F1, c, who), get(work.F2, c, who)
        put(work.force, c, who, f2)
        put(work.slope, c, who, (f2 - f1) * (1.5 / h))
    for b in range(shape.limits):
        put(work.watched, b, who, watched_quantity(shape, plant, work, b, work.end, who))
    for i in range(shape.n):
        put(work.x, i, who, get(work.end, i, who))


@inlined
def accept_some(shape: Any, plant: Any, work: Any, h: Any, some: Any) -> None:
    """Accept a step of length h in the lanes whose bit is set in `some`."""
    for c in range(shape.channels):
        f1, f2 = get(work.F1, c, None), get(work.F2, c, None)
        put(work.force, c, None, choose_lanes(some, f2, get(work.force, c, None)))
        put(work.slope, c, None, choose_lanes(some, (f2 - f1) * (1.5 / h), get(work.slope, c, None)))
    for b in range(shape.limits):
        end = watched_quantity(shape, plant, work, b, work.end, None)
        put(work.watched, b, None, choose_lanes(some, end, get(work.watched, b, None)))
    for i in range(shape.n):
        put(work.x, i, None, choose_lanes(some, get(work.end, i, None), get(work.x, i, None)))
