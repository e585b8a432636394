"""Test for peaks in the spectrum of a residual."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.fft import fft
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.options import PEAK_DEFAULTS, PeakOptions
from brightgrey.numerics.distributions import chi2
from brightgrey.numerics.distributions import f as fisher

__all__ = ["Peak", "highest_peak"]


class Peak(NamedTuple):
    """A peak of a residual's spectrum."""

    frequency: float  #: In Hz.
    ratio: float  #: Power over that of the neighbouring frequencies.
    coherent: bool  #: True if the residual is coherent with the input at this frequency (1 %).


def highest_peak(
    residual: Array, u: Array, known: Sequence[Array], dt: float, level: float, options: PeakOptions = PEAK_DEFAULTS
) -> Peak | None:
    """Highest peak of a residual's spectrum that chance and `known` signals do not explain.

    Parameters
    ----------
    residual, u : ndarray, shape (samples,)
    known : sequence of ndarray, shape (samples,)
        Signals whose peaks in the residual are no resonance: lines of a periodic motion and their harmonics.
    dt : float
        Sampling interval in s.
    level : float
        Probability of a peak in noise whose spectrum rises or falls steadily around every frequency.
    options : PeakOptions

    Notes
    -----
    Spectra are averages over sine tapers (Riedel, Sidorenko 1995, doi:10.1109/78.365298). The power at a frequency is
    compared with the median over 40 % to both sides, which is exact for a steady slope. The ratio has Fisher's
    distribution; all frequencies are tested together (Bonferroni).
    """
    n = len(residual)
    tapers = max(options.min_tapers, n // options.samples_per_taper)
    own = _line_spectrum(residual)
    power = _tapered_power(own, tapers)
    bins, around = _tested_bins(len(power), tapers, options)
    if not bins.size or not power.any():
        return None
    ratio = _ratio(power, bins, around, tapers, options)
    independent = np.array([max(2.0 * w / (tapers + 1.0), 1.0) for w in around])
    degrees = 2.0 * tapers * independent * (2.0 / np.pi)  # a median has 2/pi of the efficiency of a mean
    above = ratio / fisher.isf(level / bins.size, 2.0 * tapers, degrees)
    if not above.max() > 1.0:  # as in most residuals, whatever the known signals have there
        return None
    of_known = np.ones(bins.size)
    for x in (u, *known):
        other = _tapered_power(_line_spectrum(x), tapers)
        of_known = np.maximum(of_known, _ratio(other, bins, around, tapers, options))
    above /= of_known
    best = int(np.argmax(above))
    if not above[best] > 1.0:
        return None
    k = int(bins[best])
    frequency = k / ((n + 1.0) * dt)
    of_input, of_residual = (_tapered(line, k, tapers) for line in (_line_spectrum(u), own))
    cross = abs(np.vdot(of_input, of_residual)) ** 2
    powers = float(np.vdot(of_input, of_input).real * np.vdot(of_residual, of_residual).real)
    critical_coherence = 1.0 - options.coherence_level ** (1.0 / (tapers - 1.0))
    return Peak(frequency, float(ratio[best]), bool(cross > critical_coherence * powers))


def _line_spectrum(x: Array) -> NDArray[np.complex128]:
    """Fourier transform of a signal, shape (2 samples + 2,): twice as fine as the frequencies that are tested.

    The sine taper of number k shifts it by k lines to both sides, so that it serves for all tapers.
    """
    padded = np.zeros(2 * len(x) + 2)
    padded[1 : len(x) + 1] = x - x.mean()
    return np.asarray(fft(padded))


def _tapered_power(line: NDArray[np.complex128], tapers: int) -> Array:
    """Mean power over the tapers at each frequency, up to half of the sampling frequency."""
    bins = len(line) // 4 + 1
    around = np.concatenate([line[-tapers:], line[: 2 * bins + tapers]])
    total = np.zeros(bins)
    for k in range(1, tapers + 1):
        low, high = (around[tapers + shift : tapers + shift + 2 * bins - 1 : 2] for shift in (-k, k))
        difference = low - high
        total += difference.real**2 + difference.imag**2
    return total / (tapers * len(line))


def _tapered(line: NDArray[np.complex128], k: int, tapers: int) -> NDArray[np.complex128]:
    """Fourier transforms of the tapered signal at frequency k, shape (tapers,)."""
    shifts = np.arange(1, tapers + 1)
    return np.asarray((line[2 * k - shifts] - line[(2 * k + shifts) % len(line)]) / np.sqrt(len(line)))


def _tested_bins(count: int, tapers: int, options: PeakOptions) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bins whose neighbourhood is wide enough and within the spectrum, and its bins to each side."""
    step = max(1, tapers // 4)
    bins = np.arange(tapers, count, step)
    around = (options.neighbourhood * bins).astype(np.int64)
    fits = (2 * around >= max(options.min_bins, 2 * tapers)) & (bins + around < count) & (bins - around >= tapers)
    return bins[fits], around[fits]


def _ratio(
    power: Array, bins: NDArray[np.int64], around: NDArray[np.int64], tapers: int, options: PeakOptions
) -> Array:
    """Power over the median of its neighbourhood, which is corrected to a mean."""
    steps = np.maximum(around // options.max_bins, 1)
    ends = zip(bins, around - around % steps, steps, strict=True)
    # A neighbourhood has an odd length, so that its median is one of its values; np.median takes ten times as long.
    middle = np.array([np.partition(power[k - w : k + w + 1 : step], w // step)[w // step] for k, w, step in ends])
    mean = middle * 2.0 * tapers / chi2.median(2.0 * tapers)
    return np.asarray(power[bins] / np.maximum(mean, np.finfo(float).tiny))
