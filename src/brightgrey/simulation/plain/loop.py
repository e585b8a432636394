"""Simulation loop of the plain implementation: base steps, cut where the error or an event requires it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.arrays import Array
from brightgrey.kit import StateSpace
from brightgrey.simulation.kernel.lowering import lower
from brightgrey.simulation.plain.dry_friction import DryFriction
from brightgrey.simulation.plain.events import pass_events
from brightgrey.simulation.plain.state import CLOSED, FREE, LOWER, UPPER, Simulation
from brightgrey.simulation.plain.step import Watched, try_step, watched_quantities
from brightgrey.simulation.response import parts_per_sample
from brightgrey.simulation.settings import Settings, stepping_of, tolerances

__all__ = ["plain_response"]


def plain_response(system: StateSpace, u: ArrayLike, dt: float, x0: ArrayLike, settings: Settings) -> Array:
    """Outputs, shape (outputs, samples), of one system at level ``accurate`` or ``fast``.

    Parameters and units as for :func:`brightgrey.simulation.response`.
    """
    u = np.asarray(u, float)
    low = lower(system, dt)
    tolerance = tolerances(settings.level, bool(low.limited))
    bases, levels, points = stepping_of(tolerance, int(parts_per_sample(system, low, dt, settings)[0]))
    ticks = 2**levels
    run = Simulation(
        low,
        tolerance,
        settings.speed_scale,
        settings.hold,
        dt / (bases * ticks),
        ticks,
        points,
        np.array(x0, float),
        np.zeros(len(low.G)),
        np.zeros(len(low.G)),
        DryFriction(low),
    )
    drive = _input_course(u, dt, float(np.ravel(low.delay)[0]), settings.hold)
    for b, element in enumerate(low.limited):
        assert element.limits is not None
        run.modes.append(FREE)
        lower_end, upper_end = run.interval(b)
        state, rate = run.x[element.limits.state], element.H[0].reshape(-1) @ run.x
        at_upper, at_lower = state >= upper_end and rate >= 0.0, state <= lower_end and rate <= 0.0
        run.modes[b] = CLOSED if upper_end <= lower_end else UPPER if at_upper else LOWER if at_lower else FREE
    begin = drive(0.0, 0.0)[0]
    run.friction.sides = [float(np.sign(run.x[state])) if state >= 0 else 0.0 for state in low.stopped]
    for k in run.friction.sticking:
        run.friction.sides[k] = run.friction.side_of(k, run.needed(k, begin))
    run.force = run.forces(begin)
    y = np.empty((len(low.outputs), len(u)))
    for k in range(len(u)):
        if k:
            for base in range(bases):
                _step_base(run, drive, (k - 1) * dt, base)
        rates = run.rates(drive(k * dt, 0.0)[0], run.force)
        for channel in run.friction.sticking:
            rates[low.stopped[channel]] = run.friction.rate_at_rest(channel, rates, run.force)
        y[:, k] = np.concatenate([run.x, rates])[list(low.outputs)]
    return y


def _input_course(
    u: Array, dt: float, delay: float, hold: str
) -> Callable[[float, float], tuple[float, float, float, float]]:
    """Delayed input on [t, t + h): value, slope, kink (or jump) inside, and the time from t to the kink."""

    def at(i: int) -> float:
        return float(u[min(max(i, 0), len(u) - 1)])

    def drive(t: float, h: float) -> tuple[float, float, float, float]:
        place = t / dt - delay
        i = int(np.floor(place + 1e-9))
        part = max(place - i, 0.0)
        until = (1.0 - part) * dt
        here, after, later = at(i), at(i + 1), at(i + 2)
        inside = h - until > 1e-9 * dt
        if hold == "linear":
            kink = (later - 2.0 * after + here) / dt if inside else 0.0
            return here + (after - here) * part, (after - here) / dt, kink, until
        return here, 0.0, after - here if inside else 0.0, until

    return drive


def _step_base(
    run: Simulation, drive: Callable[[float, float], tuple[float, float, float, float]], t: float, base: int
) -> None:
    """Take one base step, in shorter steps where the error or a limit requires it."""
    position, size = 0, run.ticks
    while position < run.ticks:
        begin, h = t + (base * run.ticks + position) * run.tick, size * run.tick
        value, slope, kink, until = drive(begin, h)
        for k in run.friction.sticking:  # it follows the input at once
            run.force[k] = run.needed(k, value)
        step = try_step(run, h, value, slope, kink, until)
        failed = not step.change < run.tolerance.change * run.scale
        coarse = not step.error < run.tolerance.error * run.scale
        watched = watched_quantities(run, step)
        out = any(w.leaves() for w in watched)
        if size > 1 and (failed or out or coarse):
            size = _next_size(run, size, step.error, watched)
            continue
        if out or failed:
            pieces = [(h, value, slope)]
            if kink:
                after = value + slope * until + (kink if run.hold == "zoh" else 0.0)
                pieces = [
                    (until, value, slope),
                    (h - until, after, slope + (kink if run.hold == "linear" else 0.0)),
                ]
            for span, at, rate in pieces:
                pass_events(run, span, at, rate)
            last = pieces[-1][1] + pieces[-1][2] * pieces[-1][0]
            run.force = run.forces(last)
            run.slope = np.zeros_like(run.force)
        else:
            F1, F2 = step.force
            run.friction.stop(step.end, run.x)
            run.x, run.force, run.slope = step.end, F2, 1.5 * (F2 - F1) / h
        position += size
        if size < run.ticks and position % (2 * size) == 0 and 8.0 * step.error < run.tolerance.error * run.scale:
            size *= 2


def _next_size(run: Simulation, size: int, error: float, watched: list[Watched]) -> int:
    """Ticks of the next attempt: it ends before the first limit, and its expected error is small enough."""
    if not run.tolerance.long_steps:
        return size // 2
    reached = min((w.part_inside() for w in watched), default=1.0)
    after = size // 2
    while after > 1 and after > reached * size:
        after //= 2
    least = max(size // 4, 1)
    ratio = error / (run.tolerance.error * run.scale) / 8.0
    while after > least and ratio >= 1.0:
        after //= 2
        ratio /= 8.0
    return after
