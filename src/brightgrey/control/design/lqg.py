"""Observer-based state feedback (LQG): a Kalman filter estimates the states from the measured outputs.

For stability margins the filter is the linear one of the operating point. In the closed loop it is the extended one
with the drive's friction and gaps, and its input is the torque after the limit.
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
from brightgrey.control.filters.extended_kalman import Noise, initial_estimate, predict_state, update_state
from brightgrey.control.filters.setup import initial_distribution
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.twist_coordinates import TwistModel, to_twist_coordinates
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear, StateSpace

__all__ = ["ObserverFeedback", "kalman_gain", "lqg_compensator"]


def kalman_gain(linear: Linear, noise: Noise, dt: float) -> Array:
    """Stationary gain, shape (n, outputs), of ``z' = A z + B u + L (y - C z)``.

    Parameters
    ----------
    linear : Linear
    noise : Noise
        Per sample.
    dt : float
        Sampling interval, s.

    Raises
    ------
    SettingsError
        If a state that does not decay is not observable.
    """
    R = np.diag(np.square(np.ravel(noise.outputs))) * dt
    Q = float(np.ravel(noise.torque)[0]) ** 2 * dt * linear.B @ linear.B.T
    try:
        return lqr(linear.A.T, linear.C.T, Q, R).K.T
    except SettingsError as error:
        raise SettingsError(f"no stationary Kalman filter exists, a state is not observable: {error}") from None


def lqg_compensator(design: StateFeedbackDesign, gain: Array) -> Compensator:
    """Combine state feedback and Kalman filter into a linear controller from the control error to the torque.

    Parameters
    ----------
    design : StateFeedbackDesign
    gain : ndarray, shape (n, 1)
        Of the filter, :func:`kalman_gain`, with the controlled output as the only measurement.
    """
    A, B, C, _ = design.analysis.linear
    n, K = len(A), design.K[None]
    C = C[design.output : design.output + 1]
    inner = np.zeros((n + 1, n + 1))
    inner[:n, :n], inner[:n, n:] = A - B @ K - gain @ C, -B * design.integral
    return Compensator(
        inner,
        np.vstack([-gain, [[-1.0]]]),
        np.append(-design.K, -design.integral)[None],
        np.zeros((1, 1)),
    )


class _ControllerMemory(NamedTuple):
    """Integral of the feedback, state and covariance of the filter, and the latest torques, newest last."""

    inner: float
    x: Array
    P: Array
    applied: tuple[float, ...]


@dataclass(frozen=True)
class ObserverFeedback:
    """State feedback on the states that an extended Kalman filter estimates."""

    feedback: StateFeedback
    system: StateSpace  #: The model with the measured outputs; one parameter set, all states.
    noise: Noise  #: Of the filter.
    speed_scale: float  #: Largest speed, rad/s (m/s).
    #: Error of the filter's steps over the largest speed, and standard deviation of the first speed over it.
    step_tolerance: float = 1e-4

    @cached_property
    def _twist_model(self) -> TwistModel:
        return to_twist_coordinates(self.system)

    @cached_property
    def _delay_samples(self) -> int:
        """Dead time in samples, rounded up."""
        return max(int(np.ceil(float(np.asarray(self.system.dead_time)) / self.feedback.dt - 1e-9)), 0)

    @cached_property
    def _filter_input(self) -> FilterInput:
        outputs = len(self.system.outputs)
        small = np.full(1, self.step_tolerance * self.speed_scale)
        z0, P0 = initial_distribution(self._twist_model, self.system.rest()[None], small[0], small, np.zeros(1))
        empty = np.zeros((2, 1, outputs))
        return FilterInput(
            self._twist_model.system, empty[:, :, 0], empty, self.feedback.dt, "zoh", z0, P0, (False,) * outputs, small
        )

    @cached_property
    def _process(self) -> ProcessModel:
        return ProcessModel.of(self._filter_input)

    def _process_with_input(self, early: float, late: float) -> ProcessModel:
        """Process model of an interval in which the torque changes from `early` to `late`."""
        a, b = np.full((1, 1), early), np.full((1, 1), late)
        return replace(
            self._process, delayed_input=DelayedInput(a, a, b, b, self._process.delayed_input.switch_fraction)
        )

    def start(self) -> _ControllerMemory:
        """Memory at rest."""
        x, P = initial_estimate(self._filter_input, self._process, self.noise.disturbance_std(1))
        return _ControllerMemory(self.feedback.start(), x, P, (0.0,) * (self._delay_samples + 2))

    def command(self, memory: _ControllerMemory, k: int, x: Array, y: Array) -> tuple[float, _ControllerMemory]:
        """Torque command from the measured outputs; the true states `x` are not used."""
        process = self._process_with_input(
            memory.applied[-1 - self._delay_samples], memory.applied[-1 - self._delay_samples]
        )
        found = update_state(process, 0, memory.x, memory.P, y[None], self.noise.measurement_covariance(1))
        states = self._twist_model.V @ found.x[0, : process.n_states]
        commanded, inner = self.feedback.command(memory.inner, k, states, y)
        return commanded, _ControllerMemory(inner, found.x, found.P, memory.applied)

    def anti_windup(self, memory: _ControllerMemory, commanded: float, applied: float) -> _ControllerMemory:
        """Predict the filter's state with the applied torque."""
        history = (*memory.applied[1:], applied)
        late = history[-1 - max(self._delay_samples - 1, 0)] if self._delay_samples else applied
        early = history[-1 - self._delay_samples]
        x, P = predict_state(
            self._process_with_input(early, late), 0, memory.x, memory.P, self.noise.disturbance_std(1)
        )
        return _ControllerMemory(self.feedback.anti_windup(memory.inner, commanded, applied), x, P, history)
