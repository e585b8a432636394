"""Closed loop of a planned motion: P control of position around PI control of speed, as drives have it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple, Self, cast

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import POSITION, State
from brightgrey.effects.quantities import Dimension
from brightgrey.errors import SettingsError, one_of
from brightgrey.kit import StateSpace
from brightgrey.recordings.units.signals import Units

__all__ = ["PositionLoop", "Setpoint", "setpoint_along"]

_GAINS = {
    "position_gain": Dimension(0, 0, -1),
    "speed_gain": Dimension(1, -1, 1),
    "reset_time": Dimension(0, 0, 1),
}
_SHORTEST = 1e-6  # s: a shorter dead time is as none, and would make the loop stiff


class Setpoint(NamedTuple):
    """Setpoint of the first mass, which begins and ends at rest, and the feed-forward; each of shape (samples,)."""

    position: Array  #: rad (m).
    velocity: Array  #: rad/s (m/s).
    torque: Array  #: N m (N).


@dataclass(frozen=True)
class PositionLoop:
    """Gains of the drive's own controller, SI.

    It commands the feed-forward and ``speed_gain (e + integral of e / reset_time)``, with the control error
    ``e = position_gain (q_ref - q) + v_ref - v`` of the first mass. It counts as continuous: drives sample their loops
    faster than recordings are sampled.
    """

    position_gain: float  #: 1/s.
    speed_gain: float  #: N m s/rad (N s/m).
    reset_time: float  #: s.

    @classmethod
    def of(cls, given: Mapping[str, object], units: Units) -> Self:
        """Gains from those in the units of the recording.

        Raises
        ------
        SettingsError
            If one is unknown, missing, or not a positive number.
        """
        for name in given:
            one_of("gain of the controller", name, _GAINS)
        for name, dimension in _GAINS.items():
            value = given.get(name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
                came = f"is {value!r}" if name in given else "is missing"
                raise SettingsError(
                    f"{name} of the controller {came}; a positive number in {units.of(dimension)[0]} is wanted"
                )
        return cls(**{name: cast(float, given[name]) / units.of(d)[1] for name, d in _GAINS.items()})

    def shown(self, units: Units) -> dict[str, tuple[float, str]]:
        """Gains with their units, as the recording has them."""
        gains = asdict(self)
        return {name: (gains[name] * units.of(d)[1], units.of(d)[0]) for name, d in _GAINS.items()}

    def around(self, system: StateSpace) -> StateSpace:
        """Closed loop around systems whose inputs have no own port; its input is :meth:`reference_input`.

        Its last output is the integral of ``position_gain q + v``. A dead time of the drive stands in the loop as its
        Padé approximant of first order.
        """
        late = bool(np.any(system.dead_time))
        wide = _with_states(system, ("integral", "delayed")[: 1 + late])
        names = wide.state_names
        q, v, z = (names.index(name) for name in ("q1", "v1", "integral"))
        row = np.zeros(len(names))  # of the torque that is fed back
        row[[q, v, z]] = self.speed_gain * np.array([self.position_gain, 1.0, 1.0 / self.reset_time])
        A, B, C = wide.A, wide.B, wide.C
        A[z, q], A[z, v], C[-1, z] = self.position_gain, 1.0, 1.0
        if late:  # the drive gets 2 p - u, with p' = 2 (u - p) / dead time
            p, rate = names.index("delayed"), 2.0 / np.maximum(system.dead_time, _SHORTEST)
            A[:, p] += 2.0 * B[:, 0]
            A[p, p] -= rate
            B *= -1.0
            B[p, 0] = rate
        A -= np.einsum("i...,j->ij...", B[:, 0], row)
        return wide

    def reference_input(self, setpoint: Setpoint, dt: float) -> Array:
        """Input of the closed loop for a setpoint, shape (samples,)."""
        speed = self.position_gain * setpoint.position + setpoint.velocity
        return np.asarray(setpoint.torque + self.speed_gain * (speed + _trapezoidal(speed, dt) / self.reset_time))

    def simulated_input(self, setpoint: Setpoint, dt: float) -> Array:
        """Input whose linear interpolation has the mean between samples that the smooth setpoint has, (samples,)."""
        reference = self.reference_input(setpoint, dt)
        curved = np.diff(reference - setpoint.torque, 2)
        reference[1:-1] -= curved / 12.0
        return reference

    def torque(self, reference: Array, position: Array, velocity: Array, integral: Array) -> Array:
        """Torque that the controller commands, shape (samples, K), from the outputs of the loop of K systems."""
        fed_back = self.position_gain * position + velocity + integral / self.reset_time
        return np.asarray(reference[:, None] - self.speed_gain * fed_back)


def setpoint_along(position: Array, velocity: Array, torque: Array, dt: float) -> Setpoint:
    """Setpoint along a motion that is coming to rest: in the last tenth the speed fades to zero."""
    share = np.clip((np.arange(velocity.size) / velocity.size - 0.9) / 0.09, 0.0, 1.0)
    speed = (velocity - velocity[0]) * (1.0 - share**2 * (3.0 - 2.0 * share))
    still = position - _trapezoidal(velocity, dt)  # rounding of the integral, which the fading does not change
    return Setpoint(_trapezoidal(speed, dt) + still - still[0], speed, torque)


def _trapezoidal(x: Array, dt: float) -> Array:
    """Integral by the trapezoidal rule, 0 at the first sample."""
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (x[1:] + x[:-1]))])


def _with_states(system: StateSpace, names: Sequence[str]) -> StateSpace:
    """Systems without dead time and with more states, which are connected to nothing, and one more output."""
    n, outputs, more = len(system.states), len(system.outputs), len(names)
    A, B = np.zeros((n + more, n + more, *system.batch)), np.zeros((n + more, 1, *system.batch))
    C = np.zeros((outputs + 1, n + more, *system.batch))
    A[:n, :n], B[:n], C[:outputs, :n] = system.A, system.B, system.C
    elements = system.elements
    for _ in names:
        elements = tuple(e.with_state() for e in elements)
    return replace(
        system,
        A=A,
        B=B,
        C=C,
        D=np.zeros((outputs + 1, 1, *system.batch)),
        elements=elements,
        dead_time=0.0,
        states=(*system.states, *(State(name, POSITION, "zero") for name in names)),
        outputs=(*system.outputs, names[0]),
        derivative_rows=(*system.derivative_rows, -1),
    )
