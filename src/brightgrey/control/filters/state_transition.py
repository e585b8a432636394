"""State transition and measurement of the filters, for many recordings or parameter sets side by side.

A filter may need two states beside the model's. One is the position at the last sample, where a measured velocity was
made by differencing it. The other is the disturbance at the sample, where an acceleration shows it at once or a dead
time carries a part of it into the next interval.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.control.filters.discretisation import DelayedInput, ElementBatch, delay_input, propagate_states
from brightgrey.kit import StateSpace

__all__ = ["FilterInput", "ProcessModel", "Transition"]


@dataclass(frozen=True)
class FilterInput:
    """Recordings of K drives of one structure, or one recording for K parameter sets."""

    system: StateSpace  #: In twist coordinates; one parameter set or K.
    u: Array  #: Shape (samples, K).
    y: Array  #: Shape (samples, K, outputs).
    dt: float  #: Sampling interval, s.
    hold: str  #: one of 'linear', 'zoh'.
    z0: Array  #: Expected state at the first sample, shape (K, n).
    P0: Array  #: Its covariance, shape (K, n, n).
    #: True for an output that is a position's difference over the last interval; the system's output is that position.
    differenced: tuple[bool, ...]
    #: Error of a step in any speed, rad/s (m/s). A tenth of the speed's noise is small enough. Shape (K,).
    tolerance: Array


class Transition(NamedTuple):
    """State after an interval (K, m), its derivative by the state before (K, m, m) and by the disturbance (K, m)."""

    x: Array
    by_state: Array
    by_disturbance: Array


@dataclass(frozen=True)
class ProcessModel:
    """Discrete-time model of a filter. Its states are the model's n, the last position and the disturbance."""

    batch: ElementBatch  #: The model with its K parameter sets.
    delayed_input: DelayedInput
    dt: float  #: Sampling interval, s.
    tolerance: Array  #: Error of a step in any speed, rad/s (m/s), shape (K,).
    differenced: NDArray[np.bool_]  #: Shape (outputs,).
    has_disturbance_state: bool  #: The disturbance is the last state.

    @classmethod
    def of(cls, filter_input: FilterInput, copies: int = 1) -> ProcessModel:
        """Process model with `copies` sets for each recording, one after the other."""
        system, K = filter_input.system, filter_input.u.shape[1]
        delay = np.broadcast_to(np.asarray(system.dead_time, float), (K,))
        delayed = delay_input(filter_input.u, filter_input.dt, delay, filter_input.hold)
        acceleration = any(row >= 0 for row in system.derivative_rows)
        process = cls(
            ElementBatch.of(system, K),
            delayed,
            filter_input.dt,
            filter_input.tolerance,
            np.array(filter_input.differenced),
            bool(np.any(delayed.switch_fraction < 1.0)) or acceleration,
        )
        return process.select(np.repeat(np.arange(K), copies)) if copies > 1 else process

    def select(self, which: NDArray[np.int64]) -> ProcessModel:
        """Process model of some of the sets; a set may be selected several times."""
        return replace(
            self,
            batch=self.batch.select(which),
            delayed_input=self.delayed_input.select(which),
            tolerance=self.tolerance[which],
        )

    @property
    def n_states(self) -> int:
        """Number of the model's states."""
        return int(self.batch.A.shape[1])

    @property
    def has_position_state(self) -> bool:
        """True if the last position is a state."""
        return bool(self.differenced.any())

    def _input_at(self, k: int, x: Array) -> Array:
        """Delayed input with the disturbance at sample k, shape (K,)."""
        return np.asarray(self.delayed_input.start[k] + (x[:, -1] if self.has_disturbance_state else 0.0))

    def derivative(self, k: int, x: Array) -> Array:
        """Derivative (K, n) of the model's states at sample k."""
        return self.batch.linearise(x[:, : self.n_states], self._input_at(k, x))[0]

    def negligible_differences(self) -> Array:
        """Differences of states (K, n) that change no speed by more than the tolerance within a sample."""
        n = self.n_states
        small = np.repeat(self.tolerance[:, None], n, axis=1)
        for e in self.batch.elements:
            if e.has_limits:
                row, pull_rate = e.contact_condition()
                speed_change = np.abs(e.G[:, self.batch.speeds]).max(axis=1) * pull_rate * self.dt
                small[:, e.state] = self.tolerance / speed_change
                for i in np.flatnonzero(row.any(axis=0)):
                    if i not in self.batch.speeds:
                        small[:, i] = small[:, e.state]
        return small

    def augment(self, z0: Array, P0: Array, torque: Array, first_speed: int) -> tuple[Array, Array]:
        """State and covariance at the first sample from the model's (K, n), (K, n, n).

        The last position lies one interval back by mass 1's speed, which is state number `first_speed`.
        """
        n = z0.shape[1]
        extend = np.eye(n + self.has_position_state + self.has_disturbance_state)[:, :n]
        if self.has_position_state:
            extend[n, 0], extend[n, first_speed] = 1.0, -self.dt
        P = np.asarray(extend @ P0 @ extend.T)
        if self.has_disturbance_state:
            P[:, -1, -1] = np.square(torque)
        return z0 @ extend.T, P

    def transition(self, k: int, x: Array, disturbance: Array | None = None) -> Transition:
        """Transition from sample k to the next; `disturbance` (K,) is that of the new interval, 0 if not given."""
        n, K = self.n_states, len(x)
        new = np.zeros(K) if disturbance is None else disturbance
        own = x[:, -1] if self.has_disturbance_state else new
        u, share = self.delayed_input, self.delayed_input.switch_fraction
        step = propagate_states(
            self.batch, x[:, :n], u.start[k] + own, u.before_switch[k] + own, share * self.dt, self.tolerance
        )
        z, F, by_own, by_new = step.z, step.by_state, step.by_input, np.zeros((K, n))
        if np.any(share < 1.0):
            rest = (1.0 - share) * self.dt
            step = propagate_states(self.batch, z, u.after_switch[k] + new, u.end[k] + new, rest, self.tolerance)
            z, F, by_new = step.z, step.by_state @ F, step.by_input
            by_own = np.einsum("kij,kj->ki", step.by_state, by_own)
        if not (self.has_position_state or self.has_disturbance_state):
            return Transition(z, F, by_own)
        m = x.shape[1]
        after, by_state, by_disturbance = np.zeros((K, m)), np.zeros((K, m, m)), np.zeros((K, m))
        after[:, :n], by_state[:, :n, :n] = z, F
        if self.has_position_state:
            after[:, n], by_state[:, n, 0] = x[:, 0], 1.0
        if self.has_disturbance_state:
            after[:, -1], by_state[:, :n, -1] = new, by_own
            by_disturbance[:, :n], by_disturbance[:, -1] = by_new, 1.0
        else:
            by_disturbance[:, :n] = by_own
        return Transition(after, by_state, by_disturbance)

    def predict_outputs(self, k: int, x: Array) -> tuple[Array, Array]:
        """Predicted outputs (K, outputs) at sample k, and their derivative by the state (K, outputs, m)."""
        n = self.n_states
        y, own, by_input = self.batch.outputs(x[:, :n], self._input_at(k, x))
        C = np.zeros((*own.shape[:2], x.shape[1]))
        C[:, :, :n] = own
        if self.has_disturbance_state:
            C[:, :, -1] = by_input
        for out in np.flatnonzero(self.differenced):
            C[:, out, n] = -1.0
            C[:, out] /= self.dt
            y[:, out] = (y[:, out] - x[:, n]) / self.dt
        return y, C

    def clip_to_limits(self, x: Array) -> Array:
        """Clip limited states in place; a measurement gives no impulse, so no other state changes."""
        for e in self.batch.elements:
            if e.has_limits:
                x[:, e.state] = np.clip(x[:, e.state], e.low, e.high)
        return x
