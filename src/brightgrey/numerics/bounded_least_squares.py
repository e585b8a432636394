"""Linear least squares within bounds, for few bounded variables."""

from __future__ import annotations

import itertools

import numpy as np

from brightgrey.arrays import Array

__all__ = ["bounded_least_squares"]


def bounded_least_squares(A: Array, b: Array, low: Array, high: Array) -> Array:
    """Solve min |A x - b| for low <= x <= high, exactly.

    The solution is that without bounds for some variables, the others being at a bound. All choices are tried, which
    is meant for a handful of bounded variables; scipy.optimize takes longer to import than this takes.

    Parameters
    ----------
    A : ndarray, shape (m, n)
        With columns of about one size.
    b : ndarray, shape (m,)
    low, high : ndarray, shape (n,)
        Infinite where there is no bound.

    Returns
    -------
    ndarray, shape (n,)
    """
    x = np.linalg.lstsq(A, b, rcond=-1)[0]
    if np.all((x >= low) & (x <= high)):
        return np.asarray(x)
    q, r = np.linalg.qr(A)
    target = q.T @ b
    ends = [(np.nan, *(end for end in both if np.isfinite(end))) for both in zip(low, high, strict=True)]
    choices = np.array(list(itertools.product(*ends)))  # shape (choices, n); NaN for a variable that is free
    free = np.isnan(choices)
    fixed = np.where(free, 0.0, choices)
    solved = np.linalg.pinv(r * free[:, None, :], rcond=1e-12) @ (target - fixed @ r.T)[:, :, None]
    found = np.where(free, solved[:, :, 0], choices)
    inside = np.all((found >= low) & (found <= high), axis=1)
    if not inside.any():
        return np.asarray(np.clip(np.zeros_like(x), low, high))
    misfit = np.square(found @ r.T - target).sum(axis=1)
    return np.asarray(found[np.argmin(np.where(inside, misfit, np.inf))])
