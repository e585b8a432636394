"""Checks of the samples of one channel: resolution, constant values, missing values."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, Indices

__all__ = [
    "difference_noise",
    "fill_single",
    "is_constant",
    "noise_of_differences",
    "resolution",
    "span_of_present",
]


def resolution(values: Array, *, lattice_tolerance: float = 0.02, same_level: float = 1e-11) -> float:
    """Smallest step of a channel, in its unit.

    If all values lie on a lattice (an encoder's counts, a difference of counts, a fixed number of printed
    decimals), it is the step of the lattice. Otherwise it is the spacing of floating-point numbers at the channel's
    largest value, of single precision if every value is a single-precision number. With a fixed number of significant
    digits, whose step grows with the value, it is no less than the median of these steps.

    Parameters
    ----------
    values : ndarray, shape (samples,)
        Finite.
    lattice_tolerance : float
        Largest deviation of a step from a multiple of the smallest step, in parts of the smallest step.
    same_level : float
        Distance of two values, relative to the largest value, up to which they are the same level.

    Returns
    -------
    float
        Positive.
    """
    return max(_least_step(values, lattice_tolerance, same_level), _printed_step(values, same_level))


def _least_step(values: Array, lattice_tolerance: float, same_level: float) -> float:
    """Smallest step of a lattice, of printed decimals or of floating-point numbers."""
    levels = np.unique(values)
    largest = float(np.abs(levels).max())
    steps = np.diff(levels)
    steps = steps[steps > same_level * largest]
    if steps.size:
        step = float(steps.min())
        for _ in range(2):  # the smallest step carries the rounding of two values; the mean over all steps does not
            counts = np.rint(steps / step)
            step = float(steps.sum() / counts.sum())
        # A lattice is visible only if rounding leaves its points apart.
        if np.abs(steps / step - counts).max() < lattice_tolerance:
            return step
    if largest == 0.0:
        return float(np.finfo(np.float64).eps)
    for digits in range(12) if levels.size > 1 else ():  # printed decimals, whose last one may not occur twice in a row
        counts = levels * 10.0**digits
        if same_level * 10.0**digits * largest > lattice_tolerance:
            break
        if np.abs(counts - np.rint(counts)).max() <= same_level * 10.0**digits * largest:
            if 10.0**-digits > 1e3 * np.spacing(largest):
                return 10.0**-digits
            break
    with np.errstate(over="ignore"):
        single = values.astype(np.float32)
    # Single precision is printed with nine digits, which change a number by 5e-9 of itself at most.
    if np.isfinite(single).all() and (np.abs(values - single) <= 5.1e-9 * np.abs(values)).all():
        return float(np.spacing(np.float32(largest)))
    return float(np.spacing(largest))


def _printed_step(values: Array, same_level: float, few: int = 7) -> float:
    """Median of the steps of numbers that were printed with the same few significant digits; 0 for others."""
    present = np.abs(values[np.abs(values) > np.finfo(float).tiny * 10.0**few])
    if not present.size or np.ptp(values) == 0.0:
        return 0.0
    size = 10.0 ** np.floor(np.log10(present))
    for digits in range(3, few + 1):
        step = size * 10.0 ** (1 - digits)
        if _are_whole(present / step, same_level * 10.0**digits):
            finest = 10.0 * float(np.quantile(step, 0.01))  # what is on it has the same decimals, small or large
            return 0.0 if _are_whole(present / finest, same_level * 10.0**few) else float(np.median(step))
    return 0.0


def _are_whole(counts: Array, slack: float) -> bool:
    return bool(np.abs(counts - np.rint(counts)).max() <= slack)


def difference_noise(values: Array, order: int) -> Array:
    """Standard deviation of white noise from differences of an order, in which a smooth motion is small.

    Parameters
    ----------
    values : ndarray, shape (..., samples)
    order : int
        Of the differences.

    Returns
    -------
    ndarray, shape (...)
        By their median, so that jumps do not count.
    """
    return noise_of_differences(np.median(np.abs(np.diff(values, order)), axis=-1), order)


def noise_of_differences(median: Array, order: int) -> Array:
    """Standard deviation of white noise, from the median of the magnitude of its differences of an order."""
    return np.asarray(1.4826 * median / math.sqrt(math.comb(2 * order, order)))


def is_constant(values: Array) -> bool:
    """Return True if all values of a channel are equal."""
    return bool(np.ptp(values) == 0.0)


def span_of_present(missing: NDArray[np.bool_]) -> slice:
    """Return the range from the first to the last sample that is present.

    Parameters
    ----------
    missing : ndarray of bool, shape (samples,)
        Not all of them.
    """
    present = np.flatnonzero(~missing)
    return slice(int(present[0]), int(present[-1]) + 1)


def fill_single(values: Array) -> tuple[Array, Indices, Indices]:
    """Fill every missing value (NaN) between two present neighbours by their mean.

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
