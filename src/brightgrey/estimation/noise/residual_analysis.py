"""Analysis of residuals: fit percent, autocorrelation, whiteness, and correlation with the input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.arrays import Array, positive
from brightgrey.errors import SettingsError
from brightgrey.estimation.noise.autoregression import autoregression, lag_sums
from brightgrey.estimation.problem.segments import split_segments
from brightgrey.numerics.distributions import chi2, norm

__all__ = [
    "CONFIDENCE",
    "LAGS",
    "Residuals",
    "WhitenessTest",
    "autocorrelation",
    "is_white",
    "ljung_box",
    "nrmse_fit_percent",
    "residual_analysis",
]

LAGS = 50
"""Largest lag of the analysis, in samples."""
CONFIDENCE = 0.95
"""Probability of all intervals and bands (``ci95``)."""


@dataclass(frozen=True)
class WhitenessTest:
    """Test that ends a search when nothing is left to explain."""

    lags: int = 25  #: Largest lag of the autocorrelation, in samples.
    #: Ljung-Box statistic that white residuals exceed once in 500 (chi-squared with 25 degrees of freedom).
    critical_value: float = 50.0


WHITENESS_TEST = WhitenessTest()


@dataclass(frozen=True)
class Residuals:
    """Analysis of the residuals of one output of one recording; all is dimensionless, times are in samples.

    Attributes
    ----------
    autocorrelation : tuple of float
        At lags 0 to ``len - 1``.
    band : float
        White residuals stay within plus and minus this at 95 % of the lags.
    cross_correlation : tuple of float
        With the input, at lags ``-(len // 2)`` to ``len // 2``; a positive lag is the input's past.
    cross_band : float
        Residuals of this colour that do not depend on the input stay within it at 95 % of the lags.
    ljung_box : float
        Probability that white residuals are as correlated as these (Ljung and Box 1978, doi:10.1093/biomet/65.2.297).
    effective_samples : float
        Number of independent samples whose mean has the same variance.
    """

    autocorrelation: tuple[float, ...]
    band: float
    cross_correlation: tuple[float, ...]
    cross_band: float
    ljung_box: float
    effective_samples: float

    @property
    def white(self) -> bool:
        """True if the Ljung-Box test does not reject white residuals (5 %)."""
        return self.ljung_box > 1.0 - CONFIDENCE

    @property
    def follows_input(self) -> bool:
        """True if the cross-correlation leaves its band at more lags than chance explains (Bonferroni, 5 %)."""
        lags = len(self.cross_correlation)
        wider = norm.isf(0.5 * (1.0 - CONFIDENCE) / lags) / norm.isf(0.5 * (1.0 - CONFIDENCE))
        return bool(np.max(np.abs(self.cross_correlation)) > wider * self.cross_band)


def residual_analysis(residual: ArrayLike, u: ArrayLike, *, lags: int = LAGS) -> Residuals:
    """Correlate a residual with itself and with the input.

    Parameters
    ----------
    residual : array_like, shape (samples,)
    u : array_like, shape (samples,)
        Input; a constant one correlates with nothing.
    lags : int
        Largest lag, less than a quarter of the samples.

    Returns
    -------
    Residuals

    Raises
    ------
    SettingsError
        If the shapes do not fit, or there are too many lags.

    Notes
    -----
    The band of the cross-correlation is Bartlett's: its variance is the sum of the products of both
    autocorrelations over all lags, divided by the samples (Box, Jenkins, Time Series Analysis, section 11.1). The
    autocorrelations are those of autoregressions.
    """
    e, x = np.asarray(residual, float), np.asarray(u, float)
    n = len(e)
    if e.ndim != 1 or e.shape != x.shape:
        raise SettingsError(f"residual {e.shape} and input {x.shape} do not fit together")
    if not 1 <= lags < n / 4:
        raise SettingsError(f"lags is {lags}; from 1 to less than a quarter of {n} samples are possible")
    e, x = e - e.mean(), x - x.mean()
    rho = autocorrelation(e, lags)
    colours = [autoregression(signal).autocovariance(n) if signal.any() else np.eye(n)[0] for signal in (e, x)]
    products = np.prod([c / c[0] for c in colours], axis=0)
    variance = max(float(products[0] + 2.0 * products[1:].sum()), 1.0) / n
    z = float(norm.isf(0.5 * (1.0 - CONFIDENCE)))
    return Residuals(
        autocorrelation=tuple(rho.tolist()),
        band=z / float(np.sqrt(n)),
        cross_correlation=tuple(_cross_correlation(e, x, lags).tolist()),
        cross_band=z * float(np.sqrt(variance)),
        ljung_box=float(chi2.sf(ljung_box(rho, n), lags)),
        effective_samples=autoregression(e).effective_samples_mean(n),
    )


def nrmse_fit_percent(rss: float, total: float) -> float:
    """Fit in percent by the normalised root mean square error: ``100 (1 - sqrt(rss / total))``.

    Parameters
    ----------
    rss : float
        Residual sum of squares.
    total : float
        Sum of squares of the output about its mean.
    """
    return float(100.0 * (1.0 - np.sqrt(rss / positive(total))))


def autocorrelation(x: Array, lags: int) -> Array:
    """Autocorrelation of `x`, shape (samples,), at lags 0 to `lags`; zero at all lags but 0 for a signal of zeros."""
    sums = lag_sums(x[:, None], x[:, None], lags + 1)
    return np.asarray(sums / sums[0] if sums[0] > 0.0 else np.eye(lags + 1)[0])


def ljung_box(rho: Array, samples: int) -> float:
    """Ljung-Box statistic of an autocorrelation at lags 0 to ``len(rho) - 1`` (doi:10.1093/biomet/65.2.297)."""
    return samples * (samples + 2.0) * float(np.sum(rho[1:] ** 2 / (samples - np.arange(1, len(rho)))))


def is_white(residual: Array, lengths: Sequence[int], test: WhitenessTest = WHITENESS_TEST) -> bool:
    """Test residuals for whiteness: no segment is autocorrelated by the Ljung-Box test.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
    lengths : sequence of int
        Samples of each segment (one output of one recording); rows beyond these, such as prior knowledge, do not count.
    test : WhitenessTest
    """
    return not any(
        ljung_box(autocorrelation(part, min(test.lags, len(part) // 4)), len(part)) > test.critical_value
        for part in split_segments(residual[: sum(lengths)], lengths)
    )


def _cross_correlation(e: Array, x: Array, lags: int) -> Array:
    """Correlation of a residual with the input at lags from ``-lags`` to `lags`, shape (2 lags + 1,)."""
    size = float(np.sqrt((e @ e) * (x @ x)))
    if not size > 0.0:
        return np.zeros(2 * lags + 1)
    past = lag_sums(x[:, None], e[:, None], lags + 1)
    future = lag_sums(e[:, None], x[:, None], lags + 1)
    return np.asarray(np.concatenate([future[:0:-1], past]) / size)
