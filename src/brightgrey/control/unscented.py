"""Unscented Kalman filter: for comparison, and where friction or contacts are hard within the state's spread.

Sigma points (Julier, Uhlmann 2004, doi:10.1109/JPROC.2003.823141, with the scaling of Wan and van der Merwe 2000) go
through the same step as the extended filter's expected state, each with friction and contacts of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brightgrey.control.flow import Lanes, ahead, delayed_input
from brightgrey.control.kalman import Filtered, Noise, Record, Watched, clipped
from brightgrey.errors import SettingsError

__all__ = ["unscented"]

Array = NDArray[np.float64]
_ALPHA, _BETA, _KAPPA = 1.0, 2.0, 0.0
_FLOOR = 1e-12  # of each variance: keeps the root of the covariance from failing


def unscented(watched: Watched, noise: Noise) -> Filtered:
    """Run the unscented Kalman filter over the recordings.

    Parameters
    ----------
    watched : Watched
        Outputs that are differenced positions are not supported.
    noise : Noise

    Returns
    -------
    Filtered

    Raises
    ------
    SettingsError
        For a differenced output.
    """
    if any(watched.differenced):
        raise SettingsError("the unscented filter takes no 'velocity-differenced' output; use the extended one")
    samples, K = watched.u.shape
    one = Lanes.of(watched.system, K)
    n = one.A.shape[1]
    points = 2 * (n + 1) + 1  # the disturbance torque is a state of its own
    lanes = one.picked(np.repeat(np.arange(K), points))
    tolerance = np.repeat(watched.tolerance, points)
    delay = np.broadcast_to(np.asarray(watched.system.dead_time, float), (K,))
    begin, end = delayed_input(watched.u, watched.dt, delay, watched.hold)
    z = watched.z0.copy()
    P = np.zeros((K, n, n))
    P[:, range(n), range(n)] = np.square(watched.spread)
    R = noise.sensors(K)
    torque = np.broadcast_to(np.asarray(noise.torque, float), (K,))
    out = Record.empty(samples, K, n, watched.y.shape[2])
    for k in range(samples):
        if k:
            wide = np.zeros((K, n + 1, n + 1))
            wide[:, :n, :n], wide[:, n, n] = P, np.square(torque)
            spread, mean_weights, weights = _points(np.concatenate([z, np.zeros((K, 1))], axis=1), wide)
            flat = spread.reshape(K * points, n + 1)
            u0 = np.repeat(begin[k - 1], points) + flat[:, n]
            u1 = np.repeat(end[k - 1], points) + flat[:, n]
            moved = ahead(lanes, flat[:, :n], u0, u1, watched.dt, tolerance).z.reshape(K, points, n)
            z = np.einsum("p,kpi->ki", mean_weights, moved)
            apart = moved - z[:, None]
            P = np.einsum("p,kpi,kpj->kij", weights, apart, apart)
        u = begin[0] if k == 0 else end[k - 1]
        y, H = one.measured(z, u)
        S = H @ P @ H.transpose(0, 2, 1) + R
        gain = np.linalg.solve(S, H @ P).transpose(0, 2, 1)
        innovation = watched.y[k] - y
        z = clipped(one, z + np.einsum("kij,kj->ki", gain, innovation))
        rest = np.eye(n) - gain @ H
        P = rest @ P @ rest.transpose(0, 2, 1) + gain @ R @ gain.transpose(0, 2, 1)
        out.keep(k, z, P, innovation, S)
    return Filtered(out.z, out.std, out.innovations, out.covariances)


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
