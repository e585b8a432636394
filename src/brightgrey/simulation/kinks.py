"""Dead time: the knots of the delayed input fall between samples, at a place of their own in every lane."""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.compiled import Entry, inner
from brightgrey.simulation.lanes import LANES, get, put, real, skip, splat, whole
from brightgrey.simulation.layout import call_of, end_rows, plant_of, points_of, shape_of, table_rows, work_of
from brightgrey.simulation.taylor import expand, mode_columns, value_at

__all__ = ["kinks"]


_MOST = 10_000  # series in less than a tick: beyond, a rate is no drive's but a wrong unit's
_KEPT = 3  # beginnings of a tick that are kept: spans end at thirds of it


@inner
def _begin(shape: Any, plant: Any, mode: Any, rest: Any, tick: Any, work: Any, lane: Any, p: Any, kept: Any) -> None:
    """Effect p of the ramp (jump) on the state, `rest` seconds after its begin: less than a tick."""
    n = shape.n
    for slot in range(_KEPT):
        known = skip(kept, slot * (n + 1))
        if abs(get(known, n, lane) - rest) <= 1e-9 * tick:
            for i in range(n):
                put(p, i, lane, get(known, i, lane))
            return
    mode_columns(shape, plant, mode, work, lane)
    put(work.point, 0, None, splat(0.0, None))
    time, series = 0.0, 0
    while rest - time > 1e-12 * tick:
        if series == _MOST:  # rather no result than one that keeps all others waiting
            put(work.point, 0, None, splat(float("nan"), None))
            break
        series += 1
        for i in range(n):
            drive = get(plant.B, i, lane)
            put(work.system, n, i, drive * time if shape.hold == 1 else drive)
            put(work.system, n + 1, i, drive if shape.hold == 1 else 0.0)
        s, terms = expand(n, work, rest - time)
        put(work.point, 0, None, value_at(work, terms, 1.0))
        time += s
    for i in range(n):
        put(p, i, lane, get(work.point, 0, i))
    for slot in range(_KEPT):
        known = skip(kept, slot * (n + 1))
        if get(known, n, lane) < 0.0:
            put(known, n, lane, rest)
            for i in range(n):
                put(known, i, lane, get(p, i, lane))
            return


@inner
def _response(shape: Any, plant: Any, mode: Any, span: Any, tick: Any, work: Any, lane: Any, p: Any, kept: Any) -> None:
    """Effect p of a ramp of unit slope (held input: a unit jump) on the state, `span` seconds after its begin."""
    n = shape.n
    width = n + 4 + 2 * shape.channels
    whole = int(span / tick + 1e-9)
    rest = max(span - whole * tick, 0.0)
    _begin(shape, plant, mode, rest, tick, work, lane, p, kept)
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
def _row(n: Any, table: Any, at: Any, p: Any, lane: Any) -> Any:
    total = 0.0
    for i in range(n):
        total += get(table, at + i, lane) * get(p, i, lane)
    return total


@Entry
def kinks(block: Any) -> None:
    """Write the kink's weights to all step tables; in each level one step per sample has a knot inside."""
    shape, plant, work = shape_of(block), plant_of(block), work_of(block)
    tick = real(call_of(block).numbers, 0) / (shape.base_steps * (1 << shape.ticks))
    n, m = shape.n, shape.channels
    width = n + 4 + 2 * m
    ticks = 1 << shape.ticks
    p = skip(work.scratch, n)
    kept = skip(work.scratch, 2 * n)
    rows = table_rows(shape)
    for lane in range(LANES):
        knot = get(plant.delay, 1, lane) * ticks * shape.base_steps
        if knot <= 0.0:
            continue
        knot -= int(knot / ticks) * ticks
        for mode in range(1 << shape.limits):
            for slot in range(_KEPT):
                put(skip(kept, slot * (n + 1)), n, lane, -1.0)
            for level in range(shape.ticks + 1):
                size = 1 << level
                table = skip(work.tables, (mode * (shape.ticks + 1) + level) * rows)
                after = size - (knot - int(knot / size) * size)  # ticks from the knot to the end of the step
                _response(shape, plant, mode, after * tick, tick, work, lane, p, kept)
                for i in range(n):
                    put(table, i * width + n + 3 + 2 * m, lane, get(p, i, lane))
                span = max(after - size * (2.0 / 3.0), 0.0) * tick
                _response(shape, plant, mode, span, tick, work, lane, p, kept)
                at = end_rows(n, m) + n + 3 + 2 * m
                for k in range(m):
                    seen = get(plant.K, k, lane) * (span if shape.hold == 1 else 1.0 if span > 0.0 else 0.0)
                    put(table, at + k * width, lane, _row(n, plant.H, k * n, p, lane) + seen)
                points = points_of(shape, level)
                for i in range(points if shape.limits > 0 else 0):
                    if points > 1:
                        span = max(after - size * (1.0 - (i + 1.0) / (points + 1.0)), 0.0) * tick
                        _response(shape, plant, mode, span, tick, work, lane, p, kept)
                    for b in range(shape.limits):
                        if (mode >> b) & 1:
                            value = get(p, whole(plant.limited, b), lane)
                        else:
                            value = _row(n, plant.rate, b * n, p, lane)
                        put(table, at + (m + b * shape.points + i) * width, lane, value)
