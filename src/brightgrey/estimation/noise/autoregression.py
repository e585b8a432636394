"""Autoregressive models of coloured noise: estimation, autocovariance, and variances of weighted sums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft

from brightgrey.arrays import Array
from brightgrey.estimation.noise.orthonormal_basis import orthonormal_basis
from brightgrey.estimation.problem.segments import split_segments
from brightgrey.numerics.digital_filter import lfilter

__all__ = [
    "Autoregression",
    "NoiseModelOptions",
    "autoregression",
    "burg",
    "lag_sums",
    "levinson",
    "noise_models",
    "times_autocovariance",
]


@dataclass(frozen=True)
class _Policy:
    """Numbers of autoregressions."""

    #: Of a signal's power; a smaller innovation is rounding of a pure line.
    relative_variance_floor: float = 1e-14
    covariance_floor: float = 1e-12  #: The same, found from autocovariances, whose rounding it amplifies.
    direct_lags: int = 64  #: Up to so many lags, sums lag by lag are faster than a Fourier transform.
    lags_at_once: int = 2**16  #: Lags of a block of an autocovariance; a filter takes memory for them times the order.


POLICY = _Policy()


@dataclass(frozen=True)
class NoiseModelOptions:
    """Options of :func:`noise_models`."""

    #: Rounds that correct the autocovariance for what the fit has absorbed; the fourth changes it by less than 1 %.
    corrections: int = 5
    #: Largest logarithm by which each absorbed direction can have lowered the power of the noise along it. So many
    #: directions out of all samples cannot have changed the innovations by more: a larger change is rounding, which
    #: autocovariances of smooth noise amplify.
    absorbed_log_power: float = 20.0
    rank_tolerance: float = 1e-10  #: Singular values of the Jacobian below this part of the largest count as zero.


NOISE_MODEL_DEFAULTS = NoiseModelOptions()


@dataclass(frozen=True)
class Autoregression:
    """Noise model ``e[t] + a[1] e[t-1] + ... + a[p] e[t-p] = w[t]`` with white w."""

    a: tuple[float, ...]  #: The number 1 and the p coefficients.
    variance: float  #: Variance of w, in the squared unit of e.

    @property
    def order(self) -> int:
        """Order p; white noise has order 0."""
        return len(self.a) - 1

    def autocovariance(self, count: int) -> Array:
        """Autocovariance of e at lags 0 to ``count - 1`` (Yule-Walker equations; Kay 1988, section 6.3)."""
        a, p, predictors = np.array(self.a), self.order, self._predictors()
        power = self.variance / float(np.prod([share for _, share in predictors]))
        c = np.zeros(max(count, p + 1))
        c[0] = power
        for m in range(p):
            (lower, _), (higher, share) = predictors[m : m + 2]
            c[m + 1] = -higher[-1] * power - lower[1:] @ c[m:0:-1]
            power *= share
        for first in range(p + 1, count, POLICY.lags_at_once) if p else ():
            # Without noise a model goes on from its past: from rest, what this past adds later on is its input.
            past = np.convolve(a[1:], c[first - p : first])[p - 1 :]
            driven = np.zeros(max(min(POLICY.lags_at_once, count - first), p))
            driven[:p] = -past
            c[first : first + len(driven)] = lfilter([1.0], a, driven)[: count - first]
        return np.clip(c[:count], -c[0], c[0])  # rounding may pass the bound where a line hardly decays

    def _predictors(self) -> list[tuple[Array, float]]:
        """Coefficients of the best predictors of orders 0 to p, and the part of the variance that each order leaves.

        This is Levinson's recursion, downwards (Kay 1988, section 6.3).
        """
        a, found = np.array(self.a), []
        while len(a) > 1:
            left = max(1.0 - a[-1] ** 2, POLICY.relative_variance_floor)
            found.append((a, left))
            a = ((a - a[-1] * a[::-1]) / left)[:-1]
        return [(a, 1.0), *found[::-1]]

    def effective_samples_mean(self, samples: int) -> float:
        """Number of independent samples whose mean has the variance of the mean of `samples` of this noise.

        It is at most `samples`.
        """
        if self.variance == 0.0:
            return float(samples)
        at_frequency_zero = self.variance / sum(self.a) ** 2
        return float(min(samples * self.autocovariance(samples)[0] / at_frequency_zero, samples))

    def effective_samples_variance(self, samples: int) -> float:
        """Number of independent samples that give a variance with the same uncertainty as `samples` of this noise.

        It is ``samples / (1 + 2 sum of rho^2)`` with the autocorrelation rho.
        """
        c = self.autocovariance(samples)
        return samples / (1.0 + 2.0 * float(np.square(c[1:] / c[0]).sum())) if c[0] > 0.0 else float(samples)

    def variance_of_sums(self, g: Array) -> tuple[Array, Array]:
        """Variances of ``sum g e``, and their uncertainty if this model was estimated from as many samples.

        Parameters
        ----------
        g : ndarray, shape (samples, P)
            Weights g.

        Returns
        -------
        variance : ndarray, shape (P,)
        log_variance : ndarray, shape (P,)
            Variance of the logarithm of `variance`. The coefficients scatter with ``variance R^-1 / samples``, where R
            is the Toeplitz matrix of p autocovariances, and move the spectrum at the frequencies of g.
        """
        n = len(g)
        length = _fast_length(2 * n)
        response = rfft(self.a, length)
        share = np.abs(rfft(g, length, axis=0)) ** 2 / np.abs(response[:, None]) ** 2
        total = np.maximum(share.sum(axis=0), np.finfo(float).tiny)
        log_variance = np.full(g.shape[1], 2.0 / n)
        if self.order and self.variance > 0.0:
            slopes = -2.0 * _sums_over_frequencies(share / total / response[:, None], length)[1 : 1 + self.order]
            log_variance = log_variance + self._inverse_form(slopes) / n
        return total * self.variance * 2.0 / length, log_variance

    def _inverse_form(self, x: Array) -> Array:
        """Products x' R^-1 x, shape (P,), with the Toeplitz matrix R of p autocovariances at variance 1; x is (p, P).

        The predictors of all lower orders whiten what R colours. So the product is a sum of squares, which does not
        cancel where the noise is smooth.
        """
        *lower, (_, share) = self._predictors()
        total = np.zeros(x.shape[1])
        for a, of_lower in reversed(lower):
            total += share * (a[::-1] @ x[: len(a)]) ** 2
            share *= of_lower
        return total


def burg(x: Array, highest: int) -> list[Autoregression]:
    """Estimate autoregressions of orders 0 to `highest` by Burg's method (Burg 1975; Kay 1988, section 7.5).

    The list ends early at the order that leaves 1e-9 of the power: of a pure line, further orders would fit rounding.

    Parameters
    ----------
    x : ndarray, shape (samples,)
        Signal, longer than `highest`.
    highest : int
        Largest order.
    """
    forward, backward = np.array(x, float), np.array(x, float)
    a, variance = np.ones(1), float(np.mean(np.square(x)))
    found = [Autoregression((1.0,), variance)]
    for _ in range(highest):
        forward, backward = forward[1:], backward[:-1]
        size = float(forward @ forward + backward @ backward)
        reflection = -2.0 * float(forward @ backward) / size if size > 0.0 else 0.0
        least = min(POLICY.relative_variance_floor * found[0].variance / variance, 1.0) if variance > 0.0 else 1.0
        explained = 1.0 - reflection**2 <= least
        if explained:
            reflection = float(np.copysign(np.sqrt(1.0 - least), reflection))
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        forward, backward = forward + reflection * backward, backward + reflection * forward
        variance *= 1.0 - reflection**2
        found.append(Autoregression(tuple(a.tolist()), variance))
        if explained:
            break
    return found


def autoregression(x: Array) -> Autoregression:
    """Estimate the autoregression of `x` by Burg's method, of the order with the least corrected AIC.

    Orders go up to 10 log10(samples), at most a quarter of the samples (Hurvich and Tsai 1989,
    doi:10.1093/biomet/76.2.297).
    """
    n = len(x)
    found = burg(x, min(int(10.0 * np.log10(n)), n // 4))
    tiny = np.finfo(float).tiny
    scores = [n * np.log(max(m.variance, tiny)) + 2.0 * (m.order + 1) * n / (n - m.order - 2) for m in found]
    return found[int(np.argmin(scores))]


def levinson(c: Array) -> Autoregression | None:
    """Autoregression of order ``len(c) - 1`` with the autocovariances `c`, by the Levinson recursion.

    None if no stable one exists.
    """
    if not c[0] > 0.0:
        return None
    a, variance = np.ones(1), float(c[0])
    for m in range(1, len(c)):
        reflection = -float(a @ c[m:0:-1]) / variance
        if not variance * (1.0 - reflection**2) > POLICY.covariance_floor * c[0]:
            return None
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        variance *= 1.0 - reflection**2
    return Autoregression(tuple(a.tolist()), variance)


def _sums_over_frequencies(spectrum: Array, length: int) -> Array:
    """Real parts of ``sum spectrum exp(-i w k)`` for the delays k, over the frequencies w of a transform.

    Shapes (length / 2 + 1, P) and (length, P). An inverse transform counts all but the first and the last one twice.
    """
    ends = spectrum[:1].real + spectrum[-1:].real * np.cos(np.pi * np.arange(length))[:, None]
    return np.asarray(0.5 * (length * irfft(np.conj(spectrum), length, axis=0) + ends))


def _fast_length(samples: int) -> int:
    """Length of at least so many samples that a Fourier transform takes little time for: a power of two."""
    return 1 << (samples - 1).bit_length()


def times_autocovariance(c: Array, X: Array) -> Array:
    """Multiply X, shape (samples, P), by the Toeplitz matrix of the autocovariances c, shape (samples,)."""
    n = len(c)
    length = _fast_length(2 * n)
    ring = np.zeros(length)
    ring[:n] = c
    ring[length - n + 1 :] = c[:0:-1]
    spectrum, product = rfft(ring), np.empty_like(X)
    for p in range(X.shape[1]):  # one after another: a long recording with many columns would take too much memory
        product[:, p] = irfft(spectrum * rfft(X[:, p], length), length)[:n]
    return product


def lag_sums(X: Array, Y: Array, count: int) -> Array:
    """Sums ``sum_t sum_p X[t, p] Y[t + k, p]`` for lags k from 0 to ``count - 1``, shape (count,)."""
    n = len(X)
    if count <= POLICY.direct_lags:
        return np.array([np.einsum("tp,tp->", X[: n - k], Y[k:]) for k in range(count)])
    length = _fast_length(2 * n)
    product = np.conj(rfft(X, length, axis=0)) * rfft(Y, length, axis=0)
    return np.asarray(irfft(product.sum(axis=1), length)[:count])


def noise_models(
    residual: Array, jacobian: Array, lengths: Sequence[int], options: NoiseModelOptions = NOISE_MODEL_DEFAULTS
) -> tuple[Autoregression, ...]:
    """Model the noise of every segment as an autoregression, corrected for what the fit has absorbed.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
        Residual of a least-squares fit.
    jacobian : ndarray, shape (residuals, P)
        Derivatives of the residual by the estimated parameters.
    lengths : sequence of int
        Samples of each segment; residuals are correlated within a segment.
    options : NoiseModelOptions

    Notes
    -----
    Least squares leaves ``(1 - Q Q') e`` of the noise e, with Q an orthonormal basis of the Jacobian. Slow columns
    absorb slow noise, so that residuals look whiter than the noise is. The expected sums of lagged products follow from
    the autocovariance of the noise. So Burg's autocovariance is corrected by the difference and estimated again,
    several times (the mean-corrected autocovariance of Kendall 1954, doi:10.1093/biomet/41.3-4.403).
    """
    parts = split_segments(residual[:, None], lengths)
    models = [autoregression(part[:, 0]) for part in parts]
    bases = split_segments(orthonormal_basis(jacobian, options.rank_tolerance), lengths)
    if not bases[0].shape[1]:
        return tuple(models)
    sums = [lag_sums(part, part, m.order + 1) for part, m in zip(parts, models, strict=True)]
    limits = [
        m.variance * np.exp(options.absorbed_log_power * Q.shape[1] / len(Q))
        for m, Q in zip(models, bases, strict=True)
    ]
    for _ in range(options.corrections):
        coloured = [times_autocovariance(m.autocovariance(len(Q)), Q) for m, Q in zip(models, bases, strict=True)]
        inner = np.sum([Q.T @ W for Q, W in zip(bases, coloured, strict=True)], axis=0)
        for i, (Q, W, observed) in enumerate(zip(bases, coloured, sums, strict=True)):
            count = len(observed)
            absorbed = lag_sums(Q, W - Q @ inner, count) + lag_sums(W, Q, count)
            corrected = levinson((observed + absorbed) / (len(Q) - np.arange(count)))
            if corrected is not None and corrected.variance <= limits[i]:
                models[i] = corrected
    return tuple(models)
