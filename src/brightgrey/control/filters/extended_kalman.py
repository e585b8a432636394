"""Extended Kalman filter: the state of a drive from its recording, the Jacobian from the element table.

The form of the model gives the linearisation for free, so no effect is named here. The disturbance is a torque beside
the input, held over each sampling interval; what the sensors add is white.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel

__all__ = ["FilterInput", "Filtered", "Noise", "Record", "Updated", "begin", "extended", "predicted", "updated"]


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

    def torques(self, lanes: int) -> Array:
        """Standard deviation of the disturbance, shape (K,)."""
        return np.broadcast_to(np.asarray(self.torque, float), (lanes,))


@dataclass(frozen=True)
class Filtered:
    """What a filter found.

    Attributes
    ----------
    z : ndarray, shape (samples, K, n)
        Estimated states, each from the samples up to its own.
    std : ndarray, shape (samples, K, n)
        Their standard deviations.
    likeliest : ndarray, shape (samples, K, n)
        The states of the likeliest component of a sum of Gaussians; else the estimated ones.
    innovations : ndarray, shape (samples, K, outputs)
        Measured less predicted.
    covariances : ndarray, shape (samples, K, outputs, outputs)
        Expected of the innovations.
    white : ndarray, shape (samples, K, outputs)
        Innovations made white, normal and of unit size: what each output, given those before it, is in standard
        deviations; of a sum of Gaussians the quantile of the normal distribution that the sum gave it.
    log_likelihood : ndarray, shape (K,)
        Logarithm of the likelihood of each recording.
    """

    z: Array
    std: Array
    likeliest: Array
    innovations: Array
    covariances: Array
    white: Array
    log_likelihood: Array

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (samples, K); chi-squared with as many degrees as outputs."""
        return np.asarray(np.square(self.white).sum(axis=-1))


class Updated(NamedTuple):
    """State (K, m) and covariance (K, m, m) after a sample; innovation (K, outputs) and what was expected of it."""

    x: Array
    P: Array
    innovation: Array
    S: Array


def predicted(course: ProcessModel, k: int, x: Array, P: Array, torque: Array) -> tuple[Array, Array]:
    """State and covariance one sample on; `torque` (K,) is the disturbance's standard deviation."""
    moved = course.carry(k, x)
    F, push = moved.by_state, moved.by_disturbance * torque[:, None]
    return moved.x, F @ P @ F.transpose(0, 2, 1) + push[:, :, None] * push[:, None, :]


def updated(course: ProcessModel, k: int, x: Array, P: Array, y: Array, R: Array) -> Updated:
    """State and covariance with the measurement `y` (K, outputs) of sample k; Joseph's form."""
    expected, H = course.measure(k, x)
    S = H @ P @ H.transpose(0, 2, 1) + R
    gain = np.linalg.solve(S, H @ P).transpose(0, 2, 1)
    innovation = y - expected
    rest = np.eye(x.shape[1]) - gain @ H
    after = rest @ P @ rest.transpose(0, 2, 1) + gain @ R @ gain.transpose(0, 2, 1)
    return Updated(course.clipped(x + np.einsum("kij,kj->ki", gain, innovation)), after, innovation, S)


def extended(watched: FilterInput, noise: Noise) -> Filtered:
    """Run the extended Kalman filter over the recordings.

    Parameters
    ----------
    watched : FilterInput
    noise : Noise

    Returns
    -------
    Filtered

    Notes
    -----
    A contact is decided at the expected state; where contacts are uncertain within the state's spread, use
    :func:`brightgrey.control.filters.gaussian_sum.mixture`, and where friction is hard within it, compare with
    :func:`brightgrey.control.filters.unscented_kalman.unscented`.
    """
    samples, K = watched.u.shape
    course = ProcessModel.of(watched)
    R, torque = noise.sensors(K), noise.torques(K)
    x, P = begin(watched, course, torque)
    out = Record.empty(samples, K, course.states, len(watched.differenced))
    for k in range(samples):
        if k:
            x, P = predicted(course, k - 1, x, P, torque)
        x, P, innovation, S = updated(course, k, x, P, watched.y[k], R)
        out.keep(k, x, P, innovation, S)
    return out.gaussian()


def begin(watched: FilterInput, course: ProcessModel, torque: Array) -> tuple[Array, Array]:
    """State and covariance at the first sample."""
    return course.start(watched.z0, watched.P0, torque, watched.system.state_names.index("v1"))


@dataclass(frozen=True)
class Record:
    """Arrays that a filter writes its results to."""

    z: Array
    std: Array
    likeliest: Array
    innovations: Array
    covariances: Array

    @classmethod
    def empty(cls, samples: int, K: int, n: int, outputs: int) -> Record:
        """Room for `samples` of K lanes with n states."""
        return cls(
            np.empty((samples, K, n)),
            np.empty((samples, K, n)),
            np.empty((samples, K, n)),
            np.empty((samples, K, outputs)),
            np.empty((samples, K, outputs, outputs)),
        )

    def keep(self, k: int, x: Array, P: Array, innovation: Array, S: Array, likeliest: Array | None = None) -> None:
        """Write down sample k."""
        n = self.z.shape[2]
        self.z[k], self.innovations[k], self.covariances[k] = x[:, :n], innovation, S
        self.likeliest[k] = (x if likeliest is None else likeliest)[:, :n]
        self.std[k] = np.sqrt(np.maximum(np.einsum("kii->ki", P)[:, :n], 0.0))

    def gaussian(self) -> Filtered:
        """What was found, where each innovation is normal."""
        roots = np.linalg.cholesky(self.covariances)
        white = np.asarray(np.linalg.solve(roots, self.innovations[..., None])[..., 0])
        _, size = np.linalg.slogdet(2.0 * np.pi * self.covariances)
        return self.judged(white, -0.5 * np.sum(np.square(white).sum(axis=-1) + size, axis=0))

    def judged(self, white: Array, log_likelihood: Array) -> Filtered:
        """What was found, with the innovations made white and the likelihood."""
        return Filtered(self.z, self.std, self.likeliest, self.innovations, self.covariances, white, log_likelihood)
