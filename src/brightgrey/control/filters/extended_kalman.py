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

__all__ = [
    "FilterInput",
    "FilterRecord",
    "FilterResult",
    "MeasurementUpdate",
    "Noise",
    "extended_kalman_filter",
    "initial_estimate",
    "predict",
    "update",
]


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

    def measurement_covariance(self, lanes: int) -> Array:
        """Covariance of the measurement, shape (K, outputs, outputs)."""
        std = np.broadcast_to(self.outputs, (lanes, np.shape(self.outputs)[-1]))
        return np.asarray(np.square(std)[:, :, None] * np.eye(std.shape[1]))

    def disturbance_std(self, lanes: int) -> Array:
        """Standard deviation of the disturbance, shape (K,)."""
        return np.broadcast_to(np.asarray(self.torque, float), (lanes,))


@dataclass(frozen=True)
class FilterResult:
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
    most_likely: Array
    innovations: Array
    covariances: Array
    normalised_innovations: Array
    log_likelihood: Array

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (samples, K); chi-squared with as many degrees as outputs."""
        return np.asarray(np.square(self.normalised_innovations).sum(axis=-1))


class MeasurementUpdate(NamedTuple):
    """State (K, m) and covariance (K, m, m) after a sample; innovation (K, outputs) and what was expected of it."""

    x: Array
    P: Array
    innovation: Array
    S: Array


def predict(process: ProcessModel, k: int, x: Array, P: Array, torque: Array) -> tuple[Array, Array]:
    """State and covariance one sample on; `torque` (K,) is the disturbance's standard deviation."""
    moved = process.transition(k, x)
    F, push = moved.by_state, moved.by_disturbance * torque[:, None]
    return moved.x, F @ P @ F.transpose(0, 2, 1) + push[:, :, None] * push[:, None, :]


def update(process: ProcessModel, k: int, x: Array, P: Array, y: Array, R: Array) -> MeasurementUpdate:
    """State and covariance with the measurement `y` (K, outputs) of sample k; Joseph's form."""
    expected, H = process.predict_outputs(k, x)
    S = H @ P @ H.transpose(0, 2, 1) + R
    gain = np.linalg.solve(S, H @ P).transpose(0, 2, 1)
    innovation = y - expected
    rest = np.eye(x.shape[1]) - gain @ H
    after = rest @ P @ rest.transpose(0, 2, 1) + gain @ R @ gain.transpose(0, 2, 1)
    return MeasurementUpdate(
        process.clip_to_limits(x + np.einsum("kij,kj->ki", gain, innovation)), after, innovation, S
    )


def extended_kalman_filter(filter_input: FilterInput, noise: Noise) -> FilterResult:
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
    samples, K = filter_input.u.shape
    course = ProcessModel.of(filter_input)
    R, torque = noise.measurement_covariance(K), noise.disturbance_std(K)
    x, P = initial_estimate(filter_input, course, torque)
    out = FilterRecord.empty(samples, K, course.n_states, len(filter_input.differenced))
    for k in range(samples):
        if k:
            x, P = predict(course, k - 1, x, P, torque)
        x, P, innovation, S = update(course, k, x, P, filter_input.y[k], R)
        out.store(k, x, P, innovation, S)
    return out.gaussian_result()


def initial_estimate(filter_input: FilterInput, process: ProcessModel, torque: Array) -> tuple[Array, Array]:
    """State and covariance at the first sample."""
    return process.augment(filter_input.z0, filter_input.P0, torque, filter_input.system.state_names.index("v1"))


@dataclass(frozen=True)
class FilterRecord:
    """Arrays that a filter writes its results to."""

    z: Array
    std: Array
    most_likely: Array
    innovations: Array
    covariances: Array

    @classmethod
    def empty(cls, samples: int, K: int, n: int, outputs: int) -> FilterRecord:
        """Room for `samples` of K lanes with n states."""
        return cls(
            np.empty((samples, K, n)),
            np.empty((samples, K, n)),
            np.empty((samples, K, n)),
            np.empty((samples, K, outputs)),
            np.empty((samples, K, outputs, outputs)),
        )

    def store(self, k: int, x: Array, P: Array, innovation: Array, S: Array, likeliest: Array | None = None) -> None:
        """Write down sample k."""
        n = self.z.shape[2]
        self.z[k], self.innovations[k], self.covariances[k] = x[:, :n], innovation, S
        self.most_likely[k] = (x if likeliest is None else likeliest)[:, :n]
        self.std[k] = np.sqrt(np.maximum(np.einsum("kii->ki", P)[:, :n], 0.0))

    def gaussian_result(self) -> FilterResult:
        """What was found, where each innovation is normal."""
        roots = np.linalg.cholesky(self.covariances)
        white = np.asarray(np.linalg.solve(roots, self.innovations[..., None])[..., 0])
        _, size = np.linalg.slogdet(2.0 * np.pi * self.covariances)
        return self.result(white, -0.5 * np.sum(np.square(white).sum(axis=-1) + size, axis=0))

    def result(self, white: Array, log_likelihood: Array) -> FilterResult:
        """What was found, with the innovations made white and the likelihood."""
        return FilterResult(
            self.z, self.std, self.most_likely, self.innovations, self.covariances, white, log_likelihood
        )
