"""Linear regression with coloured residuals: coefficients, standard errors, and independent samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array

__all__ = ["Regression", "independent_samples", "regress", "regress_whitened"]


@dataclass(frozen=True)
class Regression:
    """Result of `regress`."""

    coefficients: Array  #: Shape (terms,).
    std: Array  #: Standard errors, shape (terms,).
    residual: Array  #: Shape (samples,).
    explained: float  #: Part of the variance of the regressed signal, at most 1.
    samples: float  #: Independent samples of the residual.

    def deviations(self, term: int) -> float:
        """Coefficient of a term over its standard error."""
        return float(self.coefficients[term] / self.std[term]) if self.std[term] > 0.0 else 0.0


def regress(y: Array, terms: Array) -> Regression:
    """Regress a signal on terms.

    Parameters
    ----------
    y : ndarray, shape (samples,)
    terms : ndarray, shape (samples, terms)
        Linearly dependent ones share their coefficient and get large standard errors.

    Returns
    -------
    Regression
        Its standard errors count independent samples of the residual instead of samples.
    """
    scale = np.linalg.norm(terms, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    u, s, vt = np.linalg.svd(terms / scale, full_matrices=False)
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s > 1e-10 * s.max(initial=0.0))
    coefficients = vt.T @ (inverse * (u.T @ y))
    residual = y - (terms / scale) @ coefficients
    samples = independent_samples(residual)
    degrees = max(samples - terms.shape[1], 1.0)
    variance = float(residual @ residual) / residual.size * samples / degrees
    # With n independent samples among N, the information is n/N of what N independent ones would hold.
    std = np.sqrt(variance * residual.size / samples * np.square(vt.T * inverse).sum(axis=1))
    total = float(np.square(y - y.mean()).sum())
    explained = 1.0 - float(residual @ residual) / total if total > 0.0 else 0.0
    return Regression(coefficients / scale, std / scale, residual, explained, samples)


def regress_whitened(y: Array, terms: Array, order: int = 12, rounds: int = 2) -> Regression:
    """Regress a signal on terms after both have been whitened by an autoregression of the residual.

    Feasible generalised least squares (Cochrane, Orcutt 1949, doi:10.1080/01621459.1949.10483290). Arguments and result
    are those of `regress`, but for the residual, which is white, and the part of the variance that is explained.
    """
    found = regress(y, terms)
    residual = found.residual
    for _ in range(rounds):
        if y.size < 4 * order or not residual.any():
            break
        past = np.lib.stride_tricks.sliding_window_view(residual, order)[:-1, ::-1]
        a = np.linalg.lstsq(past, residual[order:], rcond=None)[0]
        white = [np.convolve(x, np.r_[1.0, -a], mode="valid") for x in (y, *terms.T)]
        found = regress(white[0], np.column_stack(white[1:]))
        residual = y - terms @ found.coefficients
    return found


def independent_samples(x: Array) -> float:
    """Number of independent samples that tell as much of a mean as these correlated ones.

    It is the number of samples over the sum of the autocorrelation up to its first zero (Bartlett 1946,
    doi:10.2307/2983611).
    """
    x = x - x.mean()
    power = float(x @ x)
    if power == 0.0 or x.size < 4:
        return float(x.size)
    spectrum = np.abs(np.fft.rfft(x, 2 * x.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: x.size] / power
    below = np.flatnonzero(correlation <= 0.0)
    until = int(below[0]) if below.size else x.size
    return max(float(x.size) / (1.0 + 2.0 * float(correlation[1:until].sum())), 2.0)
