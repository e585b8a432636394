"""Simulation loop: full steps of all lanes at once, exceptional steps lane by lane."""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.contact_modes import drive_all, drive_lane, set_mode, use_table_of
from brightgrey.simulation.kernel.dry_friction import (
    correct_rates_at_rest,
    follow_input,
    leaves_friction_mode,
    stop_end,
)
from brightgrey.simulation.kernel.machine.compilation import cached, inlined, inner
from brightgrey.simulation.kernel.machine.memory_layout import call_of, plant_of, shape_of, use_batch, work_of
from brightgrey.simulation.kernel.machine.simd import (
    LANES,
    choose_less,
    get,
    lanes_not_less,
    put,
    real,
    set_whole,
    splat,
    store,
    whole,
)
from brightgrey.simulation.kernel.machine.simd import call as invoke
from brightgrey.simulation.kernel.radau_step import accept, lanes_leaving_interval, radau_step, watched_quantity
from brightgrey.simulation.kernel.radau_step_scalar import mark_columns_outdated
from brightgrey.simulation.kernel.tolerances import TOLERANCES

__all__ = ["run_batch"]


@inlined
def _write_output(call: Any, samples: Any, out: Any, k: Any, at: Any, value: Any, work: Any) -> None:
    """Write an output at sample k, or add the square of its deviation from the target."""
    if call.target == 0:
        store(call.y, (out * samples + k) * call.stride + at, value)
    else:
        apart = value - splat(real(call.target, out * samples + k), None)
        put(work.squares, 0, None, get(work.squares, 0, None) + apart * apart * splat(real(call.weights, out), None))


@inlined
def _record_sample(shape: Any, plant: Any, call: Any, k: Any, at: Any, work: Any) -> Any:
    """Record the outputs at sample k in the columns from `at` on; return the lanes that are given up."""
    n, samples = shape.n, shape.samples
    total = splat(0.0, None)
    for i in range(n):
        x = get(work.x, i, None)
        total = total + choose_less(x, 0.0, -x, x)
    for out in range(shape.outputs):
        row = whole(plant.outputs, out)
        if row < n:
            _write_output(call, samples, out, k, at, get(work.x, row, None), work)
            continue
        row -= n
        if call.delayed == 1:
            for lane in range(LANES):
                drive_lane(shape, plant, call.u, k, 0.0, 0.0, 1.0, real(call.numbers, 0), work, lane)
        else:
            put(work.drive, 0, None, splat(real(call.u, k), None))
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
        if shape.dry == 1:
            put(work.rhs, 0, None, value)
            correct_rates_at_rest(shape, plant, row, work)
            value = get(work.rhs, 0, None)
        _write_output(call, samples, out, k, at, value, work)
    lost = lanes_not_less(total, splat(real(call.numbers, 3), None))
    if call.target != 0:
        lost |= lanes_not_less(get(work.squares, 0, None), get(call.square_limits, at // LANES, None))
    return lost


@inlined
def _strayed_lanes(shape: Any, plant: Any, work: Any) -> Any:
    """Lanes in which a limited state has moved away from that of the lane that leads their group."""
    out = 0
    for b in range(shape.limits):
        row = whole(plant.limited, b)
        position = get(work.x, row, None)
        near = (get(plant.high, b, None) - get(plant.low, b, None)) * TOLERANCES.leader_distance + 1e-300
        for leader in range(0, LANES, shape.group):
            off = position - splat(get(work.x, row, leader), None)
            members = ((1 << shape.group) - 1) << leader
            out |= lanes_not_less(choose_less(off, 0.0, -off, off), near) & members
    return out


@inner
def _rejoin_leaders(shape: Any, plant: Any, call: Any, number: Any, k: Any, apart: Any, work: Any) -> None:
    """Continue the groups that have lanes in `apart` from the states of their leaders, from sample k - 1 on."""
    for leader in range(0, LANES, shape.group):
        followers = ((1 << shape.group) - 2) << leader
        if apart & followers == 0:
            continue
        place = number * shape.samples + k - 1
        set_whole(call.rejoined, place, whole(call.rejoined, place) | followers)
        for lane in range(leader + 1, leader + shape.group):
            for i in range(shape.n):
                put(work.x, i, lane, get(work.x, i, leader))
            for c in range(shape.channels):
                put(work.force, c, lane, get(work.force, c, leader))
                put(work.slope, c, lane, get(work.slope, c, leader))
                put(work.side, c, lane, get(work.side, c, leader))
            for b in range(shape.limits):
                row, mode = whole(plant.limited, b), whole(work.mode, b * LANES + leader)
                low, high = get(plant.low, b, lane), get(plant.high, b, lane)
                own = get(work.x, row, lane)
                own = high if mode > 0 or own > high else low if mode < 0 or own < low else own
                put(work.x, row, lane, own)
                set_mode(shape, plant, work, b, lane, mode)
            for b in range(shape.limits):
                put(work.watched, b, lane, watched_quantity(shape, plant, work, b, work.x, lane))
            for row in range((k - 1) * call.stride, (k + 1) * call.stride, call.stride):
                for out in range(shape.outputs):
                    at = out * shape.samples * call.stride + row + number * LANES
                    put(call.y, 0, at + lane, get(call.y, 0, at + leader))
        if shape.euler == 0:
            use_table_of(shape, work, followers, leader)


@inlined
def _step_all_lanes(block: Any, shape: Any, plant: Any, call: Any, k: Any, base: Any, work: Any, dead: Any) -> None:
    """Carry all lanes over one base step."""
    h = real(call.numbers, 0) / shape.base_steps
    drive_all(shape, plant, call, k, base << shape.ticks, 1 << shape.ticks, work)
    if shape.dry == 1:
        for lane in range(LANES):
            if not (dead >> lane) & 1:
                follow_input(shape, plant, work, lane)
    failed, coarse = radau_step(shape, plant, call, work.current, h, shape.points, work)
    left = 0
    for b in range(shape.limits):
        end = watched_quantity(shape, plant, work, b, work.end, None)
        left |= lanes_leaving_interval(shape, work, b, shape.points, end, None)
    if shape.dry == 1:
        for lane in range(LANES):
            if not (dead >> lane) & 1:
                left |= leaves_friction_mode(shape, plant, work, lane) << lane
    if (failed | coarse | left) & ~dead == 0:
        if shape.dry == 1:
            for lane in range(LANES):
                if not (dead >> lane) & 1:
                    stop_end(shape, plant, work, lane)
        accept(shape, plant, work, h, None)
        return
    invoke(call.accept_or_refine, (block, k, base, failed | left, coarse, dead))


@cached
def run_batch(block: Any, first: Any, last: Any) -> None:
    """Simulate the batches [first, last) of a call.

    Parameters
    ----------
    block : int
        Address of a block that no other thread uses (``buffers.block_for``).
    first, last : int
    """
    shape, work = shape_of(block), work_of(block)
    for number in range(first, last):
        delayed = use_batch(block, number)
        plant, call = plant_of(block), call_of(block)
        for lane in range(LANES):
            set_whole(call.diverged, number * LANES + lane, -1)
        if shape.euler == 0:
            invoke(call.fill_propagator_tables, (block,))
            mark_columns_outdated(shape, work)
            if delayed:
                invoke(call.input_knot_weights, (block,))
        invoke(call.set_initial_state, (block,))
        dead = whole(call.idle, number)
        if call.target != 0:
            put(work.squares, 0, None, get(call.squares, number, None))
        before = 0
        for k in range(shape.samples):
            if k > 0:
                for base in range(shape.base_steps):
                    if shape.euler == 1:
                        drive_all(shape, plant, call, k - 1, base << shape.ticks, 1 << shape.ticks, work)
                        invoke(call.euler_step, (block,))
                    else:
                        _step_all_lanes(block, shape, plant, call, k - 1, base, work, dead)
            lost = _record_sample(shape, plant, call, k, number * LANES, work) & ~dead
            if lost:
                dead |= lost
                for lane in range(LANES):
                    if (lost >> lane) & 1:
                        set_whole(call.diverged, number * LANES + lane, k)
                if dead == (1 << LANES) - 1 and call.target != 0:
                    break
            if shape.group > 1 and shape.limits > 0:
                # At one sample, a limit may be met a little earlier; at two in succession, motions differ.
                now = _strayed_lanes(shape, plant, work) & ~dead
                if now & before:
                    _rejoin_leaders(shape, plant, call, number, k, now & before, work)
                    now = 0
                before = now
        if call.target != 0:
            put(call.squares, number, None, get(work.squares, 0, None))
