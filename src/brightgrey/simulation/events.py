"""What a full step cannot do: halved steps where friction turns, and limits that are reached within a step.

One lane at a time. A base step is cut into ticks by powers of two; where a limited state reaches or leaves its
limit, the tick is gone through by Taylor series, friction linearised, and the event is found as the root of a
polynomial. So the moment of an event depends smoothly on all parameters.
"""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.compiled import inner
from brightgrey.simulation.lanes import LANES, get, put, real, set_whole, skip, whole
from brightgrey.simulation.laws import evaluate
from brightgrey.simulation.layout import SERIES_TERMS, table_rows
from brightgrey.simulation.propagators import mode_matrix, taylor_series
from brightgrey.simulation.step import leaves, step, watch

__all__ = ["drive_lane", "mode_bits", "polynomial", "reach", "refine", "set_force", "set_mode"]

_MOST_EVENTS = 200


@inner
def drive_lane(
    shape: Any,
    plant: Any,
    u: Any,
    k: Any,
    start: Any,
    size: Any,
    per_sample: Any,
    dt: Any,
    work: Any,
    lane: Any,
) -> None:
    """Delayed input of one lane on the ticks [start, start + size) after sample k: value, slope and kink.

    The kink is the change of slope (linear input) or the jump (held input) at a knot inside the step.
    """
    last = shape.samples - 1
    shift = get(plant.delay, 1, lane)
    index = k - int(get(plant.delay, 0, lane))
    part = start / per_sample - shift
    inside = False
    if part < -1e-12:
        part += 1.0
        index -= 1
        inside = (start + size) / per_sample - shift > 1e-12
    part = max(part, 0.0)
    here = real(u, min(max(index, 0), last))
    after = real(u, min(max(index + 1, 0), last))
    later = real(u, min(max(index + 2, 0), last))
    if shape.hold == 1:
        put(work.drive, 0, lane, here + (after - here) * part)
        put(work.drive, 1, lane, (after - here) / dt)
        put(work.drive, 2, lane, ((later - after) - (after - here)) / dt if inside else 0.0)
    else:
        put(work.drive, 0, lane, here)
        put(work.drive, 1, lane, 0.0)
        put(work.drive, 2, lane, after - here if inside else 0.0)


@inner
def set_mode(plant: Any, work: Any, b: Any, lane: Any, mode: Any) -> None:
    """Put limited state b of one lane into a mode: 0 free, 1 and -1 at the upper and lower limit, 2 closed."""
    infinite = float("inf")
    set_whole(work.mode, b * LANES + lane, mode)
    low, high = -infinite, infinite
    if mode == 0:
        low, high = get(plant.low, b, lane), get(plant.high, b, lane)
    elif mode == 1:
        low = 0.0
    elif mode == -1:
        high = 0.0
    put(work.free, b, lane, 1.0 if mode == 0 else 0.0)
    put(work.low, b, lane, low)
    put(work.high, b, lane, high)


@inner
def mode_bits(shape: Any, work: Any, lane: Any) -> Any:
    """Number of the lane's system matrix: bit b set where limited state b is free."""
    bits = 0
    for b in range(shape.limits):
        if whole(work.mode, b * LANES + lane) == 0:
            bits |= 1 << b
    return bits


@inner
def _linearised(shape: Any, plant: Any, value: Any, slope: Any, work: Any, lane: Any) -> None:
    """System of one lane at its present state, laws replaced by tangents: A in scratch, b0 and b1 in series."""
    n = shape.n
    A = work.scratch
    mode_matrix(shape, plant, mode_bits(shape, work, lane), A, lane)
    b0, b1 = skip(work.scratch, n * n), skip(work.scratch, n * n + n)
    for i in range(n):
        put(b0, i, lane, get(plant.B, i, lane) * value + get(plant.c, i, lane))
        put(b1, i, lane, get(plant.B, i, lane) * slope)
    for e in range(shape.elements):
        k = whole(plant.channel, e)
        through = get(plant.K, k, lane)
        port = through * value
        for i in range(n):
            port += get(plant.H, k * n + i, lane) * get(work.end, i, lane)
        phi, by_port = evaluate(whole(plant.law, e), plant.p, whole(plant.first, e), lane, port)
        for i in range(n):
            g = get(plant.G, k * n + i, lane)
            put(b0, i, lane, get(b0, i, lane) + g * (phi + by_port * (through * value - port)))
            put(b1, i, lane, get(b1, i, lane) + g * by_port * through * slope)
            for j in range(n):
                change = g * by_port * get(plant.H, k * n + j, lane)
                put(A, i * n + j, lane, get(A, i * n + j, lane) + change)


@inner
def polynomial(n: Any, series: Any, row: Any, at: Any, unit: Any, s: Any, lane: Any) -> Any:
    """Value at time s of state `unit` (if >= 0) or of the row from `at` on, by Horner's scheme."""
    total = 0.0
    for k in range(SERIES_TERMS - 1, -1, -1):
        if unit >= 0:
            term = get(series, k * n + unit, lane)
        else:
            term = 0.0
            for j in range(n):
                term += get(row, at + j, lane) * get(series, k * n + j, lane)
        total = total * s + term
    return total


@inner
def reach(n: Any, series: Any, s: Any, lane: Any) -> Any:
    """Largest s / 2^i for which the last Taylor term is below rounding."""
    for _ in range(60):
        good = True
        power = s ** (SERIES_TERMS - 1)
        for i in range(n):
            size, p = 0.0, 1.0
            for k in range(4):
                size += abs(get(series, k * n + i, lane)) * p
                p *= s
            if abs(get(series, (SERIES_TERMS - 1) * n + i, lane)) * power > 1e-14 * size + 1e-300:
                good = False
        if good:
            return s
        s *= 0.5
    return s


@inner
def _crossing(shape: Any, plant: Any, work: Any, b: Any, s: Any, lane: Any) -> Any:
    """First moment in (0, s] at which limited state b reaches a limit or leaves it, or -1, and which limit."""
    n = shape.n
    unit = whole(plant.limited, b) if whole(work.mode, b * LANES + lane) == 0 else -1
    low, high = get(work.low, b, lane), get(work.high, b, lane)
    at = b * n
    before, f_before = 0.0, polynomial(n, work.series, plant.rate, at, unit, 0.0, lane)
    for quarter in range(1, 5):
        now = 0.25 * quarter * s
        f = polynomial(n, work.series, plant.rate, at, unit, now, lane)
        slack = 1e-13 * (abs(f) + abs(f_before)) + 1e-300
        if f > high + slack or f < low - slack:
            limit, side = (high, 1) if f > high + slack else (low, -1)
            left, right = before, now
            for _ in range(80):
                middle = 0.5 * (left + right)
                if middle <= left or middle >= right:
                    break
                f = polynomial(n, work.series, plant.rate, at, unit, middle, lane)
                if (f - limit) * side > 0.0:
                    right = middle
                else:
                    left = middle
            return right, side
        before, f_before = now, f
    return -1.0, 0


@inner
def _creep(shape: Any, plant: Any, length: Any, value: Any, slope: Any, work: Any, lane: Any) -> None:
    """Carry ``work.end`` of one lane over `length` in s, through all events on the way."""
    n = shape.n
    time = 0.0
    for _ in range(_MOST_EVENTS):
        _linearised(shape, plant, value + slope * time, slope, work, lane)
        taylor_series(
            n,
            work.scratch,
            skip(work.scratch, n * n),
            skip(work.scratch, n * n + n),
            work.end,
            lane,
            work.series,
        )
        s = reach(n, work.series, length - time, lane)
        which, side = -1, 0
        for b in range(shape.limits):
            if whole(work.mode, b * LANES + lane) != 2:
                moment, at = _crossing(shape, plant, work, b, s, lane)
                if moment >= 0.0:
                    s, which, side = moment, b, at
        for i in range(n):
            put(work.end, i, lane, polynomial(n, work.series, plant.rate, 0, i, s, lane))
        if which >= 0:
            if whole(work.mode, which * LANES + lane) == 0:
                limit = get(plant.high, which, lane) if side > 0 else get(plant.low, which, lane)
                put(work.end, whole(plant.limited, which), lane, limit)
                set_mode(plant, work, which, lane, side)
            else:
                set_mode(plant, work, which, lane, 0)
        time += s
        if time >= length * (1.0 - 1e-12):
            return
    for i in range(n):  # too many events: rather no result than a wrong one
        put(work.end, i, lane, float("nan"))


@inner
def _creep_tick(shape: Any, plant: Any, start: Any, per_sample: Any, tick: Any, work: Any, lane: Any) -> None:
    """One tick by Taylor series, in two parts if the input has a knot inside; then F at its end."""
    n = shape.n
    for i in range(n):
        put(work.end, i, lane, get(work.x, i, lane))
    value, slope = get(work.drive, 0, lane), get(work.drive, 1, lane)
    kink = get(work.drive, 2, lane)
    if kink != 0.0:
        first = (get(plant.delay, 1, lane) * per_sample - start) * tick
        _creep(shape, plant, first, value, slope, work, lane)
        value += slope * first
        if shape.hold == 1:
            slope += kink
        else:
            value += kink
        _creep(shape, plant, tick - first, value, slope, work, lane)
        value += slope * (tick - first)
    else:
        _creep(shape, plant, tick, value, slope, work, lane)
        value += slope * tick
    set_force(shape, plant, value, work, lane)


@inner
def set_force(shape: Any, plant: Any, value: Any, work: Any, lane: Any) -> None:
    """F of all channels at ``work.end`` for one lane; its rate of change is not known and taken as zero."""
    n = shape.n
    for k in range(shape.channels):
        port = get(plant.K, k, lane) * value
        for i in range(n):
            port += get(plant.H, k * n + i, lane) * get(work.end, i, lane)
        total = 0.0
        for e in range(shape.elements):
            if whole(plant.channel, e) == k:
                phi, _ = evaluate(whole(plant.law, e), plant.p, whole(plant.first, e), lane, port)
                total += phi
        put(work.force, k, lane, total)
        put(work.slope, k, lane, 0.0)


@inner
def refine(
    shape: Any,
    plant: Any,
    control: Any,
    u: Any,
    k: Any,
    base: Any,
    dt: Any,
    work: Any,
    lane: Any,
    follow: Any,
) -> None:
    """Base step `base` after sample k for one lane, in halved steps: from ``work.x`` to ``work.end``.

    The first lane, or a lane on its own, chooses the steps and writes them to ``work.plan``; with `follow` that
    plan is taken, cut finer only where the lane's own events ask for it.
    """
    ticks = 1 << shape.ticks
    per_sample = float(ticks * shape.base_steps)
    tick = dt / per_sample
    position, level = 0, shape.ticks
    rows = table_rows(shape.n, shape.channels, shape.limits)
    while position < ticks:
        if follow:
            level = min(level, whole(work.plan, position))
            while position & ((1 << level) - 1):
                level -= 1
        size = 1 << level
        start = base * ticks + position
        drive_lane(shape, plant, u, k, float(start), float(size), per_sample, dt, work, lane)
        table = skip(work.tables, (mode_bits(shape, work, lane) * (shape.ticks + 1) + level) * rows)
        failed, coarse = step(shape, plant, control, table, size * tick, work, lane)
        out = 0
        for b in range(shape.limits):
            out |= leaves(work, b, lane, get(work.ahead, b, lane), watch(shape, plant, work, b, work.end, lane))
        if level > 0 and (failed or out or (coarse and not follow)):
            level -= 1
            continue
        if out or failed:
            _creep_tick(shape, plant, float(start), per_sample, tick, work, lane)
        else:
            for c in range(shape.channels):
                f1, f2 = get(work.F1, c, lane), get(work.F2, c, lane)
                put(work.force, c, lane, f2)
                put(work.slope, c, lane, (f2 - f1) * (1.5 / (size * tick)))
        for i in range(shape.n):
            put(work.x, i, lane, get(work.end, i, lane))
        for b in range(shape.limits):
            put(work.event, b, lane, watch(shape, plant, work, b, work.x, lane))
        if not follow:
            for i in range(position, position + size):
                set_whole(work.plan, i, level)
        position += size
        if follow:
            level = shape.ticks
        elif level < shape.ticks and not position & size and 8.0 * get(work.error, 0, lane) < control[0]:
            level += 1  # the estimate grows eightfold with twice the step
