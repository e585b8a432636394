"""What a full step cannot do: halved steps where friction turns, and limits that are reached within a step.

One lane at a time. A base step is cut into ticks by powers of two; where a limited state reaches or leaves its
limit, the tick is gone through by Taylor series.
"""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.compiled import Entry
from brightgrey.simulation.lanes import call as invoke
from brightgrey.simulation.lanes import get, put, real, set_whole, skip, whole
from brightgrey.simulation.layout import call_of, plant_of, shape_of, table_rows, work_of
from brightgrey.simulation.modes import drive_lane, mode_bits, use_table
from brightgrey.simulation.step import leaves, step, watch

__all__ = ["refine"]


@Entry
def refine(block: Any, k: Any, base: Any, lane: Any, follow: Any) -> None:
    """Base step `base` after sample k for one lane, in halved steps: from ``work.x`` to ``work.end``.

    It leaves F as if of one full step.

    The first lane, or a lane on its own, chooses the steps and writes them to ``work.plan``; with `follow` that
    plan is taken, cut finer only where the lane's own events ask for it.
    """
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    ticks = 1 << shape.ticks
    per_sample = float(ticks * shape.base_steps)
    dt = real(call.numbers, 0)
    tick = dt / per_sample
    position, level = 0, shape.ticks
    bits = mode_bits(shape, work, lane)
    rows = table_rows(shape.n, shape.channels, shape.limits)
    while position < ticks:
        if follow:
            level = min(level, whole(work.plan, position))
            while position & ((1 << level) - 1):
                level -= 1
        size = 1 << level
        start = base * ticks + position
        drive_lane(shape, plant, call.u, k, float(start), float(size), per_sample, dt, work, lane)
        table = skip(work.tables, (mode_bits(shape, work, lane) * (shape.ticks + 1) + level) * rows)
        failed, coarse = step(shape, plant, call, table, size * tick, work, lane)
        out = 0
        for b in range(shape.limits):
            out |= leaves(work, b, lane, get(work.ahead, b, lane), watch(shape, plant, work, b, work.end, lane))
        if level > 0 and (failed or out or (coarse and not follow)):
            level -= 1
            continue
        if out or failed:
            invoke(call.creep, (block, start, lane))
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
        elif level < shape.ticks and not position & size and 8.0 * get(work.error, 0, lane) < real(call.numbers, 1):
            level += 1  # the estimate grows eightfold with twice the step
    h = dt / shape.base_steps
    for c in range(shape.channels):
        force = get(work.force, c, lane)
        put(work.F2, c, lane, force)
        put(work.F1, c, lane, force - get(work.slope, c, lane) * h / 1.5)
    if bits != mode_bits(shape, work, lane):
        use_table(shape, work, lane)
