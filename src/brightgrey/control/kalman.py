"""Extended Kalman filter: the state of a drive from its recording, the Jacobian from the element table.

The form of the model gives the linearisation for free, so no effect is named here. The disturbance is a torque beside
the input, held over each sampling interval; what the sensors add is white.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brightgrey.control.flow import Lanes, ahead, delayed_input
from brightgrey.kit import StateSpace

__all__ = ["Filtered", "Noise", "Record", "Watched", "clipped", "extended"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """What the model does not know.

    Attributes
    ----------
    torque : float or ndarray, shape (K,)
        Standard deviation of a torque beside the input, held over each sampling interval, N m (N).
    outputs : ndarray, shape (outputs,) or (K, outputs)
        Standard deviation of each measured output.
    """

    torque: float | Array
    outputs: Array

    def sensors(self, lanes: int) -> Array:
        """Covariance of the measurement, shape (K, outputs, outputs)."""
        std = np.broadcast_to(self.outputs, (lanes, np.shape(self.outputs)[-1]))
        return np.asarray(np.square(std)[:, :, None] * np.eye(std.shape[1]))


@dataclass(frozen=True)
class Watched:
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
    spread : ndarray, shape (K, n)
        Standard deviation of each state around it.
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
    spread: Array
    differenced: tuple[bool, ...]
    tolerance: Array


@dataclass(frozen=True)
class Filtered:
    """What a filter found.

    Attributes
    ----------
    z : ndarray, shape (samples, K, n)
        Estimated states, each from the samples up to its own.
    std : ndarray, shape (samples, K, n)
        Their standard deviations.
    innovations : ndarray, shape (samples, K, outputs)
        Measured less predicted.
    covariances : ndarray, shape (samples, K, outputs, outputs)
        Expected of the innovations.
    """

    z: Array
    std: Array
    innovations: Array
    covariances: Array

    @cached_property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (samples, K); chi-squared with as many degrees as outputs."""
        solved = np.linalg.solve(self.covariances, self.innovations[..., None])[..., 0]
        return np.asarray(np.sum(self.innovations * solved, axis=-1))

    @cached_property
    def white(self) -> Array:
        """Innovations made white and of unit size, shape (samples, K, outputs)."""
        roots = np.linalg.cholesky(self.covariances)
        return np.asarray(np.linalg.solve(roots, self.innovations[..., None])[..., 0])

    @cached_property
    def log_likelihood(self) -> Array:
        """Logarithm of the likelihood of each lane, shape (K,)."""
        _, size = np.linalg.slogdet(2.0 * np.pi * self.covariances)
        return np.asarray(-0.5 * np.sum(self.nis + size, axis=0))


@dataclass(frozen=True)
class _Measuring:
    """Outputs of the state that also remembers the last position (a position is differenced with it)."""

    lanes: Lanes
    differenced: Array
    dt: float

    @property
    def memory(self) -> int:
        return int(self.differenced.any())

    def __call__(self, x: Array, u: Array) -> tuple[Array, Array]:
        n = self.lanes.A.shape[1]
        y, C = self.lanes.measured(x[:, :n], u)
        if not self.memory:
            return y, C
        C = np.concatenate([C, np.zeros((*C.shape[:2], 1))], axis=2)
        for out in np.flatnonzero(self.differenced):
            C[:, out, n] = -1.0
            C[:, out] /= self.dt
            y[:, out] = (y[:, out] - x[:, n]) / self.dt
        return y, C


def extended(watched: Watched, noise: Noise) -> Filtered:
    """Run the extended Kalman filter over the recordings.

    Parameters
    ----------
    watched : Watched
    noise : Noise

    Returns
    -------
    Filtered

    Notes
    -----
    The update is Joseph's. A contact is decided at the expected state; where friction or contacts are uncertain
    within the state's spread, compare with :func:`brightgrey.control.unscented.unscented`.
    """
    samples, K = watched.u.shape
    lanes = Lanes.of(watched.system, K)
    n = lanes.A.shape[1]
    measuring = _Measuring(lanes, np.array(watched.differenced), watched.dt)
    delay = np.broadcast_to(np.asarray(watched.system.dead_time, float), (K,))
    begin, end = delayed_input(watched.u, watched.dt, delay, watched.hold)
    x, P = _begin(watched, measuring.memory)
    R = noise.sensors(K)
    torque = np.broadcast_to(np.asarray(noise.torque, float), (K,))
    out = Record.empty(samples, K, n, len(watched.differenced))
    for k in range(samples):
        if k:
            step = ahead(lanes, x[:, :n], begin[k - 1], end[k - 1], watched.dt, watched.tolerance)
            F, push = _remembering(step.by_state, step.by_input, measuring.memory)
            P = F @ P @ F.transpose(0, 2, 1) + np.square(torque)[:, None, None] * push[:, :, None] * push[:, None, :]
            x = np.concatenate([step.z, x[:, :1]], axis=1) if measuring.memory else step.z
        y, H = measuring(x, begin[min(k, samples - 2)] if k == 0 else end[k - 1])
        S = H @ P @ H.transpose(0, 2, 1) + R
        gain = np.linalg.solve(S, H @ P).transpose(0, 2, 1)
        innovation = watched.y[k] - y
        x = x + np.einsum("kij,kj->ki", gain, innovation)
        rest = np.eye(x.shape[1]) - gain @ H
        P = rest @ P @ rest.transpose(0, 2, 1) + gain @ R @ gain.transpose(0, 2, 1)
        x[:, :n] = clipped(lanes, x[:, :n])
        out.keep(k, x[:, :n], P[:, :n, :n], innovation, S)
    return Filtered(out.z, out.std, out.innovations, out.covariances)


def _begin(watched: Watched, memory: int) -> tuple[Array, Array]:
    """State and covariance before the first sample; the remembered position lies one interval back."""
    x, spread = watched.z0, watched.spread
    P = np.zeros((len(x), x.shape[1] + memory, x.shape[1] + memory))
    n = x.shape[1]
    P[:, range(n), range(n)] = np.square(spread)
    if memory:
        v = watched.system.state_names.index("v1")
        back = np.zeros((n + 1, n))
        back[:n] = np.eye(n)
        back[n, 0], back[n, v] = 1.0, -watched.dt
        P = back @ P[:, :n, :n] @ back.T
        x = x @ back.T
    return x.copy(), P


def _remembering(F: Array, push: Array, memory: int) -> tuple[Array, Array]:
    """Transition that also hands the present position on as the last one (it is state 0)."""
    if not memory:
        return F, push
    K, n = push.shape
    wide = np.zeros((K, n + 1, n + 1))
    wide[:, :n, :n] = F
    wide[:, n, 0] = 1.0
    return wide, np.concatenate([push, np.zeros((K, 1))], axis=1)


def clipped(lanes: Lanes, z: Array) -> Array:
    """Limited states within their limits; a measurement gives no impulse, so nothing else moves."""
    for e in lanes.elements:
        if e.limited:
            z[:, e.state] = np.clip(z[:, e.state], e.low, e.high)
    return z


@dataclass(frozen=True)
class Record:
    """Arrays that a filter writes its results to."""

    z: Array
    std: Array
    innovations: Array
    covariances: Array

    @classmethod
    def empty(cls, samples: int, K: int, n: int, outputs: int) -> Record:
        """Room for `samples` of K lanes with n states."""
        return cls(
            np.empty((samples, K, n)),
            np.empty((samples, K, n)),
            np.empty((samples, K, outputs)),
            np.empty((samples, K, outputs, outputs)),
        )

    def keep(self, k: int, x: Array, P: Array, innovation: Array, S: Array) -> None:
        """Write down sample k."""
        self.z[k], self.innovations[k], self.covariances[k] = x, innovation, S
        self.std[k] = np.sqrt(np.maximum(np.einsum("kii->ki", P), 0.0))
