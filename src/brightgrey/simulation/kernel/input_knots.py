"""Dead time: the knots of the delayed input fall between samples, at a different point in every lane."""

from __future__ import annotations

import math
from typing import Any

from brightgrey.simulation.kernel.exponentials import mode_matrix, propagator_over
from brightgrey.simulation.kernel.machine.compilation import Entry, inner
from brightgrey.simulation.kernel.machine.memory_layout import (
    call_of,
    end_rows,
    plant_of,
    points_of,
    shape_of,
    table_rows,
    work_of,
)
from brightgrey.simulation.kernel.machine.simd import (
    LANES,
    choose_lanes,
    choose_less,
    get,
    lanes_not_less,
    put,
    real,
    set_whole,
    skip,
    splat,
    whole,
)
from brightgrey.simulation.kernel.tolerances import TOLERANCES

__all__ = ["input_knot_weights"]


_THIRDS = 3  # spans from a knot to the end of a step, to its stage or to an inner point end at thirds of a tick


@inner
def _ramp_starts(shape: Any, plant: Any, mode: Any, tick: Any, work: Any, starts: Any) -> None:
    """Effects of the ramp (jump) on the state after all spans below one tick that can occur.

    Each has n rows and one for the length of the span. They are computed by propagators, because a gap's damper may
    relax within nanoseconds (d/c).
    """
    n = shape.n
    rows = n * n + 3 * n  # without forces
    A, propagator, spare = work.build, skip(work.build, rows), skip(work.build, 2 * rows)
    column = n * n + (n if shape.hold == 1 else 0)
    mode_matrix(shape, plant, mode, A)
    for number in range(_THIRDS):
        start = skip(starts, number * (n + 1))
        for lane in range(LANES):
            knot = get(plant.delay, 1, lane) * (1 << shape.ticks) * shape.base_steps
            part = number / _THIRDS - knot
            part -= math.floor(part + TOLERANCES.same_span)
            put(start, n, lane, max(part, 0.0) * tick if knot > 0.0 else 0.0)
        propagator_over(n, 0, plant, A, get(start, n, None), propagator, spare, work.scratch)
        for i in range(n):
            put(start, i, None, get(propagator, column + i, None))


@inner
def _ramp_start(n: Any, rest: Any, lane: Any, starts: Any, p: Any) -> None:
    """Effect p of the ramp (jump) on the state of one lane, `rest` seconds after its start: less than a tick."""
    nearest, off = 0, rest
    for number in range(_THIRDS):
        apart = abs(get(skip(starts, number * (n + 1)), n, lane) - rest)
        if apart < off:
            nearest, off = number + 1, apart
    for i in range(n):
        put(p, i, lane, get(skip(starts, (nearest - 1) * (n + 1)), i, lane) if nearest > 0 else 0.0)


@inner
def _ramp_response(shape: Any, mode: Any, tick: Any, work: Any, p: Any, starts: Any, spans: Any) -> None:
    """Effects p of a ramp of unit slope (held input: a unit jump) on the state, a span of every lane after its start.

    The spans, row 0 of `spans`, are whole ticks and a rest. After the rest come the powers of two of which the ticks
    are the sum. The next rows hold times, numbers of ticks, and for each power of two the lanes that have it.
    """
    n = shape.n
    width = n + 4 + 2 * shape.channels
    times, counts, steps = skip(spans, 1), skip(spans, 2), skip(spans, 3)
    for lane in range(LANES):
        span = get(spans, 0, lane)
        # twice, so that a whole tick in `_ramp_starts` is one here, too
        count = int(span / tick + 2.0 * TOLERANCES.same_span)
        rest = max(span - count * tick, 0.0)
        _ramp_start(n, rest, lane, starts, p)
        put(times, 0, lane, rest)
        put(counts, 0, lane, float(count))
    count = get(counts, 0, None)
    for level in range(shape.ticks, -1, -1):
        size = splat(float(1 << level), None)
        bits = lanes_not_less(count, size)
        set_whole(steps, level, bits)
        count = choose_lanes(bits, count - size, count)
    q = work.scratch
    time = get(times, 0, None)
    for level in range(shape.ticks + 1):
        bits = whole(steps, level)
        if bits == 0:
            continue
        table = skip(work.tables, (mode * (shape.ticks + 1) + level) * table_rows(shape))
        for i in range(n):
            total = get(table, i * width + n, None)
            if shape.hold == 1:
                total = total * time + get(table, i * width + n + 1, None)
            for j in range(n):
                total = total + get(table, i * width + j, None) * get(p, j, None)
            put(q, i, None, total)
        for i in range(n):
            put(p, i, None, choose_lanes(bits, get(q, i, None), get(p, i, None)))
        time = choose_lanes(bits, time + splat(tick * (1 << level), None), time)


@inner
def _row_product(n: Any, table: Any, at: Any, p: Any) -> Any:
    total = splat(0.0, None)
    for i in range(n):
        total = total + get(table, at + i, None) * get(p, i, None)
    return total


@inner
def _set_spans(shape: Any, plant: Any, level: Any, before: Any, tick: Any, spans: Any) -> None:
    """Write the spans in s from the knot within a step of 2^level ticks to the part `before` of it before its end."""
    size = 1 << level
    per_step = (1 << shape.ticks) * shape.base_steps
    for lane in range(LANES):
        knot = get(plant.delay, 1, lane) * per_step
        after = size - (knot - int(knot / size) * size) if knot > 0.0 else 0.0  # ticks to the end of the step
        put(spans, 0, lane, max(after - size * before, 0.0) * tick)


@Entry
def input_knot_weights(block: Any) -> None:
    """Write the kink's weights to all step tables; at each level one step per sample has a knot inside."""
    shape, plant, work = shape_of(block), plant_of(block), work_of(block)
    tick = real(call_of(block).numbers, 0) / (shape.base_steps * (1 << shape.ticks))
    n, m = shape.n, shape.channels
    width = n + 4 + 2 * m
    p = skip(work.scratch, n)
    starts = skip(work.scratch, 2 * n)
    spans = skip(work.scratch, 2 * n + _THIRDS * (n + 1))
    rows = table_rows(shape)
    for mode in range(1 << shape.limits):
        _ramp_starts(shape, plant, mode, tick, work, starts)
        for level in range(shape.ticks + 1):
            table = skip(work.tables, (mode * (shape.ticks + 1) + level) * rows)
            _set_spans(shape, plant, level, 0.0, tick, spans)
            _ramp_response(shape, mode, tick, work, p, starts, spans)
            for i in range(n):
                put(table, i * width + n + 3 + 2 * m, None, get(p, i, None))
            _set_spans(shape, plant, level, 2.0 / 3.0, tick, spans)
            _ramp_response(shape, mode, tick, work, p, starts, spans)
            at = end_rows(n, m) + n + 3 + 2 * m
            span = get(spans, 0, None)
            seen = span if shape.hold == 1 else choose_less(0.0, span, splat(1.0, None), splat(0.0, None))
            for k in range(m):
                weight = _row_product(n, plant.H, k * n, p) + get(plant.K, k, None) * seen
                put(table, at + k * width, None, weight)
            points = points_of(shape, level)
            for i in range(points if shape.limits > 0 else 0):
                if points > 1:
                    _set_spans(shape, plant, level, 1.0 - (i + 1.0) / (points + 1.0), tick, spans)
                    _ramp_response(shape, mode, tick, work, p, starts, spans)
                for b in range(shape.limits):
                    if (mode >> b) & 1:
                        value = get(p, whole(plant.limited, b), None)
                    else:
                        value = _row_product(n, plant.rate, b * n, p)
                    put(table, at + (m + b * shape.points + i) * width, None, value)
