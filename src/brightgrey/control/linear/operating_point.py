"""Contact modes and operating points of a system with gaps.

In a contact mode every gap is either closed on one side or open, so that the equations are smooth. In contact the
position in the gap rests at its limit. As a state that no input moves it would leave the Riccati equation without a
stabilising solution, so the linear model does without it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.dry_friction import sliding
from brightgrey.control.linear.twist_coordinates import TwistModel
from brightgrey.control.policy import ANALYSIS
from brightgrey.effects import Element
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.kit import Linear, Placed, StateSpace

__all__ = ["CONTACTS", "Contact", "ContactMode", "OperatingPoint", "contact_mode", "trim_point"]

Contact = Literal["forward", "backward", "gap"]
CONTACTS: tuple[Contact, ...] = get_args(Contact)


@dataclass(frozen=True)
class ContactMode:
    """A system with all its gaps closed on one side, or open."""

    model: TwistModel
    #: Gap closed so that the motor pushes the load forward or backward, or open. Without a gap it has no effect, one
    #: of 'forward', 'backward', 'gap'.
    contact: Contact

    @property
    def system(self) -> StateSpace:
        """The system in twist coordinates."""
        return self.model.system

    @cached_property
    def without_limits(self) -> StateSpace:
        """The system without the elements that have limits, so that gaps keep their position, and in sliding."""
        return replace(self.system, elements=tuple(sliding(e) for e in self.system.elements if e.limits is None))

    @cached_property
    def limited_elements(self) -> tuple[Element, ...]:
        """The elements with limits, which are integrators with saturation."""
        return tuple(e for e in self.system.elements if e.limits is not None)

    @property
    def fixed_states(self) -> tuple[int, ...]:
        """States that rest in this contact mode."""
        return (
            ()
            if self.contact == "gap"
            else tuple(e.limits.state for e in self.limited_elements if e.limits is not None)
        )

    @property
    def coasting_states(self) -> tuple[int, ...]:
        """Speeds of the masses that an open gap parts from the one that the input acts on."""
        if self.contact != "gap":
            return ()
        states, gaps = self.system.states, [Placed.parse(e.name).place for e in self.limited_elements]
        lags = [i for i, state in enumerate(states) if state.at_rest == "input"]
        pushed = self.system.B[:, 0] + self.system.A[:, lags].sum(axis=1)
        group = {
            i: sum(gap < int(state.name[1:]) for gap in gaps)
            for i, state in enumerate(states)
            if state.at_rest == "speed"
        }
        (driven,) = (group[i] for i in group if pushed[i] != 0.0)
        return tuple(i for i in group if group[i] != driven)

    @property
    def free_states(self) -> tuple[int, ...]:
        """States of the linear model."""
        return tuple(i for i in range(len(self.system.states)) if i not in self.fixed_states)

    @property
    def free_state_names(self) -> tuple[str, ...]:
        """Names of the linear model's states."""
        return tuple(self.system.state_names[i] for i in self.free_states)

    def nominal_state(self, speed: float, position: float = 0.0) -> Array:
        """State, shape (m,), in which all masses move at `speed`, mass 1 past `position`, and gaps are in this mode."""
        at = {"speed": speed, "position": position}
        z = np.array([at.get(state.at_rest, 0.0) for state in self.system.states])
        for e in self.limited_elements:
            assert e.limits is not None
            low, high = float(e.limits.lower), float(e.limits.upper)
            z[e.limits.state] = {"forward": high, "backward": low, "gap": 0.5 * (low + high)}[self.contact]
        return z

    def derivative(self, z: Array, u: float) -> Array:
        """Derivative of the state in this contact mode, shape (m,)."""
        rate = self.without_limits.derivative(z, u)
        if self.contact == "gap":
            for e in self.limited_elements:
                rate = rate + e.G * float(e.H[0] @ z + e.K[0] * u)
        return rate

    def jacobian(self, z: Array, u: float) -> Linear:
        """Exact linearisation over all states, resting ones included."""
        A, B, C, D = self.without_limits.linearise(z, u)
        if self.contact == "gap":
            for e in self.limited_elements:
                A = A + np.outer(e.G, e.H[0])
                B = B + np.outer(e.G, e.K[:1])
            for out, row in enumerate(self.system.derivative_rows):
                if row >= 0:
                    C[out], D[out] = A[row], B[row]
        return Linear(A, B, C, D)

    def linearise(self, z: Array, u: float) -> Linear:
        """Exact linearisation over the free states."""
        full, keep = self.jacobian(z, u), list(self.free_states)
        return Linear(full.A[np.ix_(keep, keep)], full.B[keep], full.C[:, keep], full.D)


@dataclass(frozen=True)
class OperatingPoint:
    """Steady motion in one contact mode. A drive with exact dry friction is taken in sliding, at standstill, too."""

    contact_mode: ContactMode
    z: Array  #: State in twist coordinates, shape (m,).
    u: float  #: Input that maintains the motion, N m (N).
    speed: float  #: Of all masses, rad/s (m/s).
    acceleration: float  #: Of all masses that torque reaches, rad/s² (m/s²).
    position: float = 0.0  #: Of mass 1, rad (m); it matters only where a load depends on it.

    @cached_property
    def linear(self) -> Linear:
        """Exact linearisation at this point."""
        return self.contact_mode.linearise(self.z, self.u)


def contact_mode(transformed: TwistModel, contact: str = "forward") -> ContactMode:
    """Contact mode of a system.

    Raises
    ------
    SettingsError
        For an unknown contact.
    """
    for allowed in CONTACTS:
        if contact == allowed:
            return ContactMode(transformed, allowed)
    raise SettingsError(unknown_name("contact", contact, CONTACTS))


def trim_point(
    mode: ContactMode, speed: float = 0.0, acceleration: float = 0.0, position: float = 0.0
) -> OperatingPoint:
    """Find the twists, positions in gaps and the input for which all masses have a given speed and acceleration.

    Where a load depends on the position, that holds at the instant at which mass 1 passes it. No torque reaches the
    masses beyond an open gap: their speed is given, and their acceleration is what friction and loads make of it.

    Parameters
    ----------
    mode : ContactMode
    speed, acceleration, position : float
        rad/s, rad/s² and rad (m/s, m/s², m).

    Returns
    -------
    OperatingPoint

    Raises
    ------
    SettingsError
        If there is no such motion.
    """
    system = mode.system
    speeds = [i for i, state in enumerate(system.states) if state.at_rest == "speed"]
    fixed = {*speeds, *mode.fixed_states, *(i for i, state in enumerate(system.states) if state.at_rest == "position")}
    free = [i for i in range(len(system.states)) if i not in fixed]
    positions = [i for i, state in enumerate(system.states) if state.at_rest == "position"]
    rows = [i for i in range(len(system.states)) if i not in (*positions, *mode.coasting_states)]
    wanted = np.zeros(len(system.states))
    wanted[speeds] = acceleration
    z, u = mode.nominal_state(speed, position), 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
        for _ in range(ANALYSIS.most_newton_steps):
            miss = (wanted - mode.derivative(z, u))[rows]
            slope = mode.jacobian(z, u)
            M = np.column_stack([slope.A[np.ix_(rows, free)], slope.B[rows, 0]])
            size = _column_norms(M)
            step = np.linalg.lstsq(M / size, miss, rcond=1e-12)[0]
            z[free] += step[:-1] / size[:-1]
            u += float(step[-1] / size[-1])
            if np.abs(step).max() <= 1e-12 * np.abs(np.append(z[free], u) * size).max():
                break
        miss = np.abs((wanted - mode.derivative(z, u))[rows])
        slope = mode.jacobian(z, u)
        terms = np.abs(slope.A[rows]) @ np.abs(z) + np.abs(slope.B[rows, 0] * u) + abs(acceleration)
    if not np.all(miss <= ANALYSIS.balance_tolerance * terms.max(initial=1e-300)):
        raise SettingsError(
            f"no steady motion was found at speed {speed:g} and acceleration {acceleration:g} (SI) with contact "
            f"'{mode.contact}'; choose another one of {', '.join(CONTACTS)}"
        )
    return OperatingPoint(mode, z, u, speed, acceleration, position)


def _column_norms(M: Array) -> Array:
    """Norm of each column, 1 for columns of zeros; twists and torques differ by many powers of ten."""
    size = np.linalg.norm(M, axis=0)
    return np.where(size > 0.0, size, 1.0)
