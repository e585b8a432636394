"""Covariance of least-squares estimates whose residuals are coloured.

Residuals of a simulation follow the errors of the model slowly, and the usual ``sigma^2 (J'J)^-1`` is far too small.
Here the noise of every segment (one output of one recording) is an autoregression. The covariance of the estimate is
the sandwich ``H^-1 J' Gamma J H^-1`` with H = J'J and the autocovariance Gamma of the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import Autoregression, noise_models, times_autocovariance
from brightgrey.estimation.noise.residual_analysis import CONFIDENCE
from brightgrey.estimation.problem.segments import split_segments
from brightgrey.numerics.distributions import t as student

__all__ = ["CovarianceEstimate", "gradient_covariance", "sandwich_covariance"]


class CovarianceEstimate(NamedTuple):
    """Covariance of an estimate."""

    covariance: Array  #: Shape (P, P).
    #: Degrees of freedom of the standard deviations. The spectrum of the noise is uncertain at the frequencies to
    #: which a parameter is sensitive. Shape (P,).
    degrees: Array

    @property
    def quantile(self) -> Array:
        """Half width of the 95 % intervals in standard deviations (Student), shape (P,)."""
        return np.asarray(student.ppf(0.5 + 0.5 * CONFIDENCE, self.degrees))

    @property
    def std(self) -> Array:
        """Standard deviations, shape (P,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def sandwich_covariance(residual: Array, jacobian: Array, lengths: Sequence[int]) -> CovarianceEstimate:
    """Covariance of a least-squares estimate with coloured residuals, and its degrees of freedom.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
    jacobian : ndarray, shape (residuals, P)
    lengths : sequence of int
        Samples of each segment; residuals are correlated within a segment.

    Notes
    -----
    The logarithm of a variance with ``degrees`` degrees of freedom has the variance ``2/degrees`` (Satterthwaite 1946,
    doi:10.2307/3002019).
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    J = jacobian / scale
    models = noise_models(residual, J, lengths)
    meat = gradient_covariance(models, J, lengths)
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-13, hermitian=True)  # J'J is exact to about 1e-16
    parts = zip(models, split_segments(J, lengths), strict=True)
    uncertain = [model.variance_of_sums(part @ inverse) for model, part in parts]
    variance = np.sum([v for v, _ in uncertain], axis=0)
    variance = np.where(variance > 0.0, variance, 1.0)
    log_variance = np.sum([(v / variance) ** 2 * d for v, d in uncertain], axis=0)
    degrees = np.maximum(2.0 / np.maximum(log_variance, np.finfo(float).tiny), 1.0)
    return CovarianceEstimate(np.asarray(inverse @ meat @ inverse / np.outer(scale, scale)), degrees)


def gradient_covariance(models: Sequence[Autoregression], jacobian: Array, lengths: Sequence[int]) -> Array:
    """Covariance of the gradient ``J' e``, shape (P, P).

    Parameters
    ----------
    models : sequence of Autoregression
        Noise of each segment.
    jacobian : ndarray, shape (residuals, P)
    lengths : sequence of int
        Samples of each segment.
    """
    total = np.zeros((jacobian.shape[1], jacobian.shape[1]))
    for model, part in zip(models, split_segments(jacobian, lengths), strict=True):
        total += part.T @ times_autocovariance(model.autocovariance(len(part)), part)
    return total
