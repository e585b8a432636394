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
from brightgrey.simulation.kernel.machine.simd import LANES, get, put, real, skip, whole
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
def _ramp_response(shape: Any, mode: Any, span: Any, tick: Any, work: Any, lane: Any, p: Any, starts: Any) -> None:
    """Effect p of a ramp of unit slope (held input: a unit jump) on the state, `span` seconds after its start."""
    n = shape.n
    width = n + 4 + 2 * shape.channels
    whole = int(
        span / tick + 2.0 * TOLERANCES.same_span
    )  # twice, so that a whole tick in `_ramp_starts` is one here, too
    rest = max(span - whole * tick, 0.0)
    _ramp_start(n, rest, lane, starts, p)
    time = rest
    q = work.scratch
    rows = table_rows(shape)
    for level in range(shape.ticks + 1):
        if (whole >> level) & 1:
            table = skip(work.tables, (mode * (shape.ticks + 1) + level) * rows)
            for i in range(n):
                total = get(table, i * width + n, lane)
                if shape.hold == 1:
                    total = total * time + get(table, i * width + n + 1, lane)
                for j in range(n):
                    total += get(table, i * width + j, lane) * get(p, j, lane)
                put(q, i, lane, total)
            for i in range(n):
                put(p, i, lane, get(q, i, lane))
            time += tick * (1 << level)


@inner
def _row_product(n: Any, table: Any, at: Any, p: Any, lane: Any) -> Any:
    total = 0.0
    for i in range(n):
        total += get(table, at + i, lane) * get(p, i, lane)
    return total


@Entry
def input_knot_weights(block: Any) -> None:
    """Write the kink's weights to all step tables; at each level one step per sample has a knot inside."""
    shape, plant, work = shape_of(block), plant_of(block), work_of(block)
    tick = real(call_of(block).numbers, 0) / (shape.base_steps * (1 << shape.ticks))
    n, m = shape.n, shape.channels
    width = n + 4 + 2 * m
    ticks = 1 << shape.ticks
    p = skip(work.scratch, n)
    starts = skip(work.scratch, 2 * n)
    rows = table_rows(shape)
    for mode in range(1 << shape.limits):
        _ramp_starts(shape, plant, mode, tick, work, starts)
        for lane in range(LANES):
            knot = get(plant.delay, 1, lane) * ticks * shape.base_steps
            if knot <= 0.0:
                continue
            knot -= int(knot / ticks) * ticks
            for level in range(shape.ticks + 1):
                size = 1 << level
                table = skip(work.tables, (mode * (shape.ticks + 1) + level) * rows)
                after = size - (knot - int(knot / size) * size)  # ticks from the knot to the end of the step
                _ramp_response(shape, mode, after * tick, tick, work, lane, p, starts)
                for i in range(n):
                    put(table, i * width + n + 3 + 2 * m, lane, get(p, i, lane))
                span = max(after - size * (2.0 / 3.0), 0.0) * tick
                _ramp_response(shape, mode, span, tick, work, lane, p, starts)
                at = end_rows(n, m) + n + 3 + 2 * m
                for k in range(m):
                    seen = get(plant.K, k, lane) * (span if shape.hold == 1 else 1.0 if span > 0.0 else 0.0)
                    put(table, at + k * width, lane, _row_product(n, plant.H, k * n, p, lane) + seen)
                points = points_of(shape, level)
                for i in range(points if shape.limits > 0 else 0):
                    if points > 1:
                        span = max(after - size * (1.0 - (i + 1.0) / (points + 1.0)), 0.0) * tick
                        _ramp_response(shape, mode, span, tick, work, lane, p, starts)
                    for b in range(shape.limits):
                        if (mode >> b) & 1:
                            value = get(p, whole(plant.limited, b), lane)
                        else:
                            value = _row_product(n, plant.rate, b * n, p, lane)
                        put(table, at + (m + b * shape.points + i) * width, lane, value)
