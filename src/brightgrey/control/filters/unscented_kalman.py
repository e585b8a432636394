"""Unscented Kalman filter: for comparison, and where friction or contacts are hard within the state's spread.

Sigma points (Julier, Uhlmann 2004, doi:10.1109/JPROC.2003.823141, with the scaling of Wan and van der Merwe 2000) go
through the same step as the extended filter's expected state, each with friction and contacts of its own.
"""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.filters.extended_kalman import FilterRecord, FilterResult, Noise, initial_estimate, update
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel

__all__ = ["unscented_kalman_filter"]

_ALPHA, _BETA, _KAPPA = 1.0, 2.0, 0.0
_FLOOR = 1e-12  # of each variance: keeps the root of the covariance from failing


def unscented_kalman_filter(filter_input: FilterInput, noise: Noise) -> FilterResult:
    """Run the unscented Kalman filter over the recordings.

    Parameters
    ----------
    watched : FilterInput
    noise : Noise

    Returns
    -------
    Filtered
    """
    samples, K = filter_input.u.shape
    course = ProcessModel.of(filter_input)
    R, torque = noise.measurement_covariance(K), noise.disturbance_std(K)
    x, P = initial_estimate(filter_input, course, torque)
    points = 2 * (x.shape[1] + 1) + 1  # the disturbance to come is a state of its own
    many = ProcessModel.of(filter_input, points)
    out = FilterRecord.empty(samples, K, course.n_states, len(filter_input.differenced))
    for k in range(samples):
        if k:
            x, P = _unscented_predict(many, k - 1, x, P, torque)
        x, P, innovation, S = update(course, k, x, P, filter_input.y[k], R)
        out.store(k, x, P, innovation, S)
    return out.gaussian_result()


def _unscented_predict(many: ProcessModel, k: int, x: Array, P: Array, torque: Array) -> tuple[Array, Array]:
    """State and covariance one sample on, from where the sigma points come to lie."""
    K, m = x.shape
    wide = np.zeros((K, m + 1, m + 1))
    wide[:, :m, :m], wide[:, m, m] = P, np.square(torque)
    spread, mean_weights, weights = _sigma_points(np.concatenate([x, np.zeros((K, 1))], axis=1), wide)
    flat = spread.reshape(-1, m + 1)
    moved = many.transition(k, flat[:, :m], flat[:, m]).x.reshape(K, -1, m)
    mean = np.einsum("p,kpi->ki", mean_weights, moved)
    apart = moved - mean[:, None]
    return mean, np.einsum("p,kpi,kpj->kij", weights, apart, apart)


def _sigma_points(mean: Array, P: Array) -> tuple[Array, Array, Array]:
    """Sigma points, shape (K, 2 m + 1, m), and their weights for mean and covariance."""
    m = mean.shape[1]
    scale = _ALPHA**2 * (m + _KAPPA)
    size = np.sqrt(np.maximum(np.einsum("kii->ki", P), 1e-300))
    correlation = P / size[:, :, None] / size[:, None, :] + _FLOOR * np.eye(m)
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.transpose(0, 2, 1)))
    root = size[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    reach = np.sqrt(scale) * root.transpose(0, 2, 1)
    points = np.concatenate([mean[:, None], mean[:, None] + reach, mean[:, None] - reach], axis=1)
    weights = np.full(2 * m + 1, 0.5 / scale)
    means = weights.copy()
    means[0] = 1.0 - m / scale
    weights[0] = means[0] + 1.0 - _ALPHA**2 + _BETA
    return points, means, weights
