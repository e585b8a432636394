"""State, modes and forces at the first sample."""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.contact_modes import drive_lane, set_force, set_mode, use_table
from brightgrey.simulation.kernel.dry_friction import set_initial_sides
from brightgrey.simulation.kernel.machine.compilation import Entry
from brightgrey.simulation.kernel.machine.memory_layout import call_of, plant_of, shape_of, work_of
from brightgrey.simulation.kernel.machine.simd import LANES, get, put, real, whole
from brightgrey.simulation.kernel.radau_step import watched_quantity

__all__ = ["set_initial_state"]


@Entry
def set_initial_state(block: Any) -> None:
    """Set all lanes of the batch at work to their initial state."""
    shape, plant, work, call = shape_of(block), plant_of(block), work_of(block), call_of(block)
    for i in range(shape.n):
        put(work.x, i, None, get(plant.x0, i, None))
        put(work.end, i, None, get(plant.x0, i, None))
    for lane in range(LANES):
        for b in range(shape.limits):
            low, high = get(plant.low, b, lane), get(plant.high, b, lane)
            state = get(work.x, whole(plant.limited, b), lane)
            put(work.free, b, lane, 0.0)
            rate = watched_quantity(shape, plant, work, b, work.x, lane)
            mode = 0
            if high <= low:
                mode = 2
            elif state >= high and rate >= 0.0:
                mode = 1
            elif state <= low and rate <= 0.0:
                mode = -1
            set_mode(shape, plant, work, b, lane, mode)
            put(work.watched, b, lane, watched_quantity(shape, plant, work, b, work.x, lane))
        use_table(shape, work, lane)
        drive_lane(shape, plant, call.u, 0, 0.0, 0.0, 1.0, real(call.numbers, 0), work, lane)
        if shape.dry == 1:
            set_initial_sides(shape, plant, get(work.drive, 0, lane), work, lane)
        else:
            set_force(shape, plant, get(work.drive, 0, lane), work, lane)
