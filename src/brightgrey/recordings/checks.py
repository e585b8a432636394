"""What can be said of the samples of one channel: gaps, resolution, and whether it moves at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, Indices

__all__ = ["fill_single", "is_constant", "resolution", "trim"]


# A step counts as a multiple of the smallest one if it is that close to it, in parts of the smallest.
STEP_TOLERANCE = 0.02
# Values closer than this part of the range are the same one, printed or computed differently.
SAME = 1e-11


def resolution(values: Array) -> float:
    """Smallest step of a channel, in its unit.

    If all values stand on a lattice (an encoder's counts, a difference of counts, a fixed number of printed
    decimals), its step; else the spacing of floating-point numbers at the channel's largest value, that of
    single precision where every value is one.

    Parameters
    ----------
    values : ndarray, shape (samples,)
        Finite.

    Returns
    -------
    float
        Positive.
    """
    levels = np.unique(values)
    largest = float(np.abs(levels).max())
    steps = np.diff(levels)
    steps = steps[steps > SAME * largest]
    if steps.size:
        step = float(steps.min())
        for _ in range(2):  # the smallest step carries the rounding of two values; all of them together do not
            counts = np.rint(steps / step)
            step = float(steps.sum() / counts.sum())
        # A lattice of n steps can only be seen if rounding leaves its points apart.
        if np.abs(steps / step - counts).max() < STEP_TOLERANCE:
            return step
    if largest == 0.0:
        return float(np.finfo(np.float64).eps)
    with np.errstate(over="ignore"):
        single = values.astype(np.float32)
    # Nine digits are what single precision is printed with; they put a number off by 5e-9 of itself.
    if np.isfinite(single).all() and (np.abs(values - single) <= 5.1e-9 * np.abs(values)).all():
        return float(np.spacing(np.float32(largest)))
    return float(np.spacing(largest))


def is_constant(values: Array) -> bool:
    """Whether a channel never changes."""
    return bool(np.ptp(values) == 0.0)


def trim(missing: NDArray[np.bool_]) -> slice:
    """Cut off the missing samples at both ends.

    Parameters
    ----------
    missing : ndarray of bool, shape (samples,)
        Not all of them.
    """
    present = np.flatnonzero(~missing)
    return slice(int(present[0]), int(present[-1]) + 1)


def fill_single(values: Array) -> tuple[Array, Indices, Indices]:
    """Fill every missing value (NaN) that stands between two present ones by their mean.

    Parameters
    ----------
    values : ndarray, shape (samples,)

    Returns
    -------
    filled : ndarray, shape (samples,)
    repaired : ndarray of int
        Samples that were filled.
    left : ndarray of int
        Samples that are still missing.
    """
    missing = np.isnan(values)
    padded = np.pad(missing, 1, constant_values=True)
    repaired = np.flatnonzero(missing & ~padded[:-2] & ~padded[2:])
    filled = values.copy()
    filled[repaired] = 0.5 * (values[repaired - 1] + values[repaired + 1])
    return filled, repaired, np.flatnonzero(np.isnan(filled))
