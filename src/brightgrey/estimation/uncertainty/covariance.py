"""How sure the parameters are, with residuals that are not white.

Simulation-error residuals follow the model's errors slowly; the usual ``sigma^2 (J'J)^-1`` is then far too sure of
itself. Here the noise of every stretch (one output of one recording) is an autoregression, and the covariance of the
least-squares estimate is the sandwich ``H^-1 J' Gamma J H^-1`` with H = J'J and its autocovariance Gamma.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import (
    Autoregression,
    autoregression,
    lag_sums,
    levinson,
    times_autocovariance,
)
from brightgrey.numerics.distributions import t as student

__all__ = ["CovarianceEstimate", "gradient_covariance", "noise_models", "sandwich_covariance", "weakest"]

_CORRECTIONS = 5  # rounds in which the noise is freed from what the fit took; the fourth changes less than 1 %
_RANK = 1e-10  # singular values below this part of the largest are none
_CONFIDENCE = 0.95


class CovarianceEstimate(NamedTuple):
    """Covariance of an estimate.

    Attributes
    ----------
    covariance : ndarray, shape (P, P)
    degrees : ndarray, shape (P,)
        Degrees of freedom of the standard deviations: the noise's spectrum, where a parameter is sensitive to it,
        is itself uncertain.
    """

    covariance: Array
    degrees: Array

    @property
    def quantile(self) -> Array:
        """How many standard deviations the 95 % intervals reach to each side (Student), shape (P,)."""
        return np.asarray(student.ppf(0.5 + 0.5 * _CONFIDENCE, self.degrees))


def sandwich_covariance(residual: Array, jacobian: Array, lengths: Sequence[int]) -> CovarianceEstimate:
    """Covariance of a least-squares estimate with coloured residuals, and its degrees of freedom.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
    jacobian : ndarray, shape (residuals, P)
    lengths : sequence of int
        Lengths of the stretches (one per recording and output) that residuals are correlated within.

    Notes
    -----
    A variance with ``degrees`` degrees of freedom has a logarithm that scatters with ``2/degrees`` (Satterthwaite 1946,
    doi:10.2307/3002019).
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    J = jacobian / scale
    models = noise_models(residual, J, lengths)
    meat = gradient_covariance(models, J, lengths)
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-13, hermitian=True)
    result = inverse @ meat @ inverse
    parts = [model.variance_of_sums(part @ inverse) for model, part in zip(models, _cut(J, lengths), strict=True)]
    variance = np.sum([v for v, _ in parts], axis=0)
    variance = np.where(variance > 0.0, variance, 1.0)
    doubt = np.sum([(v / variance) ** 2 * d for v, d in parts], axis=0)
    sizes = np.outer(scale, scale)
    degrees = np.maximum(2.0 / np.maximum(doubt, np.finfo(float).tiny), 1.0)
    return CovarianceEstimate(np.asarray(result / sizes), degrees)


def gradient_covariance(models: Sequence[Autoregression], jacobian: Array, lengths: Sequence[int]) -> Array:
    """Covariance of the gradient ``J' e``, shape (P, P), for the noise of every stretch; `jacobian` as in `spread`."""
    total = np.zeros((jacobian.shape[1], jacobian.shape[1]))
    for model, part in zip(models, _cut(jacobian, lengths), strict=True):
        total += part.T @ times_autocovariance(model.autocovariance(len(part)), part)
    return total


def noise_models(residual: Array, jacobian: Array, lengths: Sequence[int]) -> tuple[Autoregression, ...]:
    """Noise of every stretch as an autoregression, freed from what the fit of the parameters has taken away.

    Least squares leaves ``(1 - Q Q') e`` of the noise e, with Q a base of the Jacobian: slow noise is taken by slow
    columns, and the residuals look whiter than the noise is. Their expected sums of lagged products follow from the
    noise's autocovariance, so the autocovariance is corrected by the difference and estimated again, from Burg's
    on, until it stays (the mean-corrected autocovariance of Kendall 1954, doi:10.1093/biomet/41.3-4.403, for any
    regression).

    Parameters
    ----------
    residual, jacobian, lengths
        As in :func:`spread`.
    """
    pieces = _cut(residual[:, None], lengths)
    models = [autoregression(piece[:, 0]) for piece in pieces]
    bases = _cut(_base(jacobian), lengths)
    if not bases[0].shape[1]:
        return tuple(models)
    sums = [lag_sums(piece, piece, m.order + 1) for piece, m in zip(pieces, models, strict=True)]
    for _ in range(_CORRECTIONS):
        coloured = [times_autocovariance(m.autocovariance(len(Q)), Q) for m, Q in zip(models, bases, strict=True)]
        inner = np.sum([Q.T @ W for Q, W in zip(bases, coloured, strict=True)], axis=0)
        for i, (Q, W, seen) in enumerate(zip(bases, coloured, sums, strict=True)):
            count = len(seen)
            taken = lag_sums(Q, W - Q @ inner, count) + lag_sums(W, Q, count)
            corrected = levinson((seen + taken) / (len(Q) - np.arange(count)))
            models[i] = corrected or models[i]
    return tuple(models)


def _base(jacobian: Array) -> Array:
    """Orthonormal base of the Jacobian's columns, shape (residuals, rank)."""
    scale = np.linalg.norm(jacobian, axis=0)
    shown = scale > 0.0
    if not shown.any():
        return np.zeros((len(jacobian), 0))
    U, s, _ = np.linalg.svd(jacobian[:, shown] / scale[shown], full_matrices=False)
    return np.asarray(U[:, s > _RANK * s[0]])


def _cut(rows: Array, lengths: Sequence[int]) -> list[Array]:
    return np.split(rows, np.cumsum(lengths)[:-1])


def weakest(jacobian: Array) -> tuple[float, Array]:
    """Condition number of the Jacobian with normed columns, and the direction it shows least, shape (P,)."""
    if jacobian.shape[1] == 0:
        return 1.0, np.zeros(0)
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.all(scale > 0.0):
        return np.inf, (scale == 0.0).astype(float)
    _, s, v = np.linalg.svd(jacobian / scale, full_matrices=False)
    return float(s[0] / max(s[-1], 1e-300)), np.asarray(v[-1])
