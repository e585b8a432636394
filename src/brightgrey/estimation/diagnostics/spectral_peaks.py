"""Peaks in the spectrum of a residual that stand out of what surrounds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from brightgrey.arrays import Array
from brightgrey.numerics.distributions import chi2
from brightgrey.numerics.distributions import f as fisher

__all__ = ["Peak", "peak"]

_FEWEST_TAPERS = 4
_PER_TAPER = 2000  # samples
_AROUND = 0.4  # of a frequency, to both sides: what it is compared with
_FEWEST = 8  # bins that are enough to compare with
_POINTS = 32  # bins to each side that are looked at
_MEDIAN = 2.0 / np.pi  # efficiency of a median
_COHERENT = 0.01


class Peak(NamedTuple):
    """A peak of a residual's spectrum.

    Attributes
    ----------
    frequency : float
        In Hz.
    ratio : float
        Power over that of its surroundings.
    coherent : bool
        Whether the residual hangs together with the input at this frequency (1 %).
    """

    frequency: float
    ratio: float
    coherent: bool


def peak(residual: Array, u: Array, known: Sequence[Array], dt: float, level: float) -> Peak | None:
    """Highest peak of a residual's spectrum that chance and `known` signals do not explain.

    Parameters
    ----------
    residual, u : ndarray, shape (samples,)
    known : sequence of ndarray, shape (samples,)
        Signals whose peaks the residual may share without anything being a resonance: the lines of a periodic motion
        and their harmonics.
    dt : float
    level : float
        Probability of a peak in noise whose spectrum rises or falls steadily around every frequency.

    Notes
    -----
    Spectra are averages over sine tapers (Riedel, Sidorenko 1995, doi:10.1109/78.365298). What surrounds a frequency
    is the median over 40 % to both sides, which is exact for a steady slope; its ratio to the power at the frequency is
    compared with Fisher's distribution, over all frequencies that are looked at together (Bonferroni).
    """
    n = len(residual)
    tapers = max(_FEWEST_TAPERS, n // _PER_TAPER)
    pieces = _eigenspectra(residual, tapers)
    power = np.square(np.abs(pieces)).mean(axis=0)
    bins, around = _looked_at(len(power), tapers)
    if not bins.size or not power.any():
        return None
    ratio, apart = _ratio(power, bins, around, tapers), np.ones(bins.size)
    for x in (u, *known):
        other = np.square(np.abs(_eigenspectra(x, tapers))).mean(axis=0)
        apart = np.maximum(apart, _ratio(other, bins, around, tapers))
    independent = np.array([max(2.0 * w / (tapers + 1.0), 1.0) for w in around])
    limit = fisher.isf(level / bins.size, 2.0 * tapers, 2.0 * tapers * independent * _MEDIAN)
    above = ratio / (limit * apart)
    best = int(np.argmax(above))
    if not above[best] > 1.0:
        return None
    k = int(bins[best])
    frequency = k / (next_fast_len(n, real=True) * dt)
    with_input = _eigenspectra(u, tapers)[:, k]
    together = abs(np.vdot(with_input, pieces[:, k])) ** 2
    apiece = float(np.vdot(with_input, with_input).real * np.vdot(pieces[:, k], pieces[:, k]).real)
    least = 1.0 - _COHERENT ** (1.0 / (tapers - 1.0))
    return Peak(frequency, float(ratio[best]), bool(together > least * apiece))


def _eigenspectra(x: Array, tapers: int) -> NDArray[np.complex128]:
    """Fourier transforms of the tapered signal, shape (tapers, frequencies)."""
    n = len(x)
    k = np.arange(1, tapers + 1)[:, None]
    sines = np.sqrt(2.0 / (n + 1.0)) * np.sin(np.pi * k * np.arange(1, n + 1) / (n + 1.0))
    return np.asarray(rfft((x - x.mean()) * sines, next_fast_len(n, real=True), axis=1))


def _looked_at(count: int, tapers: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bins whose surroundings are within the spectrum and wide enough, and how many bins these reach to each side."""
    step = max(1, tapers // 4)
    bins = np.arange(tapers, count, step)
    around = (_AROUND * bins).astype(np.int64)
    fits = (2 * around >= max(_FEWEST, 2 * tapers)) & (bins + around < count) & (bins - around >= tapers)
    return bins[fits], around[fits]


def _ratio(power: Array, bins: NDArray[np.int64], around: NDArray[np.int64], tapers: int) -> Array:
    """Power over the median of its surroundings, which is corrected to a mean."""
    steps = np.maximum(around // _POINTS, 1)
    ends = zip(bins, around - around % steps, steps, strict=True)
    middle = np.array([np.median(power[k - w : k + w + 1 : step]) for k, w, step in ends])
    mean = middle * 2.0 * tapers / chi2.median(2.0 * tapers)
    return np.asarray(power[bins] / np.maximum(mean, np.finfo(float).tiny))
