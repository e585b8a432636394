"""Dry friction with an exact sign: which masses of a lane slide, and which ones stick.

Friction of one mass acts on no other, so each has a mode of its own, ``work.side``. A mass that slides to side s = 1
or -1 feels -s A(|v|). A mass that sticks has v = 0 at both stages of a step, and feels the force that this needs, up to
the breakaway torque A(0). A step that leaves its modes is shortened, and at last the change is located as contacts are.
All lanes take a full step at once. Those that leave a mode in it repeat it on their own. No table depends on modes.
"""

from __future__ import annotations

from typing import Any

from brightgrey.effects.arithmetic import magnitude
from brightgrey.simulation.kernel.law_dispatch import channel_force, dry_forces
from brightgrey.simulation.kernel.machine.compilation import inner
from brightgrey.simulation.kernel.machine.simd import LANES, get, put, whole

__all__ = [
    "correct_rates_at_rest",
    "follow_input",
    "force_at_point",
    "friction_interval",
    "leaves_friction_mode",
    "part_in_friction_mode",
    "set_dry_forces",
    "set_initial_sides",
    "sticks",
    "stop_end",
    "switch_friction",
]


@inner
def sticks(plant: Any, work: Any, k: Any, lane: Any) -> Any:
    """True if the mass of channel k sticks."""
    return whole(plant.stopped, k) >= 0 and get(work.side, k, lane) == 0.0


@inner
def force_at_point(shape: Any, plant: Any, k: Any, value: Any, work: Any, lane: Any) -> Any:
    """Port of channel k at the state in ``work.point``, and force and slope there, without friction of rest."""
    port = get(plant.K, k, lane) * value
    for i in range(shape.n):
        port += get(plant.H, k * shape.n + i, lane) * get(work.point, 0, i)
    if whole(plant.stopped, k) >= 0:
        force, slope, _, _ = dry_forces(shape, plant, k, port, port, get(work.side, k, lane), lane)
    else:
        force, slope = channel_force(shape, plant, k, port, lane)
    return port, force, slope


@inner
def _needed(shape: Any, plant: Any, k: Any, value: Any, work: Any, lane: Any) -> Any:
    """Friction that keeps the mass of channel k at rest in the state ``work.point`` at input `value`."""
    n, row = shape.n, whole(plant.stopped, k)
    rate = get(plant.c, row, lane) + get(plant.B, row, lane) * value
    for j in range(n):
        rate += get(plant.A, row * n + j, lane) * get(work.point, 0, j)
    for b in range(shape.limits):
        column = get(plant.column, b * n + row, lane)
        if column != 0.0 and whole(work.mode, b * LANES + lane) == 0:
            for j in range(n):
                rate += column * get(plant.rate, b * n + j, lane) * get(work.point, 0, j)
    for other in range(shape.channels):
        by_force = get(plant.G, other * n + row, lane)
        if other != k and by_force != 0.0:
            rate += by_force * force_at_point(shape, plant, other, value, work, lane)[1]
    return -rate / get(plant.G, k * n + row, lane)


@inner
def _settle(shape: Any, plant: Any, k: Any, value: Any, work: Any, lane: Any) -> None:
    """Mode of a mass at rest: it sticks if friction can hold it, else it follows what drives it."""
    needed = _needed(shape, plant, k, value, work, lane)
    most = get(work.breakaway, k, lane)
    put(work.side, k, lane, -1.0 if needed > most else 1.0 if needed < -most else 0.0)


@inner
def _point_at_state(shape: Any, work: Any, lane: Any) -> None:
    for i in range(shape.n):
        put(work.point, 0, i, get(work.x, i, lane))


@inner
def set_initial_sides(shape: Any, plant: Any, value: Any, work: Any, lane: Any) -> None:
    """Set the modes of one lane at its initial state ``work.x``."""
    _point_at_state(shape, work, lane)
    for k in range(shape.channels):
        if whole(plant.stopped, k) >= 0:
            put(work.breakaway, k, lane, -dry_forces(shape, plant, k, 0.0, 0.0, 1.0, lane)[0])
            speed = get(work.x, whole(plant.stopped, k), lane)
            put(work.side, k, lane, 1.0 if speed > 0.0 else -1.0 if speed < 0.0 else 0.0)
    for k in range(shape.channels):
        if sticks(plant, work, k, lane):
            _settle(shape, plant, k, value, work, lane)
    set_dry_forces(shape, plant, value, work, lane)


@inner
def set_dry_forces(shape: Any, plant: Any, value: Any, work: Any, lane: Any) -> None:
    """Set F of all channels at ``work.point``; its rate of change is unknown and set to zero."""
    for k in range(shape.channels):
        force = force_at_point(shape, plant, k, value, work, lane)[1]
        if sticks(plant, work, k, lane):
            force = _needed(shape, plant, k, value, work, lane)
        put(work.force, k, lane, force)
        put(work.slope, k, lane, 0.0)


@inner
def follow_input(shape: Any, plant: Any, work: Any, lane: Any) -> None:
    """Set the friction of masses that stick at the begin of a step: it jumps with the input in ``work.drive``."""
    for k in range(shape.channels):
        if sticks(plant, work, k, lane):
            _point_at_state(shape, work, lane)
            put(work.force, k, lane, _needed(shape, plant, k, get(work.drive, 0, lane), work, lane))


@inner
def correct_rates_at_rest(shape: Any, plant: Any, row: Any, work: Any) -> None:
    """Correct the rates of state `row` in the first row of ``work.rhs`` where they belong to masses that stick.

    The input may have jumped since the friction was found. It takes what it can, so that only an excess accelerates.
    """
    for k in range(shape.channels):
        if whole(plant.stopped, k) != row:
            continue
        for lane in range(LANES):
            if sticks(plant, work, k, lane):
                by_force = get(plant.G, k * shape.n + row, lane)
                needed = get(work.force, k, lane) - get(work.rhs, 0, lane) / by_force
                most = get(work.breakaway, k, lane)
                excess = min(max(needed, -most), most) - needed
                put(work.rhs, 0, lane, excess * by_force)


@inner
def friction_interval(work: Any, k: Any, lane: Any) -> Any:
    """Interval of what ends the mode: side times speed of a mass that slides, friction of one that sticks."""
    if get(work.side, k, lane) != 0.0:
        return 0.0, float("inf")
    most = get(work.breakaway, k, lane)
    return -most, most


@inner
def _course(plant: Any, work: Any, k: Any, lane: Any) -> Any:
    """Quantity that ends the mode of channel k, at the begin of a step, a third and the end of it."""
    side = get(work.side, k, lane)
    if side == 0.0:
        return get(work.force, k, lane), get(work.F1, k, lane), get(work.F2, k, lane)
    speed = get(work.x, whole(plant.stopped, k), lane)
    middle, end = side * get(work.z1, k, lane), side * get(work.z2, k, lane)
    if speed == 0.0:  # it breaks away, and bends more than a parabola
        middle = min(middle, end)
        end = middle
    return side * speed, middle, end


@inner
def leaves_friction_mode(shape: Any, plant: Any, work: Any, lane: Any) -> Any:
    """1 if a mass changes between sliding and sticking in the attempted step, else 0; parabolas stand for courses."""
    for k in range(shape.channels):
        if whole(plant.stopped, k) >= 0:
            s0, s1, s2 = _course(plant, work, k, lane)
            low, high = friction_interval(work, k, lane)
            slack = (magnitude(s0) + magnitude(s2)) * 1e-12 + 1e-300
            slope = (s1 - s0) * 4.5 - (s2 - s0) * 0.5
            bend = (s2 - s0) - slope
            peak = slope * -0.5 / bend if bend != 0.0 else -1.0
            extreme = s0 + peak * (slope + peak * bend) if 0.0 < peak < 1.0 else s2
            if not (low - slack < min(s2, extreme) and max(s2, extreme) < high + slack):
                return 1
    return 0


@inner
def part_in_friction_mode(shape: Any, plant: Any, work: Any, lane: Any) -> Any:
    """Approximate part of an attempted step before a mass changes between sliding and sticking; 1 if none does."""
    first = 1.0
    for k in range(shape.channels):
        if whole(plant.stopped, k) >= 0:
            s0, s1, s2 = _course(plant, work, k, lane)
            low, high = friction_interval(work, k, lane)
            t0, t1 = 0.0, 1.0 / 3.0
            if low <= s1 <= high:
                t0, t1, s0, s1 = t1, 1.0, s1, s2
            if s1 > high or s1 < low:
                limit = high if s1 > high else low
                first = min(first, t0 + (t1 - t0) * max((limit - s0) / (s1 - s0), 0.0))
    return first


@inner
def stop_end(shape: Any, plant: Any, work: Any, lane: Any) -> None:
    """Hold masses that stick exactly, at the end of a step."""
    for k in range(shape.channels):
        if sticks(plant, work, k, lane):
            put(work.end, whole(plant.stopped, k), lane, 0.0)
            held = whole(plant.held, k)
            if held >= 0:
                put(work.end, held, lane, get(work.x, held, lane))


@inner
def switch_friction(shape: Any, plant: Any, k: Any, side: Any, value: Any, work: Any, lane: Any) -> None:
    """Change the mode of channel k at ``work.point``, where what ends it reached the end `side` of its interval."""
    if get(work.side, k, lane) == 0.0:
        put(work.side, k, lane, -1.0 * side)  # friction pushes to `side`, and the mass yields to the other
    else:
        put(work.point, 0, whole(plant.stopped, k), 0.0)
        _settle(shape, plant, k, value, work, lane)
