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
    best, least = np.clip(np.zeros_like(x), low, high), np.inf
    # None is a variable that is free; at least one of those that have a bound is at it.
    choices = [(None, *(e for e in ends if np.isfinite(e))) for ends in zip(low, high, strict=True)]
    for choice in itertools.product(*choices):
        free = np.array([end is None for end in choice])
        found = np.array([0.0 if end is None else end for end in choice])
        found[free] = np.linalg.lstsq(r[:, free], target - r @ found, rcond=1e-12)[0]
        misfit = float(np.square(r @ found - target).sum())
        if misfit < least and np.all((found >= low) & (found <= high)):
            best, least = found, misfit
    return np.asarray(best)
