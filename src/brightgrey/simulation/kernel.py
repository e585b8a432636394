"""The simulation loop: full steps for all lanes at once, the exceptional ones lane by lane."""

from __future__ import annotations

from typing import Any

import numpy as np

from brightgrey.simulation.compiled import cached, inner
from brightgrey.simulation.euler import euler_step
from brightgrey.simulation.events import drive_lane, mode_bits, refine, set_force, set_mode
from brightgrey.simulation.kinks import fill_kinks
from brightgrey.simulation.lanes import (
    LANES,
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
from brightgrey.simulation.layout import Plant, table_rows
from brightgrey.simulation.propagators import build_tables
from brightgrey.simulation.step import leaves, step, watch

__all__ = ["run"]

_ALL = (1 << LANES) - 1


@inner
def _batch(plant: Any, size: Any, b: Any) -> Any:
    """Addresses of one batch's tables; `size` holds how many bytes of each belong to a batch."""
    return Plant(
        plant.A + b * size.A, plant.B + b * size.B, plant.c + b * size.c, plant.G + b * size.G,
        plant.H + b * size.H, plant.K + b * size.K, plant.gain + b * size.gain, plant.law, plant.channel,
        plant.first, plant.p + b * size.p, plant.rate + b * size.rate, plant.column + b * size.column,
        plant.low + b * size.low, plant.high + b * size.high, plant.limited, plant.outputs,
        plant.delay + b * size.delay, plant.x0 + b * size.x0,
    )  # fmt: skip


@inner
def _use_table(shape: Any, work: Any, lane: Any) -> None:
    """Make the base step's table of the lane's mode the current one."""
    rows = table_rows(shape.n, shape.channels, shape.limits)
    table = skip(work.tables, (mode_bits(shape, work, lane) * (shape.ticks + 1) + shape.ticks) * rows)
    for r in range(rows):
        put(work.current, r, lane, get(table, r, lane))


@inner
def _start(shape: Any, plant: Any, u: Any, dt: Any, work: Any) -> None:
    """State, modes and forces at the first sample."""
    for i in range(shape.n):
        put(work.x, i, None, get(plant.x0, i, None))
        put(work.end, i, None, get(plant.x0, i, None))
    for lane in range(LANES):
        for b in range(shape.limits):
            low, high = get(plant.low, b, lane), get(plant.high, b, lane)
            state = get(work.x, whole(plant.limited, b), lane)
            put(work.free, b, lane, 0.0)
            rate = watch(shape, plant, work, b, work.x, lane)
            mode = 0
            if high <= low:
                mode = 2
            elif state >= high and rate >= 0.0:
                mode = 1
            elif state <= low and rate <= 0.0:
                mode = -1
            set_mode(plant, work, b, lane, mode)
            put(work.event, b, lane, watch(shape, plant, work, b, work.x, lane))
        _use_table(shape, work, lane)
        drive_lane(shape, plant, u, 0, 0.0, 0.0, 1.0, dt, work, lane)
        set_force(shape, plant, get(work.drive, 0, lane), work, lane)


@inner
def _record(shape: Any, plant: Any, limit: Any, u: Any, k: Any, dt: Any, delayed: Any, work: Any, y: Any) -> Any:
    """Write the outputs at sample k; returns the mask of lanes whose state is not finite or beyond `limit`."""
    n, samples = shape.n, shape.samples
    total = splat(0.0, None)
    for i in range(n):
        x = get(work.x, i, None)
        total = total + choose_less(x, 0.0, -x, x)
    for out in range(shape.outputs):
        row = whole(plant.outputs, out)
        if row < n:
            put(y, out * samples + k, None, get(work.x, row, None))
            continue
        row -= n
        if delayed:
            for lane in range(LANES):
                drive_lane(shape, plant, u, k, 0.0, 0.0, 1.0, dt, work, lane)
        else:
            put(work.drive, 0, None, splat(real(u, k), None))
        value = get(plant.c, row, None) + get(plant.B, row, None) * get(work.drive, 0, None)
        for i in range(n):
            value = value + get(plant.A, row * n + i, None) * get(work.x, i, None)
        for c in range(shape.channels):
            value = value + get(plant.G, c * n + row, None) * get(work.force, c, None)
        for b in range(shape.limits):
            rate = splat(0.0, None)
            for i in range(n):
                rate = rate + get(plant.rate, b * n + i, None) * get(work.x, i, None)
            value = value + get(plant.column, b * n + row, None) * rate * get(work.free, b, None)
        put(y, out * samples + k, None, value)
    return lanes_not_less(total, splat(limit, None))


@inner
def _drive(shape: Any, plant: Any, u: Any, k: Any, base: Any, dt: Any, delayed: Any, work: Any) -> None:
    """Input of all lanes during base step `base` after sample k."""
    h = dt / shape.base_steps
    if delayed:
        ticks = float(1 << shape.ticks)
        for lane in range(LANES):
            per_sample = ticks * shape.base_steps
            drive_lane(shape, plant, u, k, base * ticks, ticks, per_sample, dt, work, lane)
    else:
        slope = (real(u, k + 1) - real(u, k)) / dt if shape.hold == 1 else 0.0
        put(work.drive, 0, None, splat(real(u, k) + slope * (base * h), None))
        put(work.drive, 1, None, splat(slope, None))
        put(work.drive, 2, None, splat(0.0, None))


@inner
def _base_step(
    shape: Any,
    plant: Any,
    control: Any,
    u: Any,
    k: Any,
    base: Any,
    dt: Any,
    delayed: Any,
    work: Any,
    dead: Any,
) -> None:
    """Carry all lanes over one base step."""
    h = dt / shape.base_steps
    _drive(shape, plant, u, k, base, dt, delayed, work)
    failed, coarse = step(shape, plant, control, work.current, h, work, None)
    left = 0
    for b in range(shape.limits):
        ahead = watch(shape, plant, work, b, work.end, None)
        left |= leaves(work, b, None, get(work.ahead, b, None), ahead)
    exceptional = failed | left
    if shape.frozen == 0:
        exceptional |= coarse
    elif (failed | coarse | left) & 1:
        exceptional = _ALL
    elif exceptional:
        for tick in range(1 << shape.ticks):
            set_whole(work.plan, tick, shape.ticks)
    exceptional &= ~dead
    if exceptional:
        for lane in range(LANES):
            if (exceptional >> lane) & 1:
                bits = mode_bits(shape, work, lane)
                follow = shape.frozen == 1 and lane > 0
                refine(shape, plant, control, u, k, base, dt, work, lane, follow)
                for c in range(shape.channels):
                    force = get(work.force, c, lane)
                    put(work.F2, c, lane, force)
                    put(work.F1, c, lane, force - get(work.slope, c, lane) * h / 1.5)
                if bits != mode_bits(shape, work, lane):
                    _use_table(shape, work, lane)
    for c in range(shape.channels):
        f1, f2 = get(work.F1, c, None), get(work.F2, c, None)
        put(work.force, c, None, f2)
        put(work.slope, c, None, (f2 - f1) * (1.5 / h))
    for b in range(shape.limits):
        put(work.event, b, None, watch(shape, plant, work, b, work.end, None))
    for i in range(shape.n):
        put(work.x, i, None, get(work.end, i, None))


@inner
def _is_delayed(plant: Any) -> Any:
    """Whether any lane has dead time."""
    total = 0.0
    for row in range(2):
        for lane in range(LANES):
            total += get(plant.delay, row, lane)
    return total > 0.0


@cached
def run(
    shape: Any, plants: Any, sizes: Any, control: Any, u: Any, dt: Any, first: Any, last: Any, work: Any, y: Any,
    diverged: Any,
) -> None:  # fmt: skip
    """Simulate the batches [first, last).

    Parameters
    ----------
    shape : Shape
    plants, sizes : Plant
        Addresses of tables with a leading axis over batches, and the bytes of one batch.
    control : tuple of three float
        Tolerated error estimate of a step and tolerated last change of Newton, in units of speed; sum of all
        states from which on a simulation counts as diverged.
    u : int
        Address of the input, shape (samples,).
    dt : float
        Sampling interval in s.
    first, last : int
    work : Work
        Addresses of memory that no other thread uses.
    y : int
        Address of the outputs, shape (batches, outputs * samples, LANES), written here.
    diverged : int
        Address of int64, shape (batches, LANES): first sample at which a lane's state is not finite, -1 if there
        is none; written here.
    """
    for number in range(first, last):
        plant = _batch(plants, sizes, number)
        out = skip(y, number * shape.outputs * shape.samples)
        delayed = _is_delayed(plant)
        for lane in range(LANES):
            set_whole(diverged, number * LANES + lane, -1)
        tick = dt / (shape.base_steps * (1 << shape.ticks))
        if shape.euler == 0:
            build_tables(shape, plant, tick, work)
            if delayed:
                fill_kinks(shape, plant, tick, work)
        _start(shape, plant, u, dt, work)
        dead = np.int64(0)  # a literal would compile all below once more
        for k in range(shape.samples):
            if k > 0:
                for base in range(shape.base_steps):
                    if shape.euler == 1:
                        _drive(shape, plant, u, k - 1, base, dt, delayed, work)
                        euler_step(shape, plant, dt / shape.base_steps, work)
                    else:
                        _base_step(shape, plant, control, u, k - 1, base, dt, delayed, work, dead)
            lost = _record(shape, plant, control[2], u, k, dt, delayed, work, out) & ~dead
            if lost:
                dead |= lost
                for lane in range(LANES):
                    if (lost >> lane) & 1:
                        set_whole(diverged, number * LANES + lane, k)
