"""State of single lanes: delayed input, modes of the limited states, forces of the laws."""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.law_dispatch import channel_force
from brightgrey.simulation.kernel.machine.compilation import inner
from brightgrey.simulation.kernel.machine.memory_layout import table_rows
from brightgrey.simulation.kernel.machine.simd import LANES, choose_lanes, get, put, real, set_whole, skip, splat, whole
from brightgrey.simulation.kernel.tolerances import TOLERANCES

__all__ = ["drive_all", "drive_lane", "mode_bits", "set_force", "set_mode", "use_table", "use_table_of"]


@inner
def _drive_now(shape: Any, u: Any, k: Any, start: Any, per_sample: Any, dt: Any, work: Any, who: Any) -> None:
    """Input without dead time from the tick `start` after sample k on; the same bits beside delayed lanes."""
    here, after = real(u, k), real(u, min(k + 1, shape.samples - 1))
    slope = (after - here) / dt if shape.hold == 1 else 0.0
    put(work.drive, 0, who, splat(here + slope * (start * dt / per_sample), who))
    put(work.drive, 1, who, splat(slope, who))
    put(work.drive, 2, who, splat(0.0, who))


@inner
def drive_lane(
    shape: Any,
    plant: Any,
    u: Any,
    k: Any,
    start: Any,
    size: Any,
    per_sample: Any,
    dt: Any,
    work: Any,
    lane: Any,
) -> None:
    """Delayed input of one lane on the ticks [start, start + size) after sample k: value, slope and kink.

    The kink is the change of slope (linear input) or the jump (held input) at a knot inside the step.
    """
    last = shape.samples - 1
    shift = get(plant.delay, 1, lane)
    if get(plant.delay, 0, lane) + shift == 0.0:
        _drive_now(shape, u, k, start, per_sample, dt, work, lane)
        return
    index = k - int(get(plant.delay, 0, lane))
    part = start / per_sample - shift
    inside = False
    if part < -1e-12:
        part += 1.0
        index -= 1
        inside = (start + size) / per_sample - shift > 1e-12
    part = max(part, 0.0)
    here = real(u, min(max(index, 0), last))
    after = real(u, min(max(index + 1, 0), last))
    later = real(u, min(max(index + 2, 0), last))
    if shape.hold == 1:
        put(work.drive, 0, lane, here + (after - here) * part)
        put(work.drive, 1, lane, (after - here) / dt)
        put(work.drive, 2, lane, ((later - after) - (after - here)) / dt if inside else 0.0)
    else:
        put(work.drive, 0, lane, here)
        put(work.drive, 1, lane, 0.0)
        put(work.drive, 2, lane, after - here if inside else 0.0)


@inner
def drive_all(shape: Any, plant: Any, call: Any, k: Any, start: Any, size: Any, work: Any) -> None:
    """Input of all lanes on the ticks [start, start + size) after sample k."""
    dt, u = real(call.numbers, 0), call.u
    per_sample = float(shape.base_steps << shape.ticks)
    if call.delayed == 1:
        for lane in range(LANES):
            drive_lane(shape, plant, u, k, float(start), float(size), per_sample, dt, work, lane)
        return
    _drive_now(shape, u, k, start, per_sample, dt, work, None)


@inner
def set_mode(shape: Any, plant: Any, work: Any, b: Any, lane: Any, mode: Any) -> None:
    """Put limited state b of one lane into a mode: 0 free, 1 and -1 at the upper and lower limit, 2 closed.

    At a limit the state is free again when its rate is inward by more than rounding. Where a drive rests at the end of
    its gap, rounding would open and close the contact for ever.
    """
    infinite = float("inf")
    summands = 0.0
    for j in range(shape.n):
        summands += abs(get(plant.rate, b * shape.n + j, lane) * get(work.x, j, lane))
    rounding = TOLERANCES.contact_rounding * summands
    set_whole(work.mode, b * LANES + lane, mode)
    low, high = -infinite, infinite
    if mode == 0:
        low, high = get(plant.low, b, lane), get(plant.high, b, lane)
    elif mode == 1:
        low = -rounding
    elif mode == -1:
        high = rounding
    put(work.free, b, lane, 1.0 if mode == 0 else 0.0)
    put(work.low, b, lane, low)
    put(work.high, b, lane, high)


@inner
def mode_bits(shape: Any, work: Any, lane: Any) -> Any:
    """Number of the lane's system matrix: bit b set where limited state b is free."""
    bits = 0
    for b in range(shape.limits):
        if whole(work.mode, b * LANES + lane) == 0:
            bits |= 1 << b
    return bits


@inner
def use_table(shape: Any, work: Any, lane: Any) -> None:
    """Make the base step's table of the lane's mode the current one."""
    rows = table_rows(shape)
    table = skip(work.tables, (mode_bits(shape, work, lane) * (shape.ticks + 1) + shape.ticks) * rows)
    for r in range(rows):
        put(work.current, r, lane, get(table, r, lane))


@inner
def use_table_of(shape: Any, work: Any, some: Any, leader: Any) -> None:
    """As `use_table`, in all lanes whose bit is set in `some`: the table of the leader's mode."""
    rows = table_rows(shape)
    table = skip(work.tables, (mode_bits(shape, work, leader) * (shape.ticks + 1) + shape.ticks) * rows)
    for r in range(rows):
        put(work.current, r, None, choose_lanes(some, get(table, r, None), get(work.current, r, None)))


@inner
def set_force(shape: Any, plant: Any, value: Any, work: Any, lane: Any) -> None:
    """Set F of all channels at ``work.end`` for one lane; its rate of change is unknown and set to zero."""
    n = shape.n
    for k in range(shape.channels):
        port = get(plant.K, k, lane) * value
        for i in range(n):
            port += get(plant.H, k * n + i, lane) * get(work.end, i, lane)
        put(work.force, k, lane, channel_force(shape, plant, k, port, lane)[0])
        put(work.slope, k, lane, 0.0)
