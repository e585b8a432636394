"""State control without measured states (LQG): a Kalman filter finds them from what the drive measures.

For margins the filter is the linear one that the operating point leads to; in the closed loop it is the extended one,
with the drive's friction and gaps, which is told the torque that the limit has left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.design.controllers import StateFeedback
from brightgrey.control.design.state_feedback import StateControl, lqr
from brightgrey.control.filters.discretisation import DelayedInput
from brightgrey.control.filters.extended_kalman import Noise, begin, predicted, updated
from brightgrey.control.filters.setup import first_state
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.twist_coordinates import TwistModel, to_twist_coordinates
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear, StateSpace

__all__ = ["ObservedFeedback", "kalman_gain", "observed"]

_STEP_ERROR = 1e-4  # of the speed scale


def kalman_gain(linear: Linear, noise: Noise, dt: float) -> Array:
    """Stationary gain, shape (n, outputs), of ``z' = A z + B u + L (y - C z)``.

    Parameters
    ----------
    linear : Linear
    noise : Noise
        As of samples `dt` seconds apart.
    dt : float

    Raises
    ------
    SettingsError
        If a state that does not decay by itself cannot be seen.
    """
    R = np.diag(np.square(np.ravel(noise.outputs))) * dt
    Q = float(np.ravel(noise.torque)[0]) ** 2 * dt * linear.B @ linear.B.T
    try:
        return lqr(linear.A.T, linear.C.T, Q, R).K.T
    except SettingsError as error:
        raise SettingsError(f"no Kalman filter finds these states: {error}") from None


def observed(control: StateControl, gain: Array) -> Compensator:
    """State control and filter in one: a linear controller from the error of the controlled output to the torque.

    Parameters
    ----------
    control : StateControl
    gain : ndarray, shape (n, 1)
        Of the filter, :func:`kalman_gain`, with the controlled output as the only measurement.
    """
    A, B, C, _ = control.analysis.linear
    n, K = len(A), control.K[None]
    C = C[control.output : control.output + 1]
    inner = np.zeros((n + 1, n + 1))
    inner[:n, :n], inner[:n, n:] = A - B @ K - gain @ C, -B * control.integral
    return Compensator(
        inner,
        np.vstack([-gain, [[-1.0]]]),
        np.append(-control.K, -control.integral)[None],
        np.zeros((1, 1)),
    )


class _Memory(NamedTuple):
    """Of the state control, the filter's state and covariance, and the latest torques, the last one at the end."""

    inner: float
    x: Array
    P: Array
    given: tuple[float, ...]


@dataclass(frozen=True)
class ObservedFeedback:
    """State control on the states that an extended Kalman filter finds.

    Attributes
    ----------
    feedback : StateFeedback
    system : StateSpace
        The model with what is measured as its outputs; one parameter set, all states.
    noise : Noise
        That the filter expects.
    speed_scale : float
        Largest speed, rad/s (m/s).
    """

    feedback: StateFeedback
    system: StateSpace
    noise: Noise
    speed_scale: float

    @cached_property
    def _twisted(self) -> TwistModel:
        return to_twist_coordinates(self.system)

    @cached_property
    def _whole(self) -> int:
        """Samples that the torque is late, and a part of one."""
        return max(int(np.ceil(float(np.asarray(self.system.dead_time)) / self.feedback.dt - 1e-9)), 0)

    @cached_property
    def _watched(self) -> FilterInput:
        outputs = len(self.system.outputs)
        small = np.full(1, _STEP_ERROR * self.speed_scale)
        z0, P0 = first_state(self._twisted, self.system.rest()[None], small[0], small, np.zeros(1))
        empty = np.zeros((2, 1, outputs))
        return FilterInput(
            self._twisted.system, empty[:, :, 0], empty, self.feedback.dt, "zoh", z0, P0, (False,) * outputs, small
        )

    @cached_property
    def _course(self) -> ProcessModel:
        return ProcessModel.of(self._watched)

    def _at(self, early: float, late: float) -> ProcessModel:
        """The interval in which the torque changes from `early` to `late`."""
        a, b = np.full((1, 1), early), np.full((1, 1), late)
        return replace(self._course, timed=DelayedInput(a, a, b, b, self._course.timed.share))

    def start(self) -> _Memory:
        """At rest, as far as is known."""
        x, P = begin(self._watched, self._course, self.noise.torques(1))
        return _Memory(self.feedback.start(), x, P, (0.0,) * (self._whole + 2))

    def act(self, memory: _Memory, k: int, x: Array, y: Array) -> tuple[float, _Memory]:
        """Wanted torque from the measured outputs; the true states `x` are not looked at."""
        course = self._at(memory.given[-1 - self._whole], memory.given[-1 - self._whole])
        found = updated(course, 0, memory.x, memory.P, y[None], self.noise.sensors(1))
        states = self._twisted.V @ found.x[0, : course.states]
        wanted, inner = self.feedback.act(memory.inner, k, states, y)
        return wanted, _Memory(inner, found.x, found.P, memory.given)

    def settle(self, memory: _Memory, wanted: float, given: float) -> _Memory:
        """Carry the filter on with the torque that the limit has left."""
        history = (*memory.given[1:], given)
        late = history[-1 - max(self._whole - 1, 0)] if self._whole else given
        early = history[-1 - self._whole]
        x, P = predicted(self._at(early, late), 0, memory.x, memory.P, self.noise.torques(1))
        return _Memory(self.feedback.settle(memory.inner, wanted, given), x, P, history)
