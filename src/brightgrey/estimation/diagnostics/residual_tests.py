"""Whether a residual follows one of several patterns more than coloured noise would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import Autoregression, autoregression
from brightgrey.estimation.uncertainty.covariance import noise_models
from brightgrey.numerics.digital_filter import lfilter
from brightgrey.numerics.distributions import chi2
from brightgrey.numerics.distributions import f as fisher

__all__ = ["Candidate", "Detected", "detect_regressors"]

_MATERIAL = 0.01  # of the residual's sum of squares that has to be explained
_RANK = 1e-9
_NEW = 1e-6  # of a pattern that has to be new beside what is known
# A fit takes slow noise with it, so that what is left looks too quiet where slow patterns are. In simulations (straight
# line beside four slow columns, AR poles 0 to 0.99) the ratio's mean was 0.9, 2.1, 3.2 and 2.6 times what it should be
# at 1800, 95, 62 and 25 degrees of freedom.
_SWELLING = 130.0
_MOST_SWOLLEN = 3.5
_MOST = 3
_ASKED = 16  # patterns that explain most are looked at closely


class Detected(NamedTuple):
    """A pattern that a residual follows.

    Attributes
    ----------
    number : int
        Of the pattern.
    coefficients : ndarray, shape (k,)
        Of its columns.
    share : float
        Part of the residual's sum of squares that it explains.
    clear : float
        Twice the logarithm of the likelihood ratio over what it has to exceed.
    """

    number: int
    coefficients: Array
    share: float
    margin: float


@dataclass(frozen=True)
class Candidate:
    """A pattern that a residual is asked for.

    Attributes
    ----------
    columns : ndarray, shape (residuals, k)
    kind : str
        Of several of one kind only the clearest is told.
    later : bool
        Asked only when the residual follows no other any more.
    """

    columns: Array
    kind: str
    later: bool = False


def detect_regressors(
    residual: Array, jacobian: Array, lengths: Sequence[int], questions: Sequence[Candidate], level: float
) -> list[Detected]:
    """Patterns that the residual follows, the clearest first, each beside those before it.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
        Of a least-squares fit.
    jacobian : ndarray, shape (residuals, P)
        What the fit has freed it from.
    lengths : sequence of int
        Of the stretches (one per recording and output) that residuals are correlated within.
    questions : sequence of Candidate
    level : float
        Probability that noise follows any of them.

    Notes
    -----
    Of every pattern that explains at least 1 % of the residual, what it leaves is taken for noise, an autoregression;
    residual and pattern are whitened by it and freed from the whitened Jacobian. Twice the logarithm of the likelihood
    ratio is compared with Fisher's distribution, over all patterns together (Bonferroni); its degrees of freedom are
    those of the noise's spectrum where the pattern is, for slow patterns in slow noise a few dozen (Satterthwaite, as
    for the parameters' intervals), and with few of them the ratio counts for less, by a factor found by simulation.
    """
    found: list[Detected] = []
    left, known = residual, jacobian
    while len(found) < _MOST:
        told = {questions[f.number].kind for f in found}
        rest = _Rest.of(left, known, lengths, level / len(questions))
        shares = {k: rest.share(q.columns) for k, q in enumerate(questions) if q.kind not in told}
        worth = sorted((k for k in shares if shares[k] >= _MATERIAL), key=lambda k: -shares[k])[:_ASKED]
        clear = {k: rest.clear(questions[k].columns, exact=False)[0] for k in worth}
        order = sorted((k for k in worth if clear[k] > 1.0), key=lambda k: (questions[k].later, -clear[k]))
        for k in order:
            sure, coefficients = rest.clear(questions[k].columns, exact=True)
            if sure > 1.0:
                found.append(Detected(k, coefficients, shares[k], sure))
                break
        else:
            break
        columns = questions[found[-1].number].columns
        left, known = left - columns @ found[-1].coefficients, np.column_stack([known, columns])
    return found


@dataclass(frozen=True)
class _Rest:
    """What is left of a residual beside what is known."""

    free: Array
    known: Array
    base: Array
    lengths: Sequence[int]
    level: float

    @classmethod
    def of(cls, residual: Array, known: Array, lengths: Sequence[int], level: float) -> _Rest:
        base = _base(known)
        return cls(residual - base @ (base.T @ residual), known, base, lengths, level)

    def new(self, columns: Array) -> Array:
        """Base of the part of a pattern that is new."""
        size = np.linalg.norm(columns, axis=0)
        unit = columns / np.where(size > 0.0, size, 1.0)
        part = unit - self.base @ (self.base.T @ unit)
        return _base(part) if np.all(np.linalg.norm(part, axis=0) > _NEW) else np.zeros((len(columns), 0))

    def share(self, columns: Array) -> float:
        """Part of the sum of squares that a pattern explains."""
        new = self.new(columns)
        return float(np.square(new.T @ self.free).sum() / max(float(self.free @ self.free), 1e-300))

    def clear(self, columns: Array, *, exact: bool) -> tuple[float, Array]:
        """Log-likelihood ratio over what it has to exceed, and coefficients; `exact` frees the noise from the fit."""
        new = self.new(columns)
        noise = self.free - new @ (new.T @ self.free)
        if exact:
            models = noise_models(noise, np.column_stack([self.known, columns]), self.lengths)
        else:
            models = tuple(autoregression(part) for part in np.split(noise, np.cumsum(self.lengths)[:-1]))
        size = np.linalg.norm(columns, axis=0)
        together = np.column_stack([self.free, columns / size, self.known])
        white = _white(together, models, self.lengths)
        count = columns.shape[1]
        K = _base(white[:, 1 + count :])
        e, X = (part - K @ (K.T @ part) for part in (white[:, 0], white[:, 1 : 1 + count]))
        coefficients, *_ = np.linalg.lstsq(X, e, rcond=_RANK)
        after, before = float(np.square(e - X @ coefficients).sum()), float(e @ e)
        found = len(X) * float(np.log(max(before, 1e-300) / max(after, 1e-300)))
        if found <= chi2.isf(self.level, count):
            return 0.0, coefficients / size
        degrees = self._degrees(X, models)
        swollen = min(1.0 + _SWELLING / degrees, _MOST_SWOLLEN)
        return found / (swollen * count * float(fisher.isf(self.level, count, degrees))), coefficients / size

    def _degrees(self, X: Array, models: Sequence[Autoregression]) -> float:
        """Degrees of freedom of the noise's spectrum where the whitened patterns `X` are."""
        total, doubt = np.zeros(X.shape[1]), np.zeros(X.shape[1])
        for model, part in zip(models, np.split(X, np.cumsum(self.lengths)[:-1]), strict=True):
            weights = lfilter(model.a, [1.0], part[::-1], axis=0)[::-1] / max(model.variance, np.finfo(float).tiny)
            variance, uncertain = model.variance_of_sums(weights)
            total += variance
            doubt += variance**2 * uncertain
        return max(2.0 / max(float(np.max(doubt / total**2)), np.finfo(float).tiny), 1.0)


def _white(x: Array, models: Sequence[Autoregression], lengths: Sequence[int]) -> Array:
    parts = np.split(x, np.cumsum(lengths)[:-1])
    white = [
        lfilter(m.a, [1.0], part, axis=0) / np.sqrt(max(m.variance, np.finfo(float).tiny))
        for m, part in zip(models, parts, strict=True)
    ]
    return np.asarray(np.concatenate(white))


def _base(J: Array) -> Array:
    """Orthonormal base of the columns, shape (residuals, rank)."""
    size = np.linalg.norm(J, axis=0)
    J = J[:, size > 0.0] / size[size > 0.0]
    if not J.shape[1]:
        return np.asarray(J)
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    return np.asarray(U[:, s > _RANK * s[0]])
