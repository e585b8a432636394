"""Unscented Kalman filter: for comparison, and where friction or contacts are hard within the state's spread.

Sigma points (Julier, Uhlmann 2004, doi:10.1109/JPROC.2003.823141, with the scaling of Wan and van der Merwe 2000) go
through the same step as the extended filter's expected state, each with friction and contacts of its own.
"""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.filters.extended_kalman import Filtered, Noise, Record, begin, updated
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel

__all__ = ["unscented"]

_ALPHA, _BETA, _KAPPA = 1.0, 2.0, 0.0
_FLOOR = 1e-12  # of each variance: keeps the root of the covariance from failing


def unscented(watched: FilterInput, noise: Noise) -> Filtered:
    """Run the unscented Kalman filter over the recordings.

    Parameters
    ----------
    watched : FilterInput
    noise : Noise

    Returns
    -------
    Filtered
    """
    samples, K = watched.u.shape
    course = ProcessModel.of(watched)
    R, torque = noise.sensors(K), noise.torques(K)
    x, P = begin(watched, course, torque)
    points = 2 * (x.shape[1] + 1) + 1  # the disturbance to come is a state of its own
    many = ProcessModel.of(watched, points)
    out = Record.empty(samples, K, course.states, len(watched.differenced))
    for k in range(samples):
        if k:
            x, P = _spread(many, k - 1, x, P, torque)
        x, P, innovation, S = updated(course, k, x, P, watched.y[k], R)
        out.keep(k, x, P, innovation, S)
    return out.gaussian()


def _spread(many: ProcessModel, k: int, x: Array, P: Array, torque: Array) -> tuple[Array, Array]:
    """State and covariance one sample on, from where the sigma points come to lie."""
    K, m = x.shape
    wide = np.zeros((K, m + 1, m + 1))
    wide[:, :m, :m], wide[:, m, m] = P, np.square(torque)
    spread, mean_weights, weights = _points(np.concatenate([x, np.zeros((K, 1))], axis=1), wide)
    flat = spread.reshape(-1, m + 1)
    moved = many.carry(k, flat[:, :m], flat[:, m]).x.reshape(K, -1, m)
    mean = np.einsum("p,kpi->ki", mean_weights, moved)
    apart = moved - mean[:, None]
    return mean, np.einsum("p,kpi,kpj->kij", weights, apart, apart)


def _points(mean: Array, P: Array) -> tuple[Array, Array, Array]:
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
