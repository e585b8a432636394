"""Location of events: a tick in which a limited state reaches or leaves its limit, by Taylor series.

Friction is linearised. The moment of an event is the root of a polynomial; while a gap is open, an exponential is added
to it. The moment therefore depends smoothly on all parameters.
"""

from __future__ import annotations

import math
from typing import Any

from brightgrey.simulation.kernel.contact_modes import mode_bits, set_force, set_mode
from brightgrey.simulation.kernel.dry_friction import (
    force_at_point,
    friction_interval,
    set_dry_forces,
    sticks,
    switch_friction,
)
from brightgrey.simulation.kernel.machine.compilation import Entry, inner
from brightgrey.simulation.kernel.machine.memory_layout import call_of, plant_of, shape_of, work_of
from brightgrey.simulation.kernel.machine.simd import LANES, get, put, real, splat, whole
from brightgrey.simulation.kernel.taylor_series import expand, mode_columns, value_at
from brightgrey.simulation.kernel.tolerances import TOLERANCES

__all__ = ["locate_events"]


@inner
def _linearised(shape: Any, plant: Any, value: Any, slope: Any, work: Any, lane: Any) -> None:
    """Write the system of one lane to ``work.system``, with laws replaced by their tangents at its present state."""
    n = shape.n
    mode_columns(shape, plant, mode_bits(shape, work, lane), work, lane)
    for i in range(n):
        put(work.system, n, i, get(plant.B, i, lane) * value + get(plant.c, i, lane))
        put(work.system, n + 1, i, get(plant.B, i, lane) * slope)
    for k in range(shape.channels):
        through = get(plant.K, k, lane)
        port, phi, by_port = force_at_point(shape, plant, k, value, work, lane)
        rest = phi + by_port * (through * value - port)
        for i in range(n):
            g = get(plant.G, k * n + i, lane)
            if g == 0.0:
                continue
            put(work.system, n, i, get(work.system, n, i) + g * rest)
            put(work.system, n + 1, i, get(work.system, n + 1, i) + g * by_port * through * slope)
            for j in range(n):
                change = g * by_port * get(plant.H, k * n + j, lane)
                put(work.system, j, i, get(work.system, j, i) + change)
    for k in range(shape.channels):
        if sticks(plant, work, k, lane):
            row = whole(plant.stopped, k)
            for j in range(n + 2):
                put(work.holding, k, j, -get(work.system, j, row) / get(plant.G, k * n + row, lane))
                put(work.system, j, row, 0.0)


@inner
def _is_stiff(shape: Any, plant: Any, b: Any, span: Any, work: Any, lane: Any) -> Any:
    """True if limited state b is free, relaxes many times within `span`, and moves no other state."""
    n, row = shape.n, whole(plant.limited, b)
    own = get(plant.rate, b * n + row, lane)
    if whole(work.mode, b * LANES + lane) != 0 or -own * span < TOLERANCES.stiff_time_constants:
        return False
    for i in range(n):
        moved = abs(get(work.system, row, i)) > TOLERANCES.negligible_coupling * abs(
            get(plant.column, b * n + i, lane) * own
        )
        if moved and i != row:
            return False
    return True


@inner
def _make_quasi_steady(shape: Any, plant: Any, b: Any, terms: Any, reach: Any, work: Any, lane: Any) -> Any:
    """Replace the series of a stiff limited state b by its quasi-steady course; True if it is stiff in the reach.

    The state obeys x' = p - a x, and ``work.series`` holds the integral of p. Its quasi-steady course is the finite sum
    p/a - p'/a^2 + p''/a^3 ..., as p is a polynomial. The initial distance from that course fades with exp(-a t).
    """
    row = whole(plant.limited, b)
    a = -get(plant.rate, b * shape.n + row, lane) * reach
    before = real(work.series, row)
    follows = 0.0
    for k in range(terms - 2, -1, -1):
        pull = (k + 1.0) * real(work.series, (k + 1) * LANES + row)
        put(work.series, k + 1, row, follows)
        follows = (pull - (k + 1.0) * follows) / a
    put(work.series, 0, row, follows)
    put(work.fading, 0, b, before - follows)
    put(work.fading, 1, b, a)
    return a >= TOLERANCES.stiff_time_constants


@inner
def _forget_fading(shape: Any, work: Any) -> None:
    """Set the distance of all limited states from their series to zero."""
    for b in range(shape.limits):
        put(work.fading, 0, b, 0.0)
        put(work.fading, 1, b, 0.0)


@inner
def _motion_series(shape: Any, plant: Any, span: Any, value: Any, slope: Any, work: Any, lane: Any) -> Any:
    """Series of the motion from ``work.point`` on: (reach, number of terms).

    While a gap is open, its damper may relax within nanoseconds (d/c), and a power series of its position would not
    reach further. The other states do not depend on the gap then. The series is theirs, and the gap's position follows
    them apart from an exponential.
    """
    _linearised(shape, plant, value, slope, work, lane)
    stiff = 0
    _forget_fading(shape, work)
    for b in range(shape.limits):
        if _is_stiff(shape, plant, b, span, work, lane):
            stiff |= 1 << b
            for i in range(shape.n):
                put(work.system, whole(plant.limited, b), i, 0.0)
    if stiff:
        reach, terms = expand(shape.n, work, span)
        follows = True
        for b in range(shape.limits):
            if (stiff >> b) & 1 and not _make_quasi_steady(shape, plant, b, terms, reach, work, lane):
                follows = False
        if follows:
            return reach, terms
        _forget_fading(shape, work)
        _linearised(shape, plant, value, slope, work, lane)
    return expand(shape.n, work, span)


@inner
def _course_value(course: Any, terms: Any, off: Any, rate: Any, part: Any) -> Any:
    """Value of the polynomial `course` by Horner's scheme, plus the distance `off` it, which fades."""
    total = 0.0
    for k in range(terms - 1, -1, -1):
        total = total * part + real(course, k)
    return total + off * math.exp(-rate * part) if off != 0.0 else total


@inner
def _course_root(course: Any, terms: Any, off: Any, rate: Any, limit: Any, left: Any, right: Any) -> Any:
    """Point in (left, right] at which a course passes `limit`, by Newton's method within a bracket.

    Near the root an iteration squares the distance, so that the iteration after a change of 1e-9 is exact.
    """
    side = 1.0 if _course_value(course, terms, off, rate, right) > limit else -1.0
    moment = right
    for _ in range(60):
        value, slope = 0.0, 0.0
        for k in range(terms - 1, -1, -1):
            slope = slope * moment + value
            value = value * moment + real(course, k)
        if off != 0.0:
            rest = off * math.exp(-rate * moment)
            value += rest
            slope -= rate * rest
        value = (value - limit) * side
        if value > 0.0:
            right = moment
        else:
            left = moment
        guess = moment - value / (slope * side) if slope != 0.0 else left
        if not (left < guess < right):
            guess = 0.5 * (left + right)
        if abs(guess - moment) <= 1e-9 or guess <= left or guess >= right:
            return guess
        moment = guess
    return moment


@inner
def _limit_course(shape: Any, plant: Any, work: Any, b: Any, terms: Any, lane: Any) -> None:
    """Write the watched quantity of limited state b to ``work.course``."""
    n = shape.n
    free = whole(work.mode, b * LANES + lane) == 0
    for k in range(terms):
        term = 0.0
        if free:
            term = real(work.series, k * LANES + whole(plant.limited, b))
        else:
            for j in range(n):
                term += get(plant.rate, b * n + j, lane) * real(work.series, k * LANES + j)
        put(work.course, 0, k, term)


@inner
def _friction_course(shape: Any, plant: Any, work: Any, c: Any, terms: Any, reach: Any, lane: Any) -> None:
    """Write what ends the mode of channel c to ``work.course``: side times speed, or the friction that rest needs."""
    side, n = get(work.side, c, lane), shape.n
    for k in range(terms):
        term = side * real(work.series, k * LANES + whole(plant.stopped, c))
        if side == 0.0:
            term = get(work.holding, c, n) if k == 0 else reach * get(work.holding, c, n + 1) if k == 1 else 0.0
            for j in range(n):
                term += get(work.holding, c, j) * real(work.series, k * LANES + j)
        put(work.course, 0, k, term)


@inner
def _first_crossing(course: Any, terms: Any, off: Any, rate: Any, low: Any, high: Any) -> Any:
    """First part of the reach at which a course leaves its interval, or -1, and at which end."""
    before, f_before = 0.0, real(course, 0) + off
    for quarter in range(1, 5):
        now = 0.25 * quarter
        f = _course_value(course, terms, off, rate, now)
        slack = 1e-13 * (abs(f) + abs(f_before)) + 1e-300
        if f > high + slack:
            return _course_root(course, terms, off, rate, high, before, now), 1
        if f < low - slack:
            return _course_root(course, terms, off, rate, low, before, now), -1
        before, f_before = now, f
    return -1.0, 0


@inner
def _first_event(shape: Any, plant: Any, terms: Any, reach: Any, work: Any, lane: Any) -> Any:
    """Part of the reach at which the first mode ends, or 1, which limited state or channel behind them, and the end."""
    part, which, side = 1.0, -1, 0
    for b in range(shape.limits):
        if whole(work.mode, b * LANES + lane) != 2:
            _limit_course(shape, plant, work, b, terms, lane)
            off, rate = get(work.fading, 0, b), get(work.fading, 1, b)
            low, high = get(work.low, b, lane), get(work.high, b, lane)
            moment, at = _first_crossing(work.course, terms, off, rate, low, high)
            if 0.0 <= moment <= part:
                part, which, side = moment, b, at
    if shape.dry == 1:
        for c in range(shape.channels):
            if whole(plant.stopped, c) >= 0:
                _friction_course(shape, plant, work, c, terms, reach, lane)
                low, high = friction_interval(work, c, lane)
                moment, at = _first_crossing(work.course, terms, 0.0, 0.0, low, high)
                if 0.0 <= moment <= part:
                    part, which, side = moment, shape.limits + c, at
    return part, which, side


@inner
def _pass_all_events(shape: Any, plant: Any, length: Any, value: Any, slope: Any, work: Any, lane: Any) -> None:
    """Carry ``work.point`` of one lane over `length` in s, through all events on the way."""
    time = 0.0
    for _ in range(TOLERANCES.max_events):
        s, terms = _motion_series(shape, plant, length - time, value + slope * time, slope, work, lane)
        part, which, side = _first_event(shape, plant, terms, s, work, lane)
        put(work.point, 0, None, value_at(work, terms, part))
        for b in range(shape.limits):
            off = get(work.fading, 0, b)
            if off != 0.0:
                row = whole(plant.limited, b)
                rest = off * math.exp(-get(work.fading, 1, b) * part)
                put(work.point, 0, row, get(work.point, 0, row) + rest)
        time += s * part
        if which >= shape.limits:
            switch_friction(shape, plant, which - shape.limits, side, value + slope * time, work, lane)
        elif which >= 0:
            if whole(work.mode, which * LANES + lane) == 0:
                limit = get(plant.high, which, lane) if side > 0 else get(plant.low, which, lane)
                put(work.point, 0, whole(plant.limited, which), limit)
                set_mode(shape, plant, work, which, lane, side)
            else:
                set_mode(shape, plant, work, which, lane, 0)
        if time >= length * (1.0 - 1e-12):
            return
    put(work.point, 0, None, splat(float("nan"), None))  # too many events: no result is better than a wrong one


@Entry
def locate_events(block: Any, start: Any, lane: Any) -> None:
    """Carry one lane over the tick `start` after a sample, from ``work.x`` to ``work.end``, and set F there.

    The input is in ``work.drive``; if it has a knot inside the tick, the tick is taken in two parts.
    """
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    n = shape.n
    per_sample = float((1 << shape.ticks) * shape.base_steps)
    tick = real(call.numbers, 0) / per_sample
    for i in range(n):
        put(work.point, 0, i, get(work.x, i, lane))
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
        _pass_all_events(shape, plant, length, value, slope, work, lane)
        value += slope * length
    for i in range(n):
        put(work.end, i, lane, get(work.point, 0, i))
    if shape.dry == 1:
        set_dry_forces(shape, plant, value, work, lane)
    else:
        set_force(shape, plant, value, work, lane)
