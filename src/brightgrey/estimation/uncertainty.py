"""How sure the parameters are, with residuals that are not white."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

__all__ = ["covariance", "weakest"]

Array = NDArray[np.float64]


def covariance(residual: Array, jacobian: Array, lengths: Sequence[int]) -> Array:
    """Covariance, shape (P, P), of a least-squares estimate with coloured residuals.

    ``H^-1 (J' Gamma J) H^-1`` with H = J' J and the residuals' autocovariance Gamma, estimated from the residuals
    with a Parzen taper; for white residuals it is the usual sigma^2 H^-1. Simulation-error residuals follow the
    model's errors slowly, and the usual formula is then far too sure of itself (Newey and West 1987,
    doi:10.2307/1913610).

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
    jacobian : ndarray, shape (residuals, P)
    lengths : sequence of int
        Lengths of the stretches (one per recording and output) that residuals are correlated within.
    """
    count = jacobian.shape[1]
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    J = jacobian / scale
    inner = np.zeros((count, count))
    begin = 0
    for length in lengths:
        piece = slice(begin, begin + length)
        inner += _coloured(residual[piece], J[piece])
        begin += length
    free = max(len(residual) - count, 1)
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-13, hermitian=True)
    result = inverse @ inner @ inverse * (len(residual) / free)
    return np.asarray(result / np.outer(scale, scale))


def _coloured(r: Array, J: Array) -> Array:
    """J' Gamma J for one stretch."""
    n = len(r)
    full = fftconvolve(r, r[::-1])[n - 1 :] / n
    below = np.flatnonzero(full <= 0.0)
    memory = int(below[0]) if len(below) else n // 4
    cut = int(np.clip(4 * memory, 8, n // 3))
    lag = np.arange(cut) / cut
    taper = np.where(lag <= 0.5, 1 - 6 * lag**2 * (1 - lag), 2 * (1 - lag) ** 3)
    kernel = full[:cut] * taper
    kernel = np.concatenate([kernel[:0:-1], kernel])
    filtered = fftconvolve(J, kernel[:, None], mode="full", axes=0)[cut - 1 : cut - 1 + n]
    inner = J.T @ filtered
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    return np.asarray(vectors * np.maximum(values, 0.0) @ vectors.T)


def weakest(jacobian: Array) -> tuple[float, Array]:
    """Condition number of the Jacobian with normed columns, and the direction it shows least, shape (P,)."""
    if jacobian.shape[1] == 0:
        return 1.0, np.zeros(0)
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.all(scale > 0.0):
        return np.inf, (scale == 0.0).astype(float)
    _, s, v = np.linalg.svd(jacobian / scale, full_matrices=False)
    return float(s[0] / max(s[-1], 1e-300)), np.asarray(v[-1])
