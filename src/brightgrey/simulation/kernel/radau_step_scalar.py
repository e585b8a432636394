"""Step of a single lane: its weights column by column, its states side by side in a register.

The arithmetic is that of :func:`brightgrey.simulation.kernel.radau_step.radau_step`. There the weights of one lane lie
far apart, each in a cache line of its own; here they are copied to columns at their first use.
"""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.machine.compilation import inner, merged
from brightgrey.simulation.kernel.machine.memory_layout import column_rows, end_rows, points_of, table_rows
from brightgrey.simulation.kernel.machine.simd import LANES, get, put, real, set_whole, skip, whole
from brightgrey.simulation.kernel.radau_step import estimate, solve_dry_stages, solve_stages

__all__ = ["mark_columns_outdated", "step_lane"]


@inner
def mark_columns_outdated(shape: Any, work: Any) -> None:
    """Mark the columns of all lanes as out of date."""
    for i in range((1 << shape.limits) * (shape.ticks + 1) * LANES):
        set_whole(work.columns_current, i, 0)


@inner
def _copy_step_table(shape: Any, plant: Any, table: Any, points: Any, h: Any, lane: Any, target: Any) -> None:
    """Copy one lane's step table to columns: end states, ports at h/3, watched quantities, ports at the end."""
    n, m = shape.n, shape.channels
    columns = n + 4 + 2 * m
    last = n + m + shape.limits * points
    tall = column_rows(shape) * LANES
    for column in range(columns):
        at = column * tall
        for i in range(n):
            put(target, 0, at + i, get(table, i * columns + column, lane))
        for i in range(m):
            put(target, 0, at + n + i, get(table, end_rows(n, m) + i * columns + column, lane))
        for b in range(shape.limits):
            for i in range(points):
                row = end_rows(n, m) + (m + b * shape.points + i) * columns + column
                put(target, 0, at + n + m + b * points + i, get(table, row, lane))
        for k in range(m):
            total = 0.0
            for i in range(n):
                total += get(plant.H, k * n + i, lane) * get(table, i * columns + column, lane)
            if column == n:
                total += get(plant.K, k, lane)
            elif column == n + 1:
                total += get(plant.K, k, lane) * h
            put(target, 0, at + last + k, total)


@merged
def step_lane(shape: Any, plant: Any, call: Any, bits: Any, level: Any, h: Any, work: Any, lane: Any) -> Any:
    """Step of 2^level ticks from ``work.x`` to ``work.end``: (Newton's method failed, the error is too large), 0 or 1.

    Watched quantities at the step's points are written to ``work.inner_watched``.
    """
    n, m = shape.n, shape.channels
    columns, high = n + 4 + 2 * m, column_rows(shape)
    number = (bits * (shape.ticks + 1) + level) * LANES + lane
    solo = skip(work.lane_columns, number * columns * high)
    points = points_of(shape, level)
    if whole(work.columns_current, number) == 0:
        table = skip(work.tables, (bits * (shape.ticks + 1) + level) * table_rows(shape))
        _copy_step_table(shape, plant, table, points, h, lane, solo)
        set_whole(work.columns_current, number, 1)
    last = n + m + shape.limits * points
    used = (last + m + LANES - 1) // LANES
    for q in range(used):
        total = get(solo, (n + 2) * high + q, None)
        for j in range(n):
            total = total + get(solo, j * high + q, None) * get(work.x, j, lane)
        total = total + get(solo, n * high + q, None) * get(work.drive, 0, lane)
        total = total + get(solo, (n + 1) * high + q, None) * get(work.drive, 1, lane)
        if call.delayed == 1:
            total = total + get(solo, (n + 3 + 2 * m) * high + q, None) * get(work.drive, 2, lane)
        put(work.column, q, None, total)
    failed, coarse = 0, 0
    if m > 0:
        for k in range(m):
            put(work.a1, k, lane, real(work.column, n + k))
            put(work.a2, k, lane, real(work.column, last + k))
            for j in range(2 * m):
                at = (n + 3 + j) * high * LANES
                put(work.coupled, k * 2 * m + j, lane, real(solo, at + n + k))
                put(work.coupled, (m + k) * 2 * m + j, lane, real(solo, at + last + k))
        if shape.dry == 1:
            failed = solve_dry_stages(shape, plant, call, work.coupled, 0, 2 * m, 2 * m * m, h, work, lane)
        else:
            failed = solve_stages(shape, plant, call, work.coupled, 0, 2 * m, 2 * m * m, h, work, lane)
        coarse = estimate(shape, plant, call, h, work, lane)
        for q in range(used):
            total = get(work.column, q, None)
            for k in range(m):
                total = total + get(solo, (n + 3 + k) * high + q, None) * get(work.F1, k, lane)
                total = total + get(solo, (n + 3 + m + k) * high + q, None) * get(work.F2, k, lane)
            put(work.column, q, None, total)
    for i in range(n):
        put(work.end, i, lane, real(work.column, i))
    for b in range(shape.limits):
        for i in range(points):
            put(work.inner_watched, b * shape.points + i, lane, real(work.column, n + m + b * points + i))
    return failed, coarse
