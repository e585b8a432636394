"""A tick in which a limited state reaches or leaves its limit: by Taylor series, friction linearised.

The moment of an event is the root of a polynomial, so it depends smoothly on all parameters.
"""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.compiled import Entry, inner
from brightgrey.simulation.lanes import LANES, get, put, real, skip, whole
from brightgrey.simulation.laws import channel_force
from brightgrey.simulation.layout import SERIES_TERMS, call_of, plant_of, shape_of, work_of
from brightgrey.simulation.modes import mode_bits, set_force, set_mode
from brightgrey.simulation.propagators import mode_matrix, taylor_series

__all__ = ["creep", "polynomial", "reach"]

_MOST_EVENTS = 200


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
    for k in range(shape.channels):
        through = get(plant.K, k, lane)
        port = through * value
        for i in range(n):
            port += get(plant.H, k * n + i, lane) * get(work.end, i, lane)
        phi, by_port = channel_force(shape, plant, k, port, lane)
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
def _root(course: Any, limit: Any, left: Any, right: Any, scale: Any, lane: Any) -> Any:
    """Moment in (left, right] at which the polynomial `course` passes `limit`: Newton's method, kept in the bracket."""
    side = 1.0 if polynomial(1, course, course, 0, 0, right, lane) > limit else -1.0
    moment = right
    for _ in range(60):
        value, slope = 0.0, 0.0
        for k in range(SERIES_TERMS - 1, -1, -1):
            slope = slope * moment + value
            value = value * moment + get(course, k, lane)
        value = (value - limit) * side
        if value > 0.0:
            right = moment
        else:
            left = moment
        guess = moment - value / (slope * side) if slope != 0.0 else left
        if not (left < guess < right):
            guess = 0.5 * (left + right)
        if abs(guess - moment) <= 1e-16 * scale or guess <= left or guess >= right:
            return guess
        moment = guess
    return moment


@inner
def _crossing(shape: Any, plant: Any, work: Any, b: Any, s: Any, lane: Any) -> Any:
    """First moment in (0, s] at which limited state b reaches a limit or leaves it, or -1, and which limit."""
    n = shape.n
    free = whole(work.mode, b * LANES + lane) == 0
    course = skip(work.scratch, n * n + 6 * n)
    for k in range(SERIES_TERMS):
        term = 0.0
        if free:
            term = get(work.series, k * n + whole(plant.limited, b), lane)
        else:
            for j in range(n):
                term += get(plant.rate, b * n + j, lane) * get(work.series, k * n + j, lane)
        put(course, k, lane, term)
    low, high = get(work.low, b, lane), get(work.high, b, lane)
    before, f_before = 0.0, get(course, 0, lane)
    for quarter in range(1, 5):
        now = 0.25 * quarter * s
        f = polynomial(1, course, course, 0, 0, now, lane)
        slack = 1e-13 * (abs(f) + abs(f_before)) + 1e-300
        if f > high + slack:
            return _root(course, high, before, now, s, lane), 1
        if f < low - slack:
            return _root(course, low, before, now, s, lane), -1
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


@Entry
def creep(block: Any, start: Any, lane: Any) -> None:
    """Carry one lane over the tick `start` after a sample, in two parts if the input has a knot inside; then F.

    Input in ``work.drive``, from ``work.x`` to ``work.end``.
    """
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    n = shape.n
    per_sample = float((1 << shape.ticks) * shape.base_steps)
    tick = real(call.numbers, 0) / per_sample
    for i in range(n):
        put(work.end, i, lane, get(work.x, i, lane))
    value, slope = get(work.drive, 0, lane), get(work.drive, 1, lane)
    kink = get(work.drive, 2, lane)
    parts, length = 1, tick
    if kink != 0.0:
        parts, length = 2, (get(plant.delay, 1, lane) * per_sample - start) * tick
    for part in range(parts):
        if part == 1:
            if shape.hold == 1:
                slope += kink
            else:
                value += kink
            length = tick - length
        _creep(shape, plant, length, value, slope, work, lane)
        value += slope * length
    set_force(shape, plant, value, work, lane)
