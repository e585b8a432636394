"""Reference solution, method 'events': adaptive integration by scipy, restarted at every knot of the torque.

Every piece on which the input is a straight line is integrated on its own (DOP853, order 8). No step can therefore
reach across a knot or miss the excitation. The shaft leaves or meets a side of the backlash gap, and exact dry friction
comes to rest or breaks away. Such an instant is located by integrating again from the beginning of the step, never by
interpolation. The equations are written body by body in twists instead of positions, independently of the other
method's compiled form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import DOP853, Radau
from scipy.optimize import brentq, minimize_scalar

from brightgrey.arrays import Array
from brightgrey.simulation.reference.plant import Load, Plant, Segments, Trajectory
from brightgrey.simulation.reference.tolerances import REFERENCE_TOLERANCES

__all__ = ["DriveEquations", "Phase", "solve_adaptive"]


Event = int
"""What ends a phase: CONTACT, or the number of the mass, from 0, that stops to slide or breaks away."""
CONTACT = -1

Guard = Callable[[Array, float], float]
"""Of the state and the time since the phase began; below zero where the phase has ended."""


@dataclass(frozen=True)
class Phase:
    """Contact of the shaft with a gap and friction of all masses, as long as nothing changes."""

    #: The shaft presses at lambda = 0 (1) or at lambda = -2 alpha (-1), or is open (0); None without a gap, one of 1,
    #: -1, 0, None.
    side: int | None
    gap: float = 0.0  #: lambda while it presses, or at the moment when it opened.
    twist: float = 0.0  #: Twist at the moment when it opened, so that tau = `twist` - `gap` then.
    #: Of each mass the direction in which it slides, 1 or -1; 0 while it sticks; None where its friction is smooth.
    slides: tuple[int | None, ...] = ()


@dataclass(frozen=True)
class DriveEquations:
    """Equations of motion of one plant, and their integration over pieces of the input.

    The state is a row (q1, twists of the shafts, speeds, T).
    """

    plant: Plant
    solver: type[Any]
    rtol: float
    atol: Array
    still: float = 0.0  #: Speed in rad/s below which a mass is at rest where it can stick: rounding.

    def friction(self, v: float, load: Load, slides: int | None) -> float:
        """Eq. (2) with |v| in the exponent, and f_d |v|; against v > 0.

        Exact dry friction continues smoothly beyond v = 0, so that the solver's trial steps find no kink there; the
        bound of the exponent keeps trial steps far beyond finite.
        """
        if slides is None:
            sign, faded = math.tanh(self.plant.f_tanh * v) if load.is_dry else 0.0, math.exp(-abs(v) / load.fading)
        else:
            sign, faded = float(slides), math.exp(min(-slides * v / load.fading, 1.0))
        return load.f_v * v + load.f_d * abs(v) + sign * (load.M_C + load.M_S * faded)

    def pressing(self, y: list[float], phase: Phase) -> float:
        """Torque of the shaft with the gap in contact, c tau + d tau'."""
        n, k = self.plant.masses, self.plant.gap_at
        return self.plant.c[k] * (y[1 + k] - phase.gap) + self.plant.d[k] * (y[n + k] - y[n + k + 1])

    def loads(self, y: list[float], u: float, phase: Phase) -> list[float]:
        """Torque on each mass without its friction, which holds it against this torque while it sticks."""
        p, n = self.plant, self.plant.masses
        on, q = [0.0] * n, y[0]
        on[p.actuator - 1] = u if p.T_1 is None else y[2 * n]
        for k in range(n):
            on[k] += p.loads[k].of_position(q)
            if k + 1 < n:
                q -= y[k + 1]
                if phase.side is None or k != p.gap_at:
                    carried = (p.c[k] + p.hardening[k] * y[k + 1] ** 2) * y[k + 1] + p.d[k] * (y[n + k] - y[n + k + 1])
                else:
                    carried = 0.0 if phase.side == 0 else self.pressing(y, phase)
                on[k] -= carried
                on[k + 1] += carried
        return on

    def rates(self, y: list[float], u: float, phase: Phase) -> list[float]:
        """Time derivative of the state for the delayed input `u`."""
        p, n = self.plant, self.plant.masses
        v, on = y[n : 2 * n], self.loads(y, u, phase)
        accelerations = [
            0.0 if s == 0 else (on[i] - self.friction(v[i], p.loads[i], s)) / p.J[i] for i, s in enumerate(phase.slides)
        ]
        rates = [v[0], *(v[k] - v[k + 1] for k in range(n - 1)), *accelerations]
        return rates if p.T_1 is None else [*rates, (u - y[2 * n]) / p.T_1]

    def stepper(self, y: Array, u: float, slope: float, length: float, phase: Phase) -> Any:
        """Solver of scipy over [0, length] with the input u + slope t."""
        return self.solver(
            lambda t, x: self.rates(x.tolist(), u + slope * t, phase),
            0.0,
            y,
            length,
            rtol=self.rtol,
            atol=self.atol,
            first_step=min(length, 0.1 / self.plant.fastest_rate),
        )

    def flow(self, y: Array, u: float, slope: float, length: float, phase: Phase) -> Array:
        """State after `length`, ignoring events."""
        if length <= 0.0:
            return y
        stepper = self.stepper(y, u, slope, length, phase)
        while stepper.status == "running":
            _step(stepper)
        return np.asarray(stepper.y)

    def gap(self, y: Array, t: float, phase: Phase) -> float:
        """Lambda the time t after the phase began; in the gap tau' = -(c/d) tau.

        It is computed as a change, so that just after a side was left the distance to it has no rounding error.
        """
        if phase.side != 0:
            return phase.gap
        k = self.plant.gap_at
        relaxing = (phase.twist - phase.gap) * math.expm1(-self.plant.c[k] / self.plant.d[k] * t)
        return phase.gap + (float(y[1 + k]) - phase.twist) - relaxing

    def contact_guard(self, y: Array, t: float, phase: Phase) -> float:
        """Quantity that falls below zero where a contact or gap that began the time t ago ends."""
        if phase.side:
            return phase.side * self.pressing(y.tolist(), phase)
        gap = self.gap(y, t, phase)
        return min(-gap, gap + 2.0 * (self.plant.alpha or 0.0))

    def friction_guard(self, y: Array, u: float, phase: Phase, i: int) -> float:
        """Quantity that falls below zero where mass i stops to slide, or breaks away."""
        slides = phase.slides[i]
        if slides:
            return slides * float(y[self.plant.masses + i]) + self.still
        return self.plant.loads[i].breakaway - abs(self.loads(y.tolist(), u, phase)[i])

    def following(self, y: Array, u: float, t: float, phase: Phase, event: Event) -> tuple[Array, Phase]:
        """State and phase that follow an event."""
        if event == CONTACT:
            return self.with_friction(y, u, self.next_contact(y, t, phase))
        phase = self.lasting(y, t, phase)
        if phase.slides[event] == 0:  # not asked again: its torque may have been located just before it breaks away
            side = 1 if self.loads(y.tolist(), u, phase)[event] > 0.0 else -1
            return y, replace(phase, slides=(*phase.slides[:event], side, *phase.slides[event + 1 :]))
        y = y.copy()
        y[self.plant.masses + event] = 0.0
        return self.with_friction(y, u, phase, (event,))

    def next_contact(self, y: Array, t: float, phase: Phase) -> Phase:
        """Contact or gap that follows."""
        if phase.side:
            return replace(phase, side=0, twist=float(y[1 + self.plant.gap_at]))
        alpha = self.plant.alpha or 0.0
        if self.gap(y, t, phase) > -alpha:
            return replace(phase, side=1, gap=0.0)
        return replace(phase, side=-1, gap=-2.0 * alpha)

    def lasting(self, y: Array, t: float, phase: Phase) -> Phase:
        """Return the phase that began the time t ago as one that begins now."""
        twist = float(y[1 + self.plant.gap_at])
        return replace(phase, gap=self.gap(y, t, phase), twist=twist) if phase.side == 0 else phase

    def with_friction(
        self, y: Array, u: float, phase: Phase, masses: Sequence[int] | None = None
    ) -> tuple[Array, Phase]:
        """State and phase with the directions of sliding that follow from speed and torque, for some of the masses.

        At rest, a mass sticks below its breakaway torque; above it, it slides the way that the torque drives it.
        """
        n, chosen = self.plant.masses, range(self.plant.masses) if masses is None else masses
        dry = [i for i in chosen if self.plant.sticks[i]]
        if not dry:
            return y, phase
        y = y.copy()
        slides = list(phase.slides)
        for i in dry:
            v = float(y[n + i])
            if abs(v) <= self.still:
                y[n + i], slides[i] = 0.0, 0
            else:
                slides[i] = 1 if v > 0.0 else -1
        on = self.loads(y.tolist(), u, phase)
        for i in dry:
            if slides[i] == 0 and abs(on[i]) >= self.plant.loads[i].breakaway:
                slides[i] = (on[i] > 0.0) - (on[i] < 0.0)
        return y, replace(phase, slides=tuple(slides))

    def piece(self, y: Array, u: float, slope: float, length: float, phase: Phase) -> tuple[Array, Phase]:
        """Integrate over one straight piece of the input and through all events in it."""
        done = 0.0
        y, phase = self.with_friction(y, u, phase)
        for attempt in range(REFERENCE_TOLERANCES.max_switches):
            t, y, event = self.until(
                y, u + slope * done, slope, length - done, phase, watch=attempt < REFERENCE_TOLERANCES.max_switches - 1
            )
            done += t
            if event is None:
                break
            y, phase = self.following(y, u + slope * done, t, phase, event)
            if done >= length:
                return y, phase
        return y, self.lasting(y, t, phase)

    def guards(self, u: float, slope: float, phase: Phase) -> dict[Event, Guard]:
        """Guards of the events that can end the phase, for the input u + slope t."""
        guards: dict[Event, Guard] = {}
        if phase.side is not None:
            guards[CONTACT] = lambda y, t: self.contact_guard(y, t, phase)
        for i, slides in enumerate(phase.slides):
            if slides is not None:
                guards[i] = partial(self._friction_guard_in_time, u, slope, phase, i)
        return guards

    def _friction_guard_in_time(self, u: float, slope: float, phase: Phase, i: int, y: Array, t: float) -> float:
        return self.friction_guard(y, u + slope * t, phase, i)

    def until(
        self, y: Array, u: float, slope: float, length: float, phase: Phase, *, watch: bool
    ) -> tuple[float, Array, Event | None]:
        """Integrate to the end of phase or piece: (time passed, state, event that has ended the phase)."""
        guards = self.guards(u, slope, phase) if watch else {}
        for event, guard in guards.items():
            if guard(y, 0.0) < 0.0:
                return 0.0, y, event
        stepper = self.stepper(y, u, slope, length, phase)
        while stepper.status == "running":
            begin, before = float(stepper.t), np.array(stepper.y)
            _step(stepper)
            start, events = u + slope * begin, []
            for event, guard in guards.items():
                ahead = _dip(stepper, begin, guard)
                if ahead > 0.0:
                    events.append((self.locate(before, start, slope, begin, ahead, phase, guard), event))
            if events:
                after, event = min(events)
                return begin + after, self.flow(before, start, slope, after, phase), event
        return length, np.asarray(stepper.y), None

    def locate(self, y: Array, u: float, slope: float, begin: float, ahead: float, phase: Phase, guard: Guard) -> float:
        """Time within a step at which the guard passes zero."""

        def after(t: float) -> float:
            return guard(self.flow(y, u, slope, t, phase), begin + t)

        low = 0.0
        if after(low) <= 0.0:  # the phase has only just begun, on the border: find where it is well inside
            inside = (ahead * 0.5**k for k in range(1, 30))
            low = next((t for t in inside if after(t) > 0.0), -1.0)
        if low < 0.0:
            return 0.0
        if after(ahead) >= 0.0:  # integrated at once it just reaches the border
            return ahead
        return float(brentq(after, low, ahead, xtol=1e-18, rtol=1e-13))


def _dip(stepper: Any, begin: float, guard: Guard) -> float:
    """Time into the last step at which the guard is below zero, 0 if it never is.

    Points between the ends of the step are tested too, as a shaft may leave a side and return within one step. Below
    the lowest of them a smooth guard falls by less than it rises from there to its neighbours.
    """
    if guard(stepper.y, stepper.t) < 0.0:
        return float(stepper.t) - begin
    inside = stepper.dense_output()
    times = np.linspace(begin, stepper.t, REFERENCE_TOLERANCES.inner_points)
    depths = [guard(y, t) for t, y in zip(times, inside(times).T, strict=True)]
    k = int(np.argmin(depths[1:])) + 1
    if k == REFERENCE_TOLERANCES.inner_points - 1 or 3.0 * depths[k] > depths[k - 1] + depths[k + 1]:
        return 0.0
    lowest = minimize_scalar(lambda t: guard(inside(t), t), bounds=(times[k - 1], times[k + 1]), method="bounded")
    return float(lowest.x) - begin if lowest.fun < 0.0 else 0.0


def _step(stepper: Any) -> None:
    """One step of a solver of scipy; a failure raises FloatingPointError."""
    stepper.step()
    if stepper.status == "failed" or not np.all(np.isfinite(stepper.y)):
        raise FloatingPointError("the solution left the finite numbers")


def _initial_phase(drive: DriveEquations, x: Array) -> tuple[Array, Phase]:
    """Split an initial state in the order of the plant's names into the state of `DriveEquations` and the phase."""
    plant, n = drive.plant, drive.plant.masses
    q, v, last = x[:n], x[n : 2 * n], x[2 * n + (plant.alpha is not None) :]
    y = np.concatenate([q[:1], q[:-1] - q[1:], v, last])
    slides = tuple(0 if can_stick else None for can_stick in plant.sticks)
    if not plant.alpha:
        return y, Phase(None, slides=slides)
    gap = float(x[2 * n])
    for contact in (Phase(1, 0.0, slides=slides), Phase(-1, -2.0 * plant.alpha, slides=slides)):
        if gap == contact.gap and drive.contact_guard(y, 0.0, contact) >= 0.0:
            return y, contact
    return y, Phase(0, gap, float(y[1 + plant.gap_at]), slides)


def _scales(plant: Plant, segments: Segments, x: Array) -> Array:
    """Size that each state can be expected to reach; the absolute tolerance is relative to it."""
    n = plant.masses
    torque = float(np.max(np.abs(np.append(segments.start, segments.end))))
    torque += sum(abs(load.M_G) + abs(load.G) for load in plant.loads)
    impulse = np.cumsum(0.5 * (segments.start + segments.end) * segments.length) / sum(plant.J)
    twist0 = np.abs(x[: n - 1] - x[1:n])
    swing = max((t * math.sqrt(c / J) for t, c, J in zip(twist0, plant.c, plant.J, strict=False)), default=0.0)
    speed = max(float(np.max(np.abs(impulse))), float(np.max(np.abs(x[n : 2 * n]))), swing)
    speed = speed or torque / sum(plant.J) * float(segments.length.sum()) or 1.0
    twists = [
        torque / c + t + 1e-3 * speed * math.sqrt(J / c) for t, c, J in zip(twist0, plant.c, plant.J, strict=False)
    ]
    current = [] if plant.T_1 is None else [torque or 1.0]
    return np.array([speed * float(segments.length.sum()), *twists, *[speed] * n, *current])


def solve_adaptive(
    plant: Plant, segments: Segments, x0: Array, *, rtol: float = 1e-11, implicit: bool = False
) -> Trajectory:
    """Integrate piece by piece.

    Parameters
    ----------
    plant, segments, x0
        Drive, input and initial state; `x0` in the order of ``plant.state_names``.
    rtol : float
        Relative tolerance; the absolute one is `rtol` times the size that a state can be expected to reach.
    implicit : bool
        Take Radau (order 5) instead of DOP853: far slower at a tight tolerance, to check the other.

    Returns
    -------
    Trajectory

    Raises
    ------
    FloatingPointError
        If the solution leaves the finite numbers.
    """
    n, s, scales = plant.masses, segments, _scales(plant, segments, x0)
    still = REFERENCE_TOLERANCES.still * float(scales[n])
    drive = DriveEquations(plant, Radau if implicit else DOP853, rtol, rtol * scales, still)
    y, phase = _initial_phase(drive, x0)
    rows, gaps = np.zeros((len(s.at_sample), len(y))), np.zeros(len(s.at_sample))
    acceleration = np.zeros(len(s.at_sample))

    def record(k: int) -> None:
        rows[k] = y
        gaps[k] = phase.gap
        u = float(s.at_sample[k])
        _, now = drive.with_friction(y, u, phase)  # a held input may jump at the sample
        acceleration[k] = drive.rates(y.tolist(), u, now)[n]

    record(0)
    for length, start, end, sample in zip(s.length, s.start, s.end, s.sample, strict=True):
        y, phase = drive.piece(y, float(start), float((end - start) / length), float(length), phase)
        if sample >= 0:
            record(int(sample))
    positions = rows[:, :1] - np.cumsum(np.insert(rows[:, 1:n], 0, 0.0, axis=1), axis=1)
    gap = gaps[:, None] if plant.alpha is not None else np.zeros((len(rows), 0))
    states = np.hstack([positions, rows[:, n : 2 * n], gap, rows[:, 2 * n :]])
    return Trajectory(plant.state_names, states.T, acceleration)
