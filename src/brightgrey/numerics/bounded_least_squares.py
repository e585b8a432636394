"""Linear least squares within bounds."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array

__all__ = ["bounded_least_squares"]


def bounded_least_squares(A: Array, b: Array, low: Array, high: Array) -> Array:
    """Solve min |A x - b| for low <= x <= high.

    The unbounded solution is taken if it lies within the bounds; scipy.optimize is imported only if it does not.

    Parameters
    ----------
    A : ndarray, shape (m, n)
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
    from scipy.optimize import lsq_linear

    return np.asarray(lsq_linear(A, b, bounds=(low, high)).x)
