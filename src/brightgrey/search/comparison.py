"""Whether one structure fits significantly better than another: misfits in white noise's terms.

Residuals of a simulation are coloured, so sums of their squares mislead. The noise of the structure that fits best is
modelled as an autoregression; with its filter, residuals and derivatives of every structure are whitened, and one
Gauss-Newton step on them gives the misfit that generalised least squares would reach.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import Autoregression, levinson
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.uncertainty.covariance import noise_models
from brightgrey.kit import Structure
from brightgrey.numerics.digital_filter import lfilter
from brightgrey.numerics.distributions import chi2, f, ncx2

__all__ = ["Judged", "Whitening", "chance_of", "power", "significance", "threshold"]

_RANK = 1e-9


@dataclass(frozen=True)
class Judged:
    """A structure at the level that counts.

    Attributes
    ----------
    structure : Structure
    values : mapping of str to float
        SI, fixed ones included.
    descent : OptimumWithJacobian
        With residual and Jacobian.
    free : int
        Number of estimated parameters.
    inside : tuple of int
        Parameters, by column of the Jacobian, that are not at a bound.
    """

    structure: Structure
    values: Mapping[str, float]
    descent: OptimumWithJacobian
    free: int
    inside: tuple[int, ...]

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals."""
        return self.descent.cost


@dataclass(frozen=True)
class Whitening:
    """Filters that make the noise of every stretch (one output of one recording) white with variance 1.

    Attributes
    ----------
    models : tuple of Autoregression
    lengths : tuple of int
        Of the stretches.
    doubt : tuple of float
        Variances of what simulation and sensor may be off by beside that noise. They count as white and independent of
        it, and are part of `models`.
    """

    models: tuple[Autoregression, ...]
    lengths: tuple[int, ...]
    doubt: tuple[float, ...]

    @classmethod
    def of(cls, judged: Judged, lengths: Sequence[int], doubt: Sequence[float] | None = None) -> Whitening:
        """Filters from the residual of a structure that fits well; no doubt by default."""
        jacobian = judged.descent.jacobian[:, list(judged.inside)]
        models = noise_models(judged.descent.residual, jacobian, lengths)
        beside = tuple(doubt) if doubt is not None else (0.0,) * len(lengths)
        return cls(
            tuple(_with_white(model, d) for model, d in zip(models, beside, strict=True)), tuple(lengths), beside
        )

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return sum(self.lengths)

    @cached_property
    def independent(self) -> float:
        """Number of samples that tell a variance as well as the coloured residuals do."""
        return sum(model.effective_samples_variance(n) for model, n in zip(self.models, self.lengths, strict=True))

    def white(self, x: Array) -> Array:
        """Whitened residuals or derivatives, shape (residuals, ...)."""
        parts = np.split(x, np.cumsum(self.lengths)[:-1])
        tiny = np.finfo(float).tiny
        white = [
            lfilter(model.a, [1.0], part, axis=0) / np.sqrt(max(model.variance, tiny))
            for model, part in zip(self.models, parts, strict=True)
        ]
        return np.asarray(np.concatenate(white))

    def base(self, judged: Judged, columns: Sequence[int]) -> Array:
        """Orthonormal base of some whitened derivatives, shape (residuals, rank)."""
        if not len(columns):
            return np.zeros((len(judged.descent.residual), 0))
        J = self.white(judged.descent.jacobian[:, list(columns)])
        size = np.linalg.norm(J, axis=0)
        J = np.asarray(J[:, size > 0.0] / size[size > 0.0])
        if not J.shape[1]:
            return J
        U, s, _ = np.linalg.svd(J, full_matrices=False)
        base: Array = U[:, s > _RANK * s[0]]
        return base

    def misfit(self, judged: Judged) -> float:
        """Sum of squared whitened residuals that generalised least squares leaves, and the doubt's share in it."""
        r, Q = self.white(judged.descent.residual), self.base(judged, judged.inside)
        share = [
            length * d * float(np.square(model.a).sum()) / max(model.variance, np.finfo(float).tiny)
            for model, length, d in zip(self.models, self.lengths, self.doubt, strict=True)
        ]
        return float(max(r @ r - np.square(Q.T @ r).sum(), 0.0)) + sum(share)

    def imitation(self, judged: Judged, change: Array) -> tuple[float, Array]:
        """How well the parameters of `judged` can imitate a change of the (weighted) outputs.

        Returns the squared size of what is left, and the parameters' steps in the searched scale, shape (P,). Those at
        a bound count, too: they can leave it.
        """
        c, J = self.white(change), self.white(judged.descent.jacobian)
        size = np.linalg.norm(J, axis=0)
        size[size == 0.0] = np.inf
        steps, *_ = np.linalg.lstsq(J / size, c, rcond=_RANK)
        left = c - (J / size) @ steps
        return float(left @ left), steps / size


def _with_white(model: Autoregression, variance: float) -> Autoregression:
    """Autoregression of the same order for the sum with white noise."""
    if not variance > 0.0:
        return model
    if not model.variance > 0.0:
        return Autoregression((1.0,), variance)
    c = model.autocovariance(model.order + 1)
    c[0] += variance
    return levinson(c) or Autoregression((1.0,), float(c[0]))


def significance(small: float, big: float, samples: int) -> float:
    """Twice the logarithm of the likelihood ratio of two misfits, noise of unknown size."""
    return samples * float(np.log(max(small, 1e-300) / max(big, 1e-300)))


def threshold(parameters: int, level: float) -> float:
    """What twice the log-likelihood ratio exceeds by chance with probability `level` (Wilks)."""
    return float(chi2.isf(level, max(parameters, 1)))


def chance_of(ratio: float, parameters: int, left: float) -> float:
    """Probability that useless `parameters` lower a sum of squares by that `ratio`, `left` independent samples beyond.

    By Fisher's F distribution, which needs no number of samples to be large; 1 if none is left.
    """
    if not left > 0.0:
        return 1.0
    return float(f.sf((ratio - 1.0) * left / max(parameters, 1), max(parameters, 1), left))


def power(noncentrality: float, parameters: int, level: float) -> float:
    """Probability that an effect of this size is found at `level`."""
    return float(ncx2.sf(threshold(parameters, level), max(parameters, 1), max(noncentrality, 1e-12)))
