"""Whitening of coloured residuals, and generalised least squares with it.

Residuals of a simulation are coloured, so sums of their squares mislead. The noise of every segment (one output of one
recording) is modelled as an autoregression. Its filter makes residuals and derivatives white; least squares on them is
generalised least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import Autoregression, levinson, noise_models
from brightgrey.estimation.noise.orthonormal_basis import BASIS_RANK_TOLERANCE, orthonormal_basis
from brightgrey.estimation.problem.segments import split_segments
from brightgrey.numerics.digital_filter import lfilter

__all__ = ["Whitening", "whiten"]


def whiten(x: Array, models: Sequence[Autoregression], lengths: Sequence[int]) -> Array:
    """Filter every segment with its noise model, so that the noise becomes white with variance 1.

    The first samples of a segment, as many as the order of the model, become zero. What came before them is unknown,
    and in smooth noise an error of the initial state would outweigh all that follows.

    Parameters
    ----------
    x : ndarray, shape (residuals, ...)
    models : sequence of Autoregression
        One per segment.
    lengths : sequence of int
        Samples of each segment.
    """
    parts = []
    for model, part in zip(models, split_segments(x, lengths), strict=True):
        white = lfilter(model.a, [1.0], part, axis=0) / np.sqrt(max(model.variance, np.finfo(float).tiny))
        white[: model.order] = 0.0
        parts.append(white)
    return np.asarray(np.concatenate(parts))


@dataclass(frozen=True)
class Whitening:
    """Filters that make the noise of every segment white with variance 1."""

    models: tuple[Autoregression, ...]  #: Noise of each segment, the error floor included.
    lengths: tuple[int, ...]  #: Samples of each segment.
    #: Variance of the errors of simulation and sensor in each segment. They are independent of the noise. As far as
    #: they are smaller than it they have its colour, since both pass through the drive; the rest is white.
    error_floor: tuple[float, ...]
    floor_deviance: float = 0.0  #: Expected sum of squares of the whitened errors of simulation and sensor.

    @classmethod
    def of(
        cls, residual: Array, jacobian: Array, lengths: Sequence[int], error_floor: Sequence[float] | None = None
    ) -> Whitening:
        """Filters from the residual of a model that fits well.

        Parameters
        ----------
        residual : ndarray, shape (residuals,)
        jacobian : ndarray, shape (residuals, P)
            By the parameters that are estimated and not at a bound.
        lengths : sequence of int
            Samples of each segment.
        error_floor : sequence of float, optional
            Variance of simulation and sensor errors in each segment; 0 by default.
        """
        floor = (0.0,) * len(lengths) if error_floor is None else tuple(error_floor)
        models = noise_models(residual, jacobian, lengths)
        sizes = [float(np.mean(np.square(part))) for part in split_segments(residual, lengths)]
        found = [_with_floor(m, size, v) for m, size, v in zip(models, sizes, floor, strict=True)]
        deviance = sum(n * share for n, (_, share) in zip(lengths, found, strict=True))
        return cls(tuple(m for m, _ in found), tuple(lengths), floor, deviance)

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return sum(self.lengths)

    @cached_property
    def effective_samples(self) -> float:
        """Number of independent samples that give the variance with the same uncertainty as the residuals do."""
        return sum(model.effective_samples_variance(n) for model, n in zip(self.models, self.lengths, strict=True))

    @cached_property
    def floor_cost(self) -> float:
        """Expected sum of squares of the errors of simulation and sensor, not whitened."""
        return sum(n * variance for n, variance in zip(self.lengths, self.error_floor, strict=True))

    def whiten(self, x: Array) -> Array:
        """Whitened residuals or derivatives, shape (residuals, ...)."""
        return whiten(x, self.models, self.lengths)

    def basis(self, jacobian: Array) -> Array:
        """Orthonormal basis of the whitened Jacobian, shape (residuals, rank)."""
        return orthonormal_basis(self.whiten(jacobian)) if jacobian.shape[1] else np.zeros((len(jacobian), 0))

    def gls_rss(self, residual: Array, jacobian: Array) -> float:
        """Whitened residual sum of squares after one Gauss-Newton step, with the share of the error floor added.

        Parameters
        ----------
        residual : ndarray, shape (residuals,)
        jacobian : ndarray, shape (residuals, P)
            By the parameters that may move in that step.
        """
        r, Q = self.whiten(residual), self.basis(jacobian)
        return float(max(r @ r - np.square(Q.T @ r).sum(), 0.0)) + self.floor_deviance

    def explain(self, jacobian: Array, change: Array) -> tuple[float, Array]:
        """Explain a change of the weighted outputs by steps of the parameters, by generalised least squares.

        Parameters
        ----------
        jacobian : ndarray, shape (residuals, P)
            By all parameters; those at a bound can leave it.
        change : ndarray, shape (residuals,)

        Returns
        -------
        float
            Sum of squares of the whitened change that stays unexplained.
        ndarray, shape (P,)
            Steps of the parameters in the scaled space.
        """
        c, J = self.whiten(change), self.whiten(jacobian)
        size = np.linalg.norm(J, axis=0)
        size[size == 0.0] = np.inf
        steps, *_ = np.linalg.lstsq(J / size, c, rcond=BASIS_RANK_TOLERANCE)
        unexplained = c - (J / size) @ steps
        return float(unexplained @ unexplained), steps / size


def _with_floor(noise: Autoregression, own: float, variance: float) -> tuple[Autoregression, float]:
    """Noise of variance `own` with errors of another added, and the variance that these have when they are whitened."""
    white = max(variance - own, 0.0)
    coloured = (variance - white) / own if own > 0.0 else 0.0
    total = _add_white(Autoregression(noise.a, noise.variance * (1.0 + coloured)), white)
    flat = white * float(np.square(total.a).sum()) / max(total.variance, np.finfo(float).tiny)
    return total, flat + coloured * noise.variance / max(total.variance, np.finfo(float).tiny)


def _add_white(model: Autoregression, variance: float) -> Autoregression:
    """Autoregression of the same order for the sum of this noise and white noise of the given variance."""
    if not variance > 0.0:
        return model
    if not model.variance > 0.0:
        return Autoregression((1.0,), variance)
    c = model.autocovariance(model.order + 1)
    c[0] += variance
    whitened = variance * float(np.square(model.a).sum())  # where rounding allows no better: it stays coloured
    return levinson(c) or Autoregression(model.a, model.variance + whitened)
