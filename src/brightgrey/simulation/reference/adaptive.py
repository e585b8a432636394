"""Reference solution, method 'events': adaptive integration by scipy, restarted at every knot of the torque.

Every piece on which the input is a straight line is integrated on its own (DOP853, order 8). No step can therefore
reach across a knot or miss the excitation. Where the shaft leaves or meets a side of the backlash gap, and where exact
dry friction comes to rest or breaks away, the instant is located by integrating again from the beginning of the step,
never by interpolation. The equations are written body by body in twists instead of positions, independently of the
other method's compiled form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.integrate import DOP853, Radau
from scipy.optimize import brentq, minimize_scalar

from brightgrey.arrays import Array
from brightgrey.simulation.reference.plant import Plant, Segments, Trajectory
from brightgrey.simulation.reference.tolerances import REFERENCE_TOLERANCES

__all__ = ["DriveEquations", "Phase", "solve_adaptive"]


Event = Literal["contact", "friction"]
"""What ends a phase."""

Guard = Callable[[Array, float], float]
"""Of the state and the time since the phase began; below zero where the phase has ended."""


@dataclass(frozen=True)
class Phase:
    """Contact of shaft 1 and friction of mass 1, as long as neither changes."""

    #: The shaft presses at lambda = 0 (1) or at lambda = -2 alpha (-1), or is open (0); None without a gap, one of 1,
    #: -1, 0, None.
    side: int | None
    gap: float = 0.0  #: lambda while it presses, or at the moment when it opened.
    twist: float = 0.0  #: Twist at the moment when it opened, so that tau = `twist` - `gap` then.
    #: Direction in which mass 1 slides, 1 or -1; 0 while it sticks; None where its friction is smooth.
    slides: int | None = None


@dataclass(frozen=True)
class DriveEquations:
    """Equations of motion of one plant, and their integration over pieces of the input.

    The state is a row (q1, twists of the shafts, speeds, T).
    """

    plant: Plant
    solver: type[Any]
    rtol: float
    atol: Array
    still: float = 0.0  #: Speed in rad/s below which mass 1 is at rest where it can stick: rounding.

    def friction(self, v: float, slides: int | None) -> float:
        """Eq. (2) with |v| in the exponent; positive for v > 0.

        Exact dry friction continues smoothly beyond v = 0, so that the solver's trial steps find no kink there; the
        bound of the exponent keeps trial steps far beyond finite.
        """
        p = self.plant
        if slides is None:
            sign, faded = math.tanh(p.f_tanh * v), math.exp(-abs(v) / p.fading)
        else:
            sign, faded = float(slides), math.exp(min(-slides * v / p.fading, 1.0))
        return p.f_v * v + sign * (p.M_C + p.M_S * faded)

    def pressing(self, y: list[float], phase: Phase) -> float:
        """Torque of shaft 1 in contact, c tau + d tau'."""
        n = self.plant.masses
        return self.plant.c[0] * (y[1] - phase.gap) + self.plant.d[0] * (y[n] - y[n + 1])

    def drive_torque(self, y: list[float], u: float, phase: Phase) -> float:
        """Torque on mass 1 without its friction, which holds it against this torque while it sticks."""
        motor = u if self.plant.T_1 is None else y[2 * self.plant.masses]
        carried = 0.0 if self.plant.masses == 1 or phase.side == 0 else self.pressing(y, phase)
        return motor + self.plant.M_G - carried

    def rates(self, y: list[float], u: float, phase: Phase) -> list[float]:
        """Time derivative of the state for the delayed input `u`."""
        p, n = self.plant, self.plant.masses
        v = y[n : 2 * n]
        motor = u if p.T_1 is None else y[2 * n]
        load = [0.0] * n
        load[0] = motor + p.M_G - self.friction(v[0], phase.slides)
        turning = [v[0]]
        for k in range(n - 1):
            turning.append(v[k] - v[k + 1])
            if k > 0:
                carried = p.c[k] * y[k + 1] + p.d[k] * turning[-1]
            else:
                carried = 0.0 if phase.side == 0 else self.pressing(y, phase)
            load[k] -= carried
            load[k + 1] += carried
        if phase.slides == 0:
            load[0] = 0.0
        rates = turning + [torque / J for torque, J in zip(load, p.J, strict=True)]
        return rates if p.T_1 is None else [*rates, (u - motor) / p.T_1]

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
        relaxing = (phase.twist - phase.gap) * math.expm1(-self.plant.c[0] / self.plant.d[0] * t)
        return phase.gap + (float(y[1]) - phase.twist) - relaxing

    def contact_guard(self, y: Array, t: float, phase: Phase) -> float:
        """Quantity that falls below zero where a contact or gap that began the time t ago ends."""
        if phase.side:
            return phase.side * self.pressing(y.tolist(), phase)
        gap = self.gap(y, t, phase)
        return min(-gap, gap + 2.0 * (self.plant.alpha or 0.0))

    def friction_guard(self, y: Array, u: float, phase: Phase) -> float:
        """Quantity that falls below zero where mass 1 stops to slide, or breaks away."""
        if phase.slides:
            return phase.slides * float(y[self.plant.masses]) + self.still
        return self.plant.breakaway - abs(self.drive_torque(y.tolist(), u, phase))

    def following(self, y: Array, u: float, t: float, phase: Phase, event: Event) -> tuple[Array, Phase]:
        """State and phase that follow an event."""
        if event == "contact":
            return self.with_friction(y, u, self.next_contact(y, t, phase))
        phase = self.lasting(y, t, phase)
        if phase.slides == 0:  # not asked again: the torque may have been located just before it breaks away
            return y, replace(phase, slides=1 if self.drive_torque(y.tolist(), u, phase) > 0.0 else -1)
        y = y.copy()
        y[self.plant.masses] = 0.0
        return self.with_friction(y, u, phase)

    def next_contact(self, y: Array, t: float, phase: Phase) -> Phase:
        """Contact or gap that follows."""
        if phase.side:
            return Phase(0, phase.gap, float(y[1]))
        alpha = self.plant.alpha or 0.0
        return Phase(1, 0.0) if self.gap(y, t, phase) > -alpha else Phase(-1, -2.0 * alpha)

    def lasting(self, y: Array, t: float, phase: Phase) -> Phase:
        """Return the phase that began the time t ago as one that begins now."""
        return replace(phase, gap=self.gap(y, t, phase), twist=float(y[1])) if phase.side == 0 else phase

    def with_friction(self, y: Array, u: float, phase: Phase) -> tuple[Array, Phase]:
        """State and phase with the direction of sliding that follows from speed and torque.

        At rest, the mass sticks below the breakaway torque; above it, it slides the way that the torque drives it.
        """
        if not self.plant.sticks:
            return y, phase
        v = float(y[self.plant.masses])
        if abs(v) > self.still:
            return y, replace(phase, slides=1 if v > 0.0 else -1)
        y = y.copy()
        y[self.plant.masses] = 0.0
        torque = self.drive_torque(y.tolist(), u, phase)
        return y, replace(phase, slides=(torque > 0.0) - (torque < 0.0) if abs(torque) >= self.plant.breakaway else 0)

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
            guards["contact"] = lambda y, t: self.contact_guard(y, t, phase)
        if phase.slides is not None:
            guards["friction"] = lambda y, t: self.friction_guard(y, u + slope * t, phase)
        return guards

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

    Points between the ends of the step are tested too, as a shaft may leave a side and return within one step.
    """
    if guard(stepper.y, stepper.t) < 0.0:
        return float(stepper.t) - begin
    inside = stepper.dense_output()
    times = np.linspace(begin, stepper.t, REFERENCE_TOLERANCES.inner_points)
    depths = [guard(y, t) for t, y in zip(times, inside(times).T, strict=True)]
    k = int(np.argmin(depths[1:])) + 1
    if k == REFERENCE_TOLERANCES.inner_points - 1:
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
    if not plant.alpha:
        return y, Phase(None)
    gap = float(x[2 * n])
    for contact in (Phase(1, 0.0), Phase(-1, -2.0 * plant.alpha)):
        if gap == contact.gap and drive.contact_guard(y, 0.0, contact) >= 0.0:
            return y, contact
    return y, Phase(0, gap, float(y[1]))


def _scales(plant: Plant, segments: Segments, x: Array) -> Array:
    """Size that each state can be expected to reach; the absolute tolerance is relative to it."""
    n = plant.masses
    torque = float(np.max(np.abs(np.append(segments.start, segments.end)))) + abs(plant.M_G)
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
