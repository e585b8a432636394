"""What happens to a filter's state from sample to sample, and what the sensors show of it.

Beside the model's states a filter may have to remember two things: the position at the last sample, where a speed was
made by differencing it, and the disturbance that acts at the sample, where an acceleration shows it at once or a dead
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
    """Recordings of K drives of one structure, or of one drive seen by K parameter sets.

    Attributes
    ----------
    system : StateSpace
        In twist coordinates; one set or K.
    u : ndarray, shape (samples, K)
    y : ndarray, shape (samples, K, outputs)
    dt : float
    hold : {'linear', 'zoh'}
    z0 : ndarray, shape (K, n)
        Expected state at the first sample.
    P0 : ndarray, shape (K, n, n)
        Its covariance.
    differenced : tuple of bool
        Outputs that are a position's difference over the last interval; the system's output is that position.
    tolerance : ndarray, shape (K,)
        Error of a step in any speed, rad/s (m/s); a tenth of the speed's noise is plenty.
    """

    system: StateSpace
    u: Array
    y: Array
    dt: float
    hold: str
    z0: Array
    P0: Array
    differenced: tuple[bool, ...]
    tolerance: Array


class Transition(NamedTuple):
    """State after an interval (K, m), its derivative by the state before (K, m, m) and by the disturbance (K, m)."""

    x: Array
    by_state: Array
    by_disturbance: Array


@dataclass(frozen=True)
class ProcessModel:
    """Recordings as a filter goes through them. States: the model's n, the last position, the disturbance.

    Attributes
    ----------
    lanes : Lanes
    timed : DelayedInput
        Delayed input.
    dt : float
    tolerance : ndarray, shape (K,)
    differenced : ndarray of bool, shape (outputs,)
    remembers_push : bool
        Whether the disturbance is a state.
    """

    batch: ElementBatch
    delayed_input: DelayedInput
    dt: float
    tolerance: Array
    differenced: NDArray[np.bool_]
    has_disturbance_state: bool

    @classmethod
    def of(cls, filter_input: FilterInput, copies: int = 1) -> ProcessModel:
        """Each recording `copies` times, one copy after the other."""
        K = filter_input.u.shape[1]
        lanes = ElementBatch.of(filter_input.system, K)
        each = np.repeat(np.arange(K), copies)
        delay = np.broadcast_to(np.asarray(filter_input.system.dead_time, float), (K,))
        timed = delay_input(filter_input.u, filter_input.dt, delay, filter_input.hold)
        pushed = bool(np.any(timed.switch_fraction < 1.0)) or any(
            row >= 0 for row in filter_input.system.derivative_rows
        )
        course = cls(lanes, timed, filter_input.dt, filter_input.tolerance, np.array(filter_input.differenced), pushed)
        return course.select(each) if copies > 1 else course

    def select(self, which: NDArray[np.int64]) -> ProcessModel:
        """Some of the recordings; one may come several times."""
        return replace(
            self,
            batch=self.batch.select(which),
            delayed_input=self.delayed_input.select(which),
            tolerance=self.tolerance[which],
        )

    def derivative(self, k: int, x: Array) -> Array:
        """Derivative (K, n) of the model's states at sample k."""
        push = x[:, -1] if self.has_disturbance_state else 0.0
        return self.batch.linearise(x[:, : self.n_states], self.delayed_input.start[k] + push)[0]

    def negligible_differences(self) -> Array:
        """Differences of states (K, n) that do not matter: what changes speeds by the tolerance within a sample."""
        n = self.n_states
        small = np.repeat(self.tolerance[:, None], n, axis=1)
        for e in self.batch.elements:
            if e.has_limits:
                row, pull = e.contact_condition()
                jump = np.abs(e.G[:, self.batch.speeds]).max(axis=1) * pull * self.dt
                small[:, e.state] = self.tolerance / jump
                for i in np.flatnonzero(row.any(axis=0)):
                    if i not in self.batch.speeds:
                        small[:, i] = small[:, e.state]
        return small

    @property
    def n_states(self) -> int:
        """The model's."""
        return int(self.batch.A.shape[1])

    @property
    def has_position_state(self) -> bool:
        """Whether the last position is a state."""
        return bool(self.differenced.any())

    def augment(self, z0: Array, P0: Array, torque: Array, first_speed: int) -> tuple[Array, Array]:
        """State and covariance at the first sample from the model's (K, n), (K, n, n).

        The last position lies one interval back by mass 1's speed, state number `first_speed`.
        """
        n = z0.shape[1]
        wide = np.eye(n + self.has_position_state + self.has_disturbance_state)[:, :n]
        if self.has_position_state:
            wide[n, 0], wide[n, first_speed] = 1.0, -self.dt
        P = np.asarray(wide @ P0 @ wide.T)
        if self.has_disturbance_state:
            P[:, -1, -1] = np.square(torque)
        return z0 @ wide.T, P

    def transition(self, k: int, x: Array, fresh: Array | None = None) -> Transition:
        """From sample k to the next; `fresh` (K,) is the disturbance of the interval, 0 where not given."""
        n, K = self.n_states, len(x)
        new = np.zeros(K) if fresh is None else fresh
        own = x[:, -1] if self.has_disturbance_state else new
        t = self.delayed_input
        step = propagate_states(
            self.batch,
            x[:, :n],
            t.start[k] + own,
            t.before_switch[k] + own,
            t.switch_fraction * self.dt,
            self.tolerance,
        )
        z, F, by_own, by_new = step.z, step.by_state, step.by_input, np.zeros((K, n))
        if np.any(t.switch_fraction < 1.0):
            rest = (1.0 - t.switch_fraction) * self.dt
            step = propagate_states(self.batch, z, t.after_switch[k] + new, t.end[k] + new, rest, self.tolerance)
            z, F, by_new = step.z, step.by_state @ F, step.by_input
            by_own = np.einsum("kij,kj->ki", step.by_state, by_own)
        if not (self.has_position_state or self.has_disturbance_state):
            return Transition(z, F, by_own)
        m = x.shape[1]
        after, by_state, by_push = np.zeros((K, m)), np.zeros((K, m, m)), np.zeros((K, m))
        after[:, :n], by_state[:, :n, :n] = z, F
        if self.has_position_state:
            after[:, n], by_state[:, n, 0] = x[:, 0], 1.0
        if self.has_disturbance_state:
            after[:, -1], by_state[:, :n, -1] = new, by_own
            by_push[:, :n], by_push[:, -1] = by_new, 1.0
        else:
            by_push[:, :n] = by_own
        return Transition(after, by_state, by_push)

    def predict_outputs(self, k: int, x: Array) -> tuple[Array, Array]:
        """Outputs (K, outputs) that are expected at sample k, and their derivative by the state."""
        n = self.n_states
        push = x[:, -1] if self.has_disturbance_state else 0.0
        y, own, by_input = self.batch.outputs(x[:, :n], self.delayed_input.start[k] + push)
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
        """Limited states within their limits; a measurement gives no impulse, so nothing else moves."""
        for e in self.batch.elements:
            if e.has_limits:
                x[:, e.state] = np.clip(x[:, e.state], e.low, e.high)
        return x
