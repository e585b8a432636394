"""Score tests: does a residual follow one of several regressors by more than coloured noise explains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array, log_ratio, positive
from brightgrey.estimation.diagnostics.options import REGRESSOR_DEFAULTS, RegressorOptions
from brightgrey.estimation.noise.autoregression import Autoregression, autoregression, noise_models
from brightgrey.estimation.noise.orthonormal_basis import BASIS_RANK_TOLERANCE, orthonormal_basis
from brightgrey.estimation.noise.whitening import whiten
from brightgrey.estimation.problem.segments import split_segments
from brightgrey.numerics.digital_filter import lfilter
from brightgrey.numerics.distributions import chi2
from brightgrey.numerics.distributions import f as fisher

__all__ = ["Candidate", "Detected", "detect_regressors", "noise_degrees"]


class Detected(NamedTuple):
    """A regressor that a residual follows."""

    number: int  #: Index of the candidate.
    coefficients: Array  #: Coefficients of its columns, shape (k,).
    share: float  #: Part of the residual's sum of squares that it explains.
    margin: float  #: Twice the logarithm of the likelihood ratio over its critical value.


@dataclass(frozen=True)
class Candidate:
    """A candidate regressor."""

    columns: Callable[[], Array]  #: Makes its columns, shape (residuals, k).
    kind: str  #: Of several candidates of one kind, only the one with the largest margin is detected.
    later: bool = False  #: True if it is tested only when the residual follows no other any more.
    compared: int = 1  #: Like candidates of which this one explains most: chance has as many tries.


def detect_regressors(
    residual: Array,
    jacobian: Array,
    lengths: Sequence[int],
    candidates: Sequence[Candidate],
    level: float,
    options: RegressorOptions = REGRESSOR_DEFAULTS,
) -> list[Detected]:
    """Detect the regressors that the residual follows, the clearest first, each beside those before it.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
        Residual of a least-squares fit.
    jacobian : ndarray, shape (residuals, P)
        Derivatives by the estimated parameters, of which the residual is free.
    lengths : sequence of int
        Samples of each segment; residuals are correlated within a segment.
    candidates : sequence of Candidate
    level : float
        Probability that noise follows any of them.
    options : RegressorOptions

    Notes
    -----
    A regressor that explains at least 1 % of the residual is tested. What it leaves is noise, an autoregression, by
    which residual and regressor are whitened and freed from the whitened Jacobian. Twice the logarithm of the
    likelihood ratio has Fisher's distribution, for all candidates together (Bonferroni). Its degrees of freedom are
    those of the noise's spectrum where the regressor is: for slow regressors in slow noise a few dozen (Satterthwaite,
    as for the intervals). With few of them the critical value is larger, by a factor found by simulation.
    """
    found: list[Detected] = []
    remaining, known = residual, jacobian
    while len(found) < options.max_detected:
        kinds = {candidates[f.number].kind for f in found}
        test = _ScoreTest.of(remaining, known, lengths, level / len(candidates), options)
        detected = test.first_detected({k: c for k, c in enumerate(candidates) if c.kind not in kinds})
        if detected is None:
            break
        found.append(detected)
        columns = candidates[detected.number].columns()
        remaining, known = remaining - columns @ detected.coefficients, np.column_stack([known, columns])
    return found


@dataclass(frozen=True)
class _ScoreTest:
    """Residual, freed from the `known` columns, with which candidates are tested at a level."""

    residual: Array
    known: Array
    basis: Array
    lengths: Sequence[int]
    level: float
    options: RegressorOptions

    @classmethod
    def of(
        cls, residual: Array, known: Array, lengths: Sequence[int], level: float, options: RegressorOptions
    ) -> _ScoreTest:
        basis = orthonormal_basis(known)
        return cls(residual - basis @ (basis.T @ residual), known, basis, lengths, level, options)

    def first_detected(self, candidates: dict[int, Candidate]) -> Detected | None:
        """Candidate that is significant by the corrected noise, in the order of the margins by the plain noise."""
        shares = {k: self.share(c.columns()) for k, c in candidates.items()}
        material = [k for k in shares if shares[k] >= self.options.min_share]
        examined = sorted(material, key=lambda k: -shares[k])[: self.options.max_examined]
        margins = {k: self.margin(candidates[k], corrected=False)[0] for k in examined}
        significant = [k for k in examined if margins[k] > 1.0]
        for k in sorted(significant, key=lambda k: (candidates[k].later, -margins[k])):
            margin, coefficients = self.margin(candidates[k], corrected=True)
            if margin > 1.0:
                return Detected(k, coefficients, shares[k], margin)
        return None

    def new_basis(self, columns: Array) -> Array:
        """Orthonormal basis of the part of the columns that is not known."""
        size = np.linalg.norm(columns, axis=0)
        unit = columns / np.where(size > 0.0, size, 1.0)
        part = unit - self.basis @ (self.basis.T @ unit)
        new = np.all(np.linalg.norm(part, axis=0) > self.options.min_new)
        return orthonormal_basis(part) if new else np.zeros((len(columns), 0))

    def share(self, columns: Array) -> float:
        """Part of the sum of squares that the columns explain."""
        new = self.new_basis(columns)
        return float(np.square(new.T @ self.residual).sum() / positive(float(self.residual @ self.residual)))

    def margin(self, candidate: Candidate, *, corrected: bool) -> tuple[float, Array]:
        """Log-likelihood ratio over its critical value, and coefficients; `corrected` noise is freed from the fit."""
        columns, level = candidate.columns(), self.level / candidate.compared
        new = self.new_basis(columns)
        noise = self.residual - new @ (new.T @ self.residual)
        if corrected:
            models = noise_models(noise, np.column_stack([self.known, columns]), self.lengths)
        else:
            models = tuple(autoregression(part) for part in split_segments(noise, self.lengths))
        size, count = np.linalg.norm(columns, axis=0), columns.shape[1]
        white = whiten(np.column_stack([self.residual, columns / size, self.known]), models, self.lengths)
        K = orthonormal_basis(white[:, 1 + count :])
        e, X = (part - K @ (K.T @ part) for part in (white[:, 0], white[:, 1 : 1 + count]))
        coefficients, *_ = np.linalg.lstsq(X, e, rcond=BASIS_RANK_TOLERANCE)
        statistic = len(X) * log_ratio(float(e @ e), float(np.square(e - X @ coefficients).sum()))
        if statistic <= chi2.isf(level, count):
            return 0.0, coefficients / size
        degrees = noise_degrees(X, models, self.lengths)
        inflation = min(1.0 + self.options.inflation / degrees, self.options.max_inflation)
        return statistic / (inflation * count * float(fisher.isf(level, count, degrees))), coefficients / size


def noise_degrees(regressors: Array, models: Sequence[Autoregression], lengths: Sequence[int]) -> float:
    """Degrees of freedom of the noise's spectrum at whitened regressors, shape (residuals, k); the least of them.

    Parameters
    ----------
    regressors : ndarray, shape (residuals, k)
    models : sequence of Autoregression
        Noise of each segment, which was estimated from as many samples.
    lengths : sequence of int
        Samples of each segment.
    """
    total, uncertainty = np.zeros(regressors.shape[1]), np.zeros(regressors.shape[1])
    for model, part in zip(models, split_segments(regressors, lengths), strict=True):
        weights = lfilter(model.a, [1.0], part[::-1], axis=0)[::-1] / max(model.variance, np.finfo(float).tiny)
        variance, log_variance = model.variance_of_sums(weights)
        total += variance
        uncertainty += variance**2 * log_variance
    return max(2.0 / max(float(np.max(uncertainty / total**2)), np.finfo(float).tiny), 1.0)
