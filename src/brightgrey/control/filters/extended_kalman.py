"""Extended Kalman filter: the state of a drive from its recording.

The construction kit gives the Jacobian of every model, so no effect is named here. The disturbance is a torque beside
the input, held over each sampling interval. The measurement noise is white.
"""

from __future__ import annotations

from collections.abc import Callable
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
    "predict_state",
    "run_filter",
    "update_state",
]


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the disturbance and of the measurement noise."""

    #: Of the disturbing torque beside the input, held over each sampling interval, N m (N), shape (K,).
    torque: float | Array
    outputs: Array  #: Of each measured output, SI, shape (outputs,) or (K, outputs).

    def measurement_covariance(self, sets: int) -> Array:
        """Covariance R of the measurement noise, shape (K, outputs, outputs)."""
        std = np.broadcast_to(self.outputs, (sets, np.shape(self.outputs)[-1]))
        return np.asarray(np.square(std)[:, :, None] * np.eye(std.shape[1]))

    def disturbance_std(self, sets: int) -> Array:
        """Standard deviation of the disturbance, shape (K,)."""
        return np.broadcast_to(np.asarray(self.torque, float), (sets,))


@dataclass(frozen=True)
class FilterResult:
    """Estimated states and innovations of a filter run."""

    z: Array  #: Filtered states: each is estimated from the samples up to its own, shape (samples, K, n).
    std: Array  #: Standard deviations of the states, shape (samples, K, n).
    #: States of the most likely component of a Gaussian sum; the estimated states for the other filters, shape
    #: (samples, K, n).
    most_likely: Array
    innovations: Array  #: Measured minus predicted outputs, shape (samples, K, outputs).
    #: Covariances that the filter predicts for the innovations, shape (samples, K, outputs, outputs).
    covariances: Array
    #: Innovations transformed to white noise of variance 1, output after output by the Cholesky factor of the
    #: covariance. Of a Gaussian sum they are normal quantiles of its predictive distribution. Shape (samples, K,
    #: outputs).
    normalised_innovations: Array
    log_likelihood: Array  #: Logarithm of the likelihood of each recording, shape (K,).

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (samples, K); chi-squared with as many degrees as outputs."""
        return np.asarray(np.square(self.normalised_innovations).sum(axis=-1))


class MeasurementUpdate(NamedTuple):
    """State (K, m) and covariance (K, m, m) after a sample, innovation (K, outputs) and its predicted covariance."""

    x: Array
    P: Array
    innovation: Array
    S: Array


def predict_state(process: ProcessModel, k: int, x: Array, P: Array, torque: Array) -> tuple[Array, Array]:
    """Predict state and covariance at sample k + 1; `torque` (K,) is the disturbance's standard deviation."""
    step = process.transition(k, x)
    F, disturbed = step.by_state, step.by_disturbance * torque[:, None]
    return step.x, F @ P @ F.transpose(0, 2, 1) + disturbed[:, :, None] * disturbed[:, None, :]


def update_state(process: ProcessModel, k: int, x: Array, P: Array, y: Array, R: Array) -> MeasurementUpdate:
    """Update state and covariance with the measurement `y` (K, outputs) of sample k, in Joseph's form."""
    predicted, H = process.predict_outputs(k, x)
    S = H @ P @ H.transpose(0, 2, 1) + R
    gain = np.linalg.solve(S, H @ P).transpose(0, 2, 1)
    innovation = y - predicted
    rest = np.eye(x.shape[1]) - gain @ H
    after = rest @ P @ rest.transpose(0, 2, 1) + gain @ R @ gain.transpose(0, 2, 1)
    x = process.clip_to_limits(x + np.einsum("kij,kj->ki", gain, innovation))
    return MeasurementUpdate(x, after, innovation, S)


def initial_estimate(filter_input: FilterInput, process: ProcessModel, torque: Array) -> tuple[Array, Array]:
    """State and covariance before the first sample is used."""
    first_speed = filter_input.system.state_names.index("v1")
    return process.augment(filter_input.z0, filter_input.P0, torque, first_speed)


def run_filter(
    filter_input: FilterInput,
    noise: Noise,
    prediction: Callable[[ProcessModel, int, Array, Array, Array], tuple[Array, Array]],
) -> FilterResult:
    """Run a Gaussian filter: the linearised update after the given prediction.

    Parameters
    ----------
    filter_input : FilterInput
    noise : Noise
    prediction : callable
        Called as :func:`predict_state`.
    """
    samples, K = filter_input.u.shape
    process = ProcessModel.of(filter_input)
    R, torque = noise.measurement_covariance(K), noise.disturbance_std(K)
    x, P = initial_estimate(filter_input, process, torque)
    record = FilterRecord.empty(samples, K, process.n_states, len(filter_input.differenced))
    for k in range(samples):
        if k:
            x, P = prediction(process, k - 1, x, P, torque)
        x, P, innovation, S = update_state(process, k, x, P, filter_input.y[k], R)
        record.store(k, x, P, innovation, S)
    return record.gaussian_result()


def extended_kalman_filter(filter_input: FilterInput, noise: Noise) -> FilterResult:
    """Run the extended Kalman filter over the recordings.

    Parameters
    ----------
    filter_input : FilterInput
        From :func:`brightgrey.control.filters.setup.prepare`.
    noise : Noise

    Returns
    -------
    FilterResult

    Notes
    -----
    The filter decides every contact at the predicted state. If a gap may be open or closed within the state's standard
    deviation, use :func:`brightgrey.control.filters.gaussian_sum.gaussian_sum_filter`. If friction changes sharply
    within it, compare with :func:`brightgrey.control.filters.unscented_kalman.unscented_kalman_filter`.
    """
    return run_filter(filter_input, noise, predict_state)


@dataclass(frozen=True)
class FilterRecord:
    """Arrays that a filter writes its results to."""

    z: Array
    std: Array
    most_likely: Array
    innovations: Array
    covariances: Array

    @classmethod
    def empty(cls, samples: int, sets: int, states: int, outputs: int) -> FilterRecord:
        """Arrays for all samples of several parameter sets, not yet filled."""
        z, std, most_likely = (np.empty((samples, sets, states)) for _ in range(3))
        return cls(z, std, most_likely, np.empty((samples, sets, outputs)), np.empty((samples, sets, outputs, outputs)))

    def store(self, k: int, x: Array, P: Array, innovation: Array, S: Array, most_likely: Array | None = None) -> None:
        """Store sample k."""
        n = self.z.shape[2]
        self.z[k], self.innovations[k], self.covariances[k] = x[:, :n], innovation, S
        self.most_likely[k] = (x if most_likely is None else most_likely)[:, :n]
        self.std[k] = np.sqrt(np.maximum(np.einsum("kii->ki", P)[:, :n], 0.0))

    def gaussian_result(self) -> FilterResult:
        """Result of a filter whose innovations are normal."""
        roots = np.linalg.cholesky(self.covariances)
        white = np.asarray(np.linalg.solve(roots, self.innovations[..., None])[..., 0])
        _, log_det = np.linalg.slogdet(2.0 * np.pi * self.covariances)
        return self.result(white, -0.5 * np.sum(np.square(white).sum(axis=-1) + log_det, axis=0))

    def result(self, white: Array, log_likelihood: Array) -> FilterResult:
        """Result with the given normalised innovations and likelihoods."""
        return FilterResult(
            self.z, self.std, self.most_likely, self.innovations, self.covariances, white, log_likelihood
        )
