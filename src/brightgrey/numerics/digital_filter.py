"""Digital filters and Welch's cross-spectral density, as scipy.signal has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dtbsv

from brightgrey.arrays import Array, Complex

__all__ = ["csd", "lfilter"]


def lfilter(b: ArrayLike, a: Sequence[float] | Array, x: Array, axis: int = -1) -> Array:
    """Filter `x` by the transfer function b(z) / a(z), from rest.

    Parameters
    ----------
    b, a : array_like
        Coefficients of falling powers of z.
    x : ndarray
    axis : int
        Axis along which the samples follow each other.

    Returns
    -------
    ndarray
        Of the shape of `x`.
    """
    first = np.asarray(b, np.float64) / a[0]
    recursion = np.asarray(a, np.float64) / a[0]

    def along(samples: Array) -> Array:
        moving = np.convolve(first, samples)[: samples.size]
        if recursion.size == 1:
            return moving
        # Every column of the banded matrix of the recursion holds the same coefficients.
        matrix = np.asfortranarray(np.broadcast_to(recursion[:, None], (recursion.size, samples.size)))
        return np.asarray(dtbsv(recursion.size - 1, matrix, moving, lower=1, diag=1))

    return np.asarray(np.apply_along_axis(along, axis, x))


def csd(x: Array, y: Array, *, fs: float, nperseg: int) -> tuple[Array, Complex]:
    """Cross-spectral density by Welch's method: Hann windows that overlap by half, each without its mean.

    Welch 1967, doi:10.1109/TAU.1967.1161901.

    Parameters
    ----------
    x, y : ndarray, shape (samples,)
        Of equal length, at least `nperseg`.
    fs : float
        Samples per second.
    nperseg : int
        Samples of a segment.

    Returns
    -------
    frequency : ndarray, shape (nperseg // 2 + 1,)
        Hz.
    density : ndarray, shape (nperseg // 2 + 1,)
        One-sided, complex, in (unit of x) (unit of y) / Hz.
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(nperseg) / nperseg)
    step = nperseg - nperseg // 2

    def spectra(samples: Array) -> Complex:
        segments = np.lib.stride_tricks.sliding_window_view(samples, nperseg)[::step]
        return np.fft.rfft(window * (segments - segments.mean(axis=1, keepdims=True)))

    density = np.mean(np.conj(spectra(x)) * spectra(y), axis=0) / (fs * np.sum(window**2))
    density[1 : (-1 if nperseg % 2 == 0 else None)] *= 2.0
    return np.asarray(np.fft.rfftfreq(nperseg, 1.0 / fs), np.float64), density
