"""Coloured noise as an autoregression: orders, coefficients, autocovariance, and products with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz

from brightgrey.arrays import Array

__all__ = ["Autoregression", "autoregression", "burg", "lag_sums", "levinson", "times_autocovariance"]

_RIDGE = 1e-9  # what no model explains of a signal's power: below it are the digits of a pure line, and poles of size 1
_FEW = 64  # lags that are summed faster one by one
_ROOM = 8  # the autocovariance is taken from a spectrum of so many times the length: what wraps around has decayed


@dataclass(frozen=True)
class Autoregression:
    """``e[t] + a[1] e[t-1] + ... + a[p] e[t-p] = w[t]`` with white w.

    Attributes
    ----------
    a : tuple of float
        1 and the p coefficients.
    variance : float
        Of w.
    """

    a: tuple[float, ...]
    variance: float

    @property
    def order(self) -> int:
        """Order p; 0 is white noise."""
        return len(self.a) - 1

    def autocovariance(self, count: int) -> Array:
        """Autocovariance of e at lags 0 to ``count - 1``."""
        length = next_fast_len(_ROOM * count, real=True)
        spectrum = self.variance / np.abs(rfft(self.a, length)) ** 2
        return np.asarray(irfft(spectrum, length)[:count])

    def effective_samples_mean(self, samples: int) -> float:
        """Number of independent samples whose mean is as sure as that of `samples` of this noise, at most those."""
        if self.variance == 0.0:
            return float(samples)
        longest = self.variance / sum(self.a) ** 2
        return float(min(samples * self.autocovariance(samples)[0] / longest, samples))

    def effective_samples_variance(self, samples: int) -> float:
        """Number of independent samples that tell a variance as well: ``samples / (1 + 2 sum of rho^2)``."""
        c = self.autocovariance(samples)
        return samples / (1.0 + 2.0 * float(np.square(c[1:] / c[0]).sum())) if c[0] > 0.0 else float(samples)

    def variance_of_sums(self, g: Array) -> tuple[Array, Array]:
        """Variances of ``sum g e`` and how uncertain they are if this model was estimated from as many samples.

        Parameters
        ----------
        g : ndarray, shape (samples, P)
            Weights.

        Returns
        -------
        variance : ndarray, shape (P,)
        doubt : ndarray, shape (P,)
            Variance of the variance's logarithm: the coefficients scatter with ``variance R^-1 / samples`` (R is
            the Toeplitz matrix of p autocovariances) and move the spectrum at the frequencies that g weighs.
        """
        n = len(g)
        length = next_fast_len(2 * n, real=True)
        response = rfft(self.a, length)
        share = np.abs(rfft(g, length, axis=0)) ** 2 / np.abs(response[:, None]) ** 2
        total = np.maximum(share.sum(axis=0), np.finfo(float).tiny)
        doubt = np.full(g.shape[1], 2.0 / n)
        if self.order and self.variance > 0.0:
            turns = np.exp(-2j * np.pi * np.arange(len(response)) / length)[:, None] ** np.arange(1, self.order + 1)
            slopes = -2.0 * (turns / response[:, None]).real.T @ (share / total)
            column = self.autocovariance(n)[: self.order] / self.variance
            column[0] *= 1.0 + _RIDGE
            inverse = solve_toeplitz(column, slopes)
            doubt = doubt + np.maximum(np.sum(slopes * inverse, axis=0), 0.0) / n
        return total * self.variance * 2.0 / length, doubt


def burg(x: Array, highest: int) -> list[Autoregression]:
    """Autoregressions of orders 0 to `highest` by Burg's method (Burg 1975; Kay 1988, section 7.5).

    They end at the order that leaves 1e-9 of the power: of a line or a ramp further ones tell rounding only.

    Parameters
    ----------
    x : ndarray, shape (samples,)
        Longer than `highest`.
    highest : int
    """
    forward, backward = np.array(x, float), np.array(x, float)
    a, variance = np.ones(1), float(np.mean(np.square(x)))
    found = [Autoregression((1.0,), variance)]
    for _ in range(highest):
        forward, backward = forward[1:], backward[:-1]
        size = float(forward @ forward + backward @ backward)
        reflection = -2.0 * float(forward @ backward) / size if size > 0.0 else 0.0
        least = min(_RIDGE * found[0].variance / variance, 1.0) if variance > 0.0 else 1.0
        whole = 1.0 - reflection**2 <= least
        if whole:
            reflection = float(np.copysign(np.sqrt(1.0 - least), reflection))
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        forward, backward = forward + reflection * backward, backward + reflection * forward
        variance *= 1.0 - reflection**2
        found.append(Autoregression(tuple(a.tolist()), variance))
        if whole:
            break
    return found


def autoregression(x: Array) -> Autoregression:
    """Autoregression of `x` by Burg's method, of the order with the least corrected AIC.

    (Hurvich and Tsai 1989, doi:10.1093/biomet/76.2.297.) Orders go up to 10 log10(samples), at most a quarter of them.
    """
    n = len(x)
    found = burg(x, min(int(10.0 * np.log10(n)), n // 4))
    tiny = np.finfo(float).tiny
    scores = [n * np.log(max(m.variance, tiny)) + 2.0 * (m.order + 1) * n / (n - m.order - 2) for m in found]
    return found[int(np.argmin(scores))]


def levinson(c: Array) -> Autoregression | None:
    """Autoregression of order ``len(c) - 1`` with the autocovariances `c`; None if there is none that is stable."""
    if not c[0] > 0.0:
        return None
    a, variance = np.ones(1), float(c[0])
    for m in range(1, len(c)):
        reflection = -float(a @ c[m:0:-1]) / variance
        if not variance * (1.0 - reflection**2) > _RIDGE * c[0]:
            return None
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        variance *= 1.0 - reflection**2
    return Autoregression(tuple(a.tolist()), variance)


def times_autocovariance(c: Array, X: Array) -> Array:
    """Gamma X, shape as X (samples, P), for the Toeplitz matrix Gamma of the autocovariances c, shape (samples,)."""
    n = len(c)
    length = next_fast_len(2 * n, real=True)
    ring = np.zeros(length)
    ring[:n] = c
    ring[length - n + 1 :] = c[:0:-1]
    product = irfft(rfft(ring)[:, None] * rfft(X, length, axis=0), length, axis=0)
    return np.asarray(product[:n])


def lag_sums(X: Array, Y: Array, count: int) -> Array:
    """``sum_t sum_p X[t, p] Y[t + k, p]`` for lags k from 0 to ``count - 1``."""
    n = len(X)
    if count <= _FEW:
        return np.array([np.einsum("tp,tp->", X[: n - k], Y[k:]) for k in range(count)])
    length = next_fast_len(2 * n, real=True)
    product = np.conj(rfft(X, length, axis=0)) * rfft(Y, length, axis=0)
    return np.asarray(irfft(product.sum(axis=1), length)[:count])
