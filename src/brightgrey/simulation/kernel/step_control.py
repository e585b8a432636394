"""Control of the step: shorter steps where friction reverses, and limits that are reached within a step.

A base step is cut into ticks by powers of two. A tick in which a limited state reaches or leaves its limit is solved
by Taylor series.
"""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.contact_modes import drive_all, drive_lane, mode_bits, use_table, use_table_of
from brightgrey.simulation.kernel.dry_friction import (
    follow_input,
    leaves_friction_mode,
    part_in_friction_mode,
    stop_end,
)
from brightgrey.simulation.kernel.machine.compilation import Entry, inlined, merged
from brightgrey.simulation.kernel.machine.memory_layout import (
    call_of,
    plant_of,
    points_of,
    shape_of,
    table_rows,
    work_of,
)
from brightgrey.simulation.kernel.machine.simd import LANES, get, put, real, set_whole, skip, whole
from brightgrey.simulation.kernel.machine.simd import call as invoke
from brightgrey.simulation.kernel.radau_step import (
    accept,
    accept_some,
    lanes_leaving_interval,
    radau_step,
    watched_quantity,
)
from brightgrey.simulation.kernel.radau_step_scalar import step_lane

__all__ = ["accept_or_refine", "refine_group", "refine_lane"]

_MIN_GROUP = LANES // 2  # from so many lanes on, one step of all lanes costs less than a step of each


@inlined
def _attempt_all_lanes(shape: Any, plant: Any, call: Any, bits: Any, level: Any, work: Any) -> Any:
    """Step of 2^level ticks in all lanes: (lanes that failed or passed a limit, lanes with a large error)."""
    tick = real(call.numbers, 0) / float(shape.base_steps << shape.ticks)
    table = skip(work.tables, (bits * (shape.ticks + 1) + level) * table_rows(shape))
    points = points_of(shape, level)
    out, coarse = radau_step(shape, plant, call, table, (1 << level) * tick, points, work)
    for b in range(shape.limits):
        out |= lanes_leaving_interval(
            shape, work, b, points, watched_quantity(shape, plant, work, b, work.end, None), None
        )
    return out, coarse


@merged
def _attempt_lane(shape: Any, plant: Any, call: Any, bits: Any, level: Any, work: Any, lane: Any) -> Any:
    """As `_attempt_all_lanes`, for one lane."""
    tick = real(call.numbers, 0) / float(shape.base_steps << shape.ticks)
    out, coarse = step_lane(shape, plant, call, bits, level, (1 << level) * tick, work, lane)
    for b in range(shape.limits):
        end = watched_quantity(shape, plant, work, b, work.end, lane)
        out |= lanes_leaving_interval(shape, work, b, points_of(shape, level), end, lane)
    if shape.dry == 1:
        out |= leaves_friction_mode(shape, plant, work, lane)
    return out, coarse


@inlined
def _longer_step(shape: Any, call: Any, work: Any, level: Any, position: Any, lane: Any) -> Any:
    """Level of the step from `position` on; the error estimate grows eightfold with twice the step."""
    small = 8.0 * get(work.error, 0, lane) < real(call.numbers, 1)
    return level + 1 if level < shape.ticks and not position & (1 << level) and small else level


@inlined
def _part_before_limit(shape: Any, plant: Any, work: Any, level: Any, lane: Any) -> Any:
    """Approximate part of an attempted step before a watched quantity leaves its interval; 1 if none does."""
    points = points_of(shape, level)
    first = 1.0
    for b in range(shape.limits):
        low, high = get(work.low, b, lane), get(work.high, b, lane)
        t0, s0 = 0.0, get(work.watched, b, lane)
        for i in range(points + 1):
            t1 = 1.0 if i == points else 1.0 / 3.0 if points == 1 else (i + 1.0) / (points + 1.0)
            if i == points:
                s1 = watched_quantity(shape, plant, work, b, work.end, lane)
            else:
                s1 = get(work.inner_watched, b * shape.points + i, lane)
            if s1 > high or s1 < low:
                limit = high if s1 > high else low
                first = min(first, t0 + (t1 - t0) * max((limit - s0) / (s1 - s0), 0.0))
                break
            t0, s0 = t1, s1
    return first


@inlined
def _shorter_step(shape: Any, plant: Any, call: Any, work: Any, level: Any, lane: Any, within: Any) -> Any:
    """Level of the next attempt: it ends before the first limit and `within` a part of the step, with a small error.

    For the error's sake a step is cut to a quarter at most, because the estimate exaggerates where friction reverses
    within the step. Without long steps (level ``accurate``, as in the exported programs), a step is halved.
    """
    if shape.jump == 0:
        return level - 1
    size = float(1 << level) * min(_part_before_limit(shape, plant, work, level, lane), within)
    ratio = get(work.error, 0, lane) / real(call.numbers, 1) * 0.125 if shape.channels > 0 else 0.0
    least = max(level - 2, 0)
    level -= 1
    while level > 0 and float(1 << level) > size:
        level -= 1
    while level > least and ratio >= 1.0:
        level -= 1
        ratio *= 0.125
    return level


@inlined
def _pass_event(block: Any, shape: Any, plant: Any, call: Any, start: Any, work: Any, lane: Any) -> None:
    """Carry one lane over the tick `start` after a sample, in which a limit is reached or left."""
    invoke(call.locate_events, (block, start, lane))
    for i in range(shape.n):
        put(work.x, i, lane, get(work.end, i, lane))
    for b in range(shape.limits):
        put(work.watched, b, lane, watched_quantity(shape, plant, work, b, work.x, lane))


@Entry
def refine_lane(block: Any, k: Any, base: Any, lane: Any, follow: Any, position: Any, until: Any, level: Any) -> None:
    """Carry one lane over the ticks [position, until) of base step `base` after sample k.

    The first step has 2^level ticks. The first lane of a group, or a lane on its own, chooses the steps and writes them
    to ``work.plan``. With `follow` the lane takes that plan, and cuts it finer only for its own events.
    """
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    per_sample = float(shape.base_steps << shape.ticks)
    dt = real(call.numbers, 0)
    bits = mode_bits(shape, work, lane)
    while position < until:
        if follow:
            level = min(level, whole(work.plan, position))
            while position & ((1 << level) - 1):
                level -= 1
        size = 1 << level
        start = (base << shape.ticks) + position
        drive_lane(shape, plant, call.u, k, float(start), float(size), per_sample, dt, work, lane)
        if shape.dry == 1:
            follow_input(shape, plant, work, lane)
        out, coarse = _attempt_lane(shape, plant, call, mode_bits(shape, work, lane), level, work, lane)
        if level > 0 and (out or (coarse and not follow)):
            within = part_in_friction_mode(shape, plant, work, lane) if shape.dry == 1 else 1.0
            level = _shorter_step(shape, plant, call, work, level, lane, within)
            continue
        if out:
            _pass_event(block, shape, plant, call, start, work, lane)
        else:
            if shape.dry == 1:
                stop_end(shape, plant, work, lane)
            accept(shape, plant, work, size * (dt / per_sample), lane)
        if not follow:
            for i in range(position, position + size):
                set_whole(work.plan, i, level)
        position += size
        level = shape.ticks if follow else _longer_step(shape, call, work, level, position, lane)
    if bits != mode_bits(shape, work, lane):
        use_table(shape, work, lane)


@Entry
def accept_or_refine(block: Any, k: Any, base: Any, failed: Any, coarse: Any, dead: Any) -> None:
    """Accept the full step of base step `base` after sample k in some lanes, and refine it in the others.

    It must not be accepted in the lanes `failed`. Lanes in `coarse` need shorter steps if they lead a group.
    """
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    h = real(call.numbers, 0) / shape.base_steps
    group, ticks = shape.group, 1 << shape.ticks
    exceptional = 0
    for leader in range(0, LANES, group):
        everyone = -1 if ((failed | coarse) >> leader) & 1 else 0
        exceptional |= (failed | everyone) & (((1 << group) - 1) << leader)
    exceptional &= ~dead
    for lane in range(LANES):  # before any attempt of one group writes over what the full step says of the others
        if (exceptional >> lane) & 1:
            within = part_in_friction_mode(shape, plant, work, lane) if shape.dry == 1 else 1.0
            set_whole(work.first_level, lane, _shorter_step(shape, plant, call, work, shape.ticks, lane, within))
        elif shape.dry == 1:
            stop_end(shape, plant, work, lane)
    accept_some(shape, plant, work, h, ~exceptional)
    for leader in range(0, LANES, group):
        led = (exceptional >> leader) & ((1 << group) - 1)
        if led & 1 and group >= _MIN_GROUP and shape.dry == 0:  # modes of friction differ from lane to lane
            invoke(call.refine_group, (block, k, base, leader, whole(work.first_level, leader), dead))
        elif led:
            if not led & 1:  # the leader took the full step
                for tick in range(ticks):
                    set_whole(work.plan, tick, shape.ticks)
            for lane in range(leader, leader + group):
                if (exceptional >> lane) & 1:
                    # Followers of a leader that took the full step have failed it, too.
                    follow = 1 if lane > leader else 0
                    level = whole(work.first_level, lane) if not follow or not led & 1 else shape.ticks
                    invoke(call.refine_lane, (block, k, base, lane, follow, 0, ticks, level))


@Entry
def refine_group(block: Any, k: Any, base: Any, leader: Any, level: Any, dead: Any) -> None:
    """Carry a group over base step `base` after sample k in steps that its leader chooses, of 2^level ticks at first.

    Lanes with events of their own, or in another mode, take a step on their own. Lanes in `dead` are left out.
    """
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    tick = real(call.numbers, 0) / float(shape.base_steps << shape.ticks)
    position = 0
    while position < 1 << shape.ticks:
        size = 1 << level
        drive_all(shape, plant, call, k, (base << shape.ticks) + position, size, work)
        bits = mode_bits(shape, work, leader)
        out, coarse = _attempt_all_lanes(shape, plant, call, bits, level, work)
        if level > 0 and ((out | coarse) >> leader) & 1:
            level = _shorter_step(shape, plant, call, work, level, leader, 1.0)
            continue
        after = _longer_step(shape, call, work, level, position + size, leader)
        for i in range(position, position + size):
            set_whole(work.plan, i, level)
        alone = 0
        for lane in range(leader, leader + shape.group):
            if (out >> lane) & 1 or mode_bits(shape, work, lane) != bits:
                alone |= 1 << lane
        alone &= ~dead
        accept_some(shape, plant, work, size * tick, ~alone & (((1 << shape.group) - 1) << leader))
        changed = 0
        for lane in range(leader, leader + shape.group):
            if not (alone >> lane) & 1:
                continue
            if mode_bits(shape, work, lane) != bits:
                invoke(call.refine_lane, (block, k, base, lane, 1, position, position + size, level))
            elif level > 0:
                own = _shorter_step(shape, plant, call, work, level, lane, 1.0)
                invoke(call.refine_lane, (block, k, base, lane, 1, position, position + size, own))
            else:
                _pass_event(block, shape, plant, call, (base << shape.ticks) + position, work, lane)
                changed |= (1 if mode_bits(shape, work, lane) != bits else 0) << lane
        if changed:  # usually all of them change to the leader's mode
            now, same = mode_bits(shape, work, leader), 0
            for lane in range(leader, leader + shape.group):
                if not (changed >> lane) & 1:
                    continue
                if mode_bits(shape, work, lane) == now:
                    same |= 1 << lane
                else:
                    use_table(shape, work, lane)
            if same:
                use_table_of(shape, work, same, leader)
        position += size
        level = after
