"""What residuals tell: whether they are white, and whether they still hang together with the input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.errors import SettingsError
from brightgrey.estimation.noise.autoregression import autoregression, lag_sums
from brightgrey.numerics.distributions import chi2, norm

__all__ = ["LAGS", "Residuals", "residual_analysis"]

LAGS = 50
"""Largest lag that is looked at."""
_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Residuals:
    """Analysis of the residuals of one output of one recording; nothing in it has a unit but time in samples.

    Attributes
    ----------
    autocorrelation : tuple of float
        At lags 0 to ``len - 1``.
    band : float
        White residuals stay within plus and minus this at 95 % of the lags.
    cross_correlation : tuple of float
        With the input, at lags ``-(len // 2)`` to ``len // 2``; a positive lag is the input's past.
    cross_band : float
        Residuals of their colour that do not depend on the input stay within it at 95 % of the lags.
    ljung_box : float
        Chance that white residuals are as correlated as these (Ljung and Box 1978, doi:10.1093/biomet/65.2.297).
    effective : float
        Number of independent samples whose mean is as sure as theirs.
    """

    autocorrelation: tuple[float, ...]
    band: float
    cross_correlation: tuple[float, ...]
    cross_band: float
    ljung_box: float
    effective: float

    @property
    def white(self) -> bool:
        """Whether nothing speaks against white residuals (5 %)."""
        return self.ljung_box > 1.0 - _CONFIDENCE

    @property
    def follows_input(self) -> bool:
        """Whether more lags of the cross-correlation leave their band than chance makes (Bonferroni, 5 %)."""
        lags = len(self.cross_correlation)
        wider = norm.isf(0.5 * (1.0 - _CONFIDENCE) / lags) / norm.isf(0.5 * (1.0 - _CONFIDENCE))
        return bool(np.max(np.abs(self.cross_correlation)) > wider * self.cross_band)


def residual_analysis(residual: ArrayLike, u: ArrayLike, *, lags: int = LAGS) -> Residuals:
    """Correlations of a residual with itself and with the input.

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
        For shapes that do not fit, or lags that are too many.

    Notes
    -----
    The band of the cross-correlation is Bartlett's: its variance is the sum of the products of both
    autocorrelations over all lags, over the samples (Box, Jenkins, Time Series Analysis, section 11.1); the
    autocorrelations are those of autoregressions.
    """
    e, x = np.asarray(residual, float), np.asarray(u, float)
    n = len(e)
    if e.ndim != 1 or e.shape != x.shape:
        raise SettingsError(f"residual {e.shape} and input {x.shape} do not fit together")
    if not 1 <= lags < n / 4:
        raise SettingsError(f"lags is {lags}; from 1 to less than a quarter of {n} samples are possible")
    e, x = e - e.mean(), x - x.mean()
    own, size = lag_sums(e[:, None], e[:, None], lags + 1), float(np.sqrt((e @ e) * (x @ x)))
    rho = own / own[0] if own[0] > 0.0 else np.eye(lags + 1)[0]
    cross = np.zeros(2 * lags + 1)
    if size > 0.0:
        later = lag_sums(x[:, None], e[:, None], lags + 1)
        before = lag_sums(e[:, None], x[:, None], lags + 1)
        cross = np.concatenate([before[:0:-1], later]) / size
    colours = [autoregression(signal).autocovariance(n) if signal.any() else np.eye(n)[0] for signal in (e, x)]
    together = np.prod([c / c[0] for c in colours], axis=0)
    variance = max(float(together[0] + 2.0 * together[1:].sum()), 1.0) / n
    z = float(norm.isf(0.5 * (1.0 - _CONFIDENCE)))
    statistic = n * (n + 2.0) * float(np.sum(rho[1:] ** 2 / (n - np.arange(1, lags + 1))))
    return Residuals(
        autocorrelation=tuple(rho.tolist()),
        band=z / float(np.sqrt(n)),
        cross_correlation=tuple(cross.tolist()),
        cross_band=z * float(np.sqrt(variance)),
        ljung_box=float(chi2.sf(statistic, lags)),
        effective=autoregression(e).effective_samples_mean(n),
    )
