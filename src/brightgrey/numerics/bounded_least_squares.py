"""Linear least squares with lower bounds, for many small problems at once."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array

__all__ = ["bounded_least_squares"]


def bounded_least_squares(A: Array, b: Array, low: Array, *, ridge: float = 1e-8, rounding: float = 1e-12) -> Array:
    """Solve min |A x - b| for x >= low.

    A variable is free or at its bound. All that are on the wrong side are exchanged in each round. Where that brings
    nothing, the last one alone is, so that it ends (block principal pivoting; Portugal, Judice and Vicente 1994,
    doi:10.1090/S0025-5718-1994-1250776-4). scipy.optimize takes longer to import than this takes.

    Parameters
    ----------
    A : ndarray, shape (..., m, n)
        With columns of about one size.
    b : ndarray, shape (..., m)
    low : ndarray, shape (..., n)
        Minus infinity where there is no bound.
    ridge : float
        Part of the columns by which collinear ones differ, which share what they explain then.
    rounding : float
        Part of the target below which a slope is zero.

    Returns
    -------
    ndarray, shape (..., n)
    """
    n = A.shape[-1]
    shape = np.broadcast_shapes(A.shape[:-2], b.shape[:-1], low.shape[:-1])
    q, r = np.linalg.qr(np.broadcast_to(A, (*shape, *A.shape[-2:])).reshape(-1, *A.shape[-2:]))
    target = np.einsum("kmr,km->kr", q, np.broadcast_to(b, (*shape, b.shape[-1])).reshape(len(q), -1))
    damped = ridge * np.linalg.norm(r, axis=(1, 2))[:, None, None] * np.eye(n)
    r, target = np.concatenate([r, damped], axis=1), np.concatenate([target, np.zeros((len(q), n))], axis=1)
    bounded = np.broadcast_to(np.isfinite(low), (*shape, n)).reshape(-1, n)
    least = np.where(bounded, np.broadcast_to(low, (*shape, n)).reshape(-1, n), 0.0)
    free, x = np.ones_like(bounded), least.copy()
    full_exchanges = 3  # that may bring nothing in succession
    fewest, patience = np.full(len(x), n + 1), np.full(len(x), full_exchanges)
    open_ = np.arange(len(x))
    for _ in range(20 * n):  # two or three do nearly always
        R, own, bound = r[open_], free[open_], least[open_]
        rest = target[open_] - np.einsum("kij,kj->ki", R, np.where(own, 0.0, bound))
        found = np.einsum("kij,kj->ki", np.linalg.pinv(R * own[:, None, :], rcond=rounding), rest)
        x[open_] = np.where(own, found, bound)
        slope = np.einsum("kij,ki->kj", R, np.einsum("kij,kj->ki", R, np.where(own, found, 0.0)) - rest)
        zero = rounding * np.linalg.norm(R, axis=1) * np.linalg.norm(target[open_], axis=1, keepdims=True)
        wrong = bounded[open_] & np.where(own, found < bound, slope < -zero)
        count = wrong.sum(axis=1)
        patience[open_] = np.where(count < fewest[open_], full_exchanges, patience[open_] - 1)
        fewest[open_] = np.minimum(fewest[open_], count)
        last = wrong & (np.cumsum(wrong[:, ::-1], axis=1)[:, ::-1] == 1)
        free[open_] ^= np.where((patience[open_] > 0)[:, None], wrong, last)
        open_ = open_[count > 0]
        if not open_.size:
            break
    return np.where(bounded, np.maximum(x, least), x).reshape(*shape, n)
