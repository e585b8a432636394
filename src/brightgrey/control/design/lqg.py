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
from brightgrey.control.design.state_feedback import StateFeedbackDesign, lqr
from brightgrey.control.filters.discretisation import DelayedInput
from brightgrey.control.filters.extended_kalman import Noise, initial_estimate, predict, update
from brightgrey.control.filters.setup import initial_distribution
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.twist_coordinates import TwistModel, to_twist_coordinates
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear, StateSpace

__all__ = ["ObserverFeedback", "kalman_gain", "lqg_compensator"]

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


def lqg_compensator(control: StateFeedbackDesign, gain: Array) -> Compensator:
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


class _ControllerMemory(NamedTuple):
    """Of the state control, the filter's state and covariance, and the latest torques, the last one at the end."""

    inner: float
    x: Array
    P: Array
    given: tuple[float, ...]


@dataclass(frozen=True)
class ObserverFeedback:
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
    def _twist_model(self) -> TwistModel:
        return to_twist_coordinates(self.system)

    @cached_property
    def _delay_samples(self) -> int:
        """Samples that the torque is late, and a part of one."""
        return max(int(np.ceil(float(np.asarray(self.system.dead_time)) / self.feedback.dt - 1e-9)), 0)

    @cached_property
    def _filter_input(self) -> FilterInput:
        outputs = len(self.system.outputs)
        small = np.full(1, _STEP_ERROR * self.speed_scale)
        z0, P0 = initial_distribution(self._twist_model, self.system.rest()[None], small[0], small, np.zeros(1))
        empty = np.zeros((2, 1, outputs))
        return FilterInput(
            self._twist_model.system, empty[:, :, 0], empty, self.feedback.dt, "zoh", z0, P0, (False,) * outputs, small
        )

    @cached_property
    def _process(self) -> ProcessModel:
        return ProcessModel.of(self._filter_input)

    def _process_with_input(self, early: float, late: float) -> ProcessModel:
        """The interval in which the torque changes from `early` to `late`."""
        a, b = np.full((1, 1), early), np.full((1, 1), late)
        return replace(
            self._process, delayed_input=DelayedInput(a, a, b, b, self._process.delayed_input.switch_fraction)
        )

    def start(self) -> _ControllerMemory:
        """At rest, as far as is known."""
        x, P = initial_estimate(self._filter_input, self._process, self.noise.disturbance_std(1))
        return _ControllerMemory(self.feedback.start(), x, P, (0.0,) * (self._delay_samples + 2))

    def command(self, memory: _ControllerMemory, k: int, x: Array, y: Array) -> tuple[float, _ControllerMemory]:
        """Wanted torque from the measured outputs; the true states `x` are not looked at."""
        course = self._process_with_input(
            memory.given[-1 - self._delay_samples], memory.given[-1 - self._delay_samples]
        )
        found = update(course, 0, memory.x, memory.P, y[None], self.noise.measurement_covariance(1))
        states = self._twist_model.V @ found.x[0, : course.n_states]
        wanted, inner = self.feedback.command(memory.inner, k, states, y)
        return wanted, _ControllerMemory(inner, found.x, found.P, memory.given)

    def anti_windup(self, memory: _ControllerMemory, wanted: float, given: float) -> _ControllerMemory:
        """Carry the filter on with the torque that the limit has left."""
        history = (*memory.given[1:], given)
        late = history[-1 - max(self._delay_samples - 1, 0)] if self._delay_samples else given
        early = history[-1 - self._delay_samples]
        x, P = predict(self._process_with_input(early, late), 0, memory.x, memory.P, self.noise.disturbance_std(1))
        return _ControllerMemory(self.feedback.anti_windup(memory.inner, wanted, given), x, P, history)
