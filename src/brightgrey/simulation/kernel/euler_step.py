"""The paper's integration (section 3.1, step 3): explicit Euler with sub-steps; limited states are clipped."""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.law_dispatch import channel_force
from brightgrey.simulation.kernel.machine.compilation import Entry, inner
from brightgrey.simulation.kernel.machine.memory_layout import call_of, plant_of, shape_of, work_of
from brightgrey.simulation.kernel.machine.simd import choose_less, get, put, real, splat, whole

__all__ = ["euler_step"]


@inner
def _channel_forces(shape: Any, plant: Any, work: Any) -> None:
    """Set F of every channel at the present state and input."""
    for k in range(shape.channels):
        port = get(plant.K, k, None) * get(work.drive, 0, None)
        for i in range(shape.n):
            port = port + get(plant.H, k * shape.n + i, None) * get(work.x, i, None)
        put(work.force, k, None, channel_force(shape, plant, k, port, None)[0])


@inner
def _limited_rates(shape: Any, plant: Any, work: Any) -> None:
    """Rate of every limited state (eq. 5) in ``work.watched``, and 1 in ``work.free`` where it is not cut."""
    for b in range(shape.limits):
        rate = splat(0.0, None)
        for i in range(shape.n):
            rate = rate + get(plant.rate, b * shape.n + i, None) * get(work.x, i, None)
        state = get(work.x, whole(plant.limited, b), None)
        low, high = get(plant.low, b, None), get(plant.high, b, None)
        inward = choose_less(state, high, rate, choose_less(rate, 0.0, rate, 0.0 * rate))
        inward = choose_less(low, state, inward, choose_less(inward, 0.0, 0.0 * rate, inward))
        inward = choose_less(low, high, inward, 0.0 * rate)
        put(work.watched, b, None, inward)
        difference = inward - rate
        put(work.free, b, None, choose_less(difference * difference, 1e-300, 1.0 + 0.0 * rate, 0.0 * rate))


@Entry
def euler_step(block: Any) -> None:
    """Carry all lanes over one base step from ``work.x``, input in ``work.drive``."""
    shape, plant, work = shape_of(block), plant_of(block), work_of(block)
    h = real(call_of(block).numbers, 0) / shape.base_steps
    n = shape.n
    _channel_forces(shape, plant, work)
    _limited_rates(shape, plant, work)
    for i in range(n):
        change = get(plant.c, i, None) + get(plant.B, i, None) * get(work.drive, 0, None)
        for j in range(n):
            change = change + get(plant.A, i * n + j, None) * get(work.x, j, None)
        for k in range(shape.channels):
            change = change + get(plant.G, k * n + i, None) * get(work.force, k, None)
        for b in range(shape.limits):
            change = change + get(plant.column, b * n + i, None) * get(work.watched, b, None)
        put(work.end, i, None, get(work.x, i, None) + change * h)
    for i in range(n):
        put(work.x, i, None, get(work.end, i, None))
    for b in range(shape.limits):
        row = whole(plant.limited, b)
        low, high = get(plant.low, b, None), get(plant.high, b, None)
        state = get(work.x, row, None)
        state = choose_less(state, low, low, state)
        put(work.x, row, None, choose_less(high, state, high, state))
    _channel_forces(shape, plant, work)
    _limited_rates(shape, plant, work)
