"""Unscented Kalman filter, for comparison and for friction that changes sharply within the state's standard deviation.

The sigma points of Julier and Uhlmann (2004, doi:10.1109/JPROC.2003.823141) have the scaling of Wan and van der
Merwe (2000). They pass through the same state transition as the extended filter's state, each with its own friction and
contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.filters.extended_kalman import FilterResult, Noise, run_filter
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel

__all__ = ["UnscentedOptions", "unscented_kalman_filter"]


@dataclass(frozen=True)
class UnscentedOptions:
    """Scaling of the sigma points."""

    #: Spread, weight of the mean in the covariance (2 for a normal distribution), and secondary scaling.
    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0
    variance_floor: float = 1e-12  #: Added to each normalised variance, so that the covariance keeps a square root.


UNSCENTED = UnscentedOptions()


def unscented_kalman_filter(
    filter_input: FilterInput, noise: Noise, options: UnscentedOptions = UNSCENTED
) -> FilterResult:
    """Run the unscented Kalman filter over the recordings.

    Parameters
    ----------
    filter_input : FilterInput
        From :func:`brightgrey.control.filters.setup.prepare`.
    noise : Noise
    options : UnscentedOptions

    Returns
    -------
    FilterResult
    """
    process = ProcessModel.of(filter_input)
    states = process.n_states + process.has_position_state + process.has_disturbance_state
    points = 2 * (states + 1) + 1  # the disturbance of the coming interval is one more state
    return run_filter(
        filter_input, noise, partial(_predict_sigma_points, ProcessModel.of(filter_input, points), options)
    )


def _predict_sigma_points(
    per_point: ProcessModel, options: UnscentedOptions, _: ProcessModel, k: int, x: Array, P: Array, torque: Array
) -> tuple[Array, Array]:
    """Mean and covariance at sample k + 1 of the sigma points; `per_point` has one parameter set per point."""
    K, m = x.shape
    augmented = np.zeros((K, m + 1, m + 1))
    augmented[:, :m, :m], augmented[:, m, m] = P, np.square(torque)
    points, mean_weights, weights = _sigma_points(np.concatenate([x, np.zeros((K, 1))], axis=1), augmented, options)
    flat = points.reshape(-1, m + 1)
    after = per_point.transition(k, flat[:, :m], flat[:, m]).x.reshape(K, -1, m)
    mean = np.einsum("p,kpi->ki", mean_weights, after)
    deviation = after - mean[:, None]
    return mean, np.einsum("p,kpi,kpj->kij", weights, deviation, deviation)


def _sigma_points(mean: Array, P: Array, options: UnscentedOptions) -> tuple[Array, Array, Array]:
    """Sigma points, shape (K, 2 m + 1, m), and their weights for mean and covariance."""
    m = mean.shape[1]
    scale = options.alpha**2 * (m + options.kappa)
    std = np.sqrt(np.maximum(np.einsum("kii->ki", P), 1e-300))
    correlation = P / std[:, :, None] / std[:, None, :] + options.variance_floor * np.eye(m)
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.transpose(0, 2, 1)))
    root = std[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    offsets = np.sqrt(scale) * root.transpose(0, 2, 1)
    points = np.concatenate([mean[:, None], mean[:, None] + offsets, mean[:, None] - offsets], axis=1)
    weights = np.full(2 * m + 1, 0.5 / scale)
    mean_weights = weights.copy()
    mean_weights[0] = 1.0 - m / scale
    weights[0] = mean_weights[0] + 1.0 - options.alpha**2 + options.beta
    return points, mean_weights, weights
