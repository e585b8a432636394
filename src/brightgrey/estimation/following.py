"""Whether a residual follows one of several patterns more than coloured noise would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2
from scipy.stats import f as fisher

from brightgrey.estimation.coloured import Autoregression
from brightgrey.estimation.uncertainty import noise_models

__all__ = ["Followed", "Question", "followed"]

Array = NDArray[np.float64]
_MATERIAL = 0.01  # of the residual's sum of squares that has to be explained
_RANK = 1e-9
_NEW = 1e-6  # of a pattern that has to be new beside what is known
# A fit takes slow noise with it, so that what is left looks too quiet where slow patterns are. In simulations (straight
# line beside four slow columns, AR poles 0 to 0.99) the ratio's mean was 0.9, 2.1, 3.2 and 2.6 times what it should be
# at 1800, 95, 62 and 25 degrees of freedom.
_SWELLING = 130.0
_MOST_SWOLLEN = 3.5
_MOST = 3


class Followed(NamedTuple):
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
    clear: float


@dataclass(frozen=True)
class Question:
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


def followed(
    residual: Array, jacobian: Array, lengths: Sequence[int], questions: Sequence[Question], level: float
) -> list[Followed]:
    """Patterns that the residual follows, the clearest first, each beside those before it.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
        Of a least-squares fit.
    jacobian : ndarray, shape (residuals, P)
        What the fit has freed it from.
    lengths : sequence of int
        Of the stretches (one per recording and output) that residuals are correlated within.
    questions : sequence of Question
    level : float
        Probability that noise follows any of them.

    Notes
    -----
    A score test: the noise is an autoregression of the residual as it is; residual and patterns are whitened by it
    and freed from the whitened Jacobian. Twice the logarithm of the likelihood ratio is compared with Fisher's
    distribution, over all patterns together (Bonferroni); its degrees of freedom are those of the noise's spectrum
    where the pattern is, for slow patterns in slow noise a few dozen (Satterthwaite, as for the parameters' intervals),
    and with few of them the ratio counts for less, by a factor that was found by simulation.
    What explains less than 1 % is not worth a word.
    """
    found: list[Followed] = []
    left, base = residual, jacobian
    while len(found) < _MOST:
        told = {questions[f.number].kind for f in found}
        scale = _Scale.of(left, base, lengths)
        hits = [
            hit
            for number, q in enumerate(questions)
            if q.kind not in told
            for hit in [scale.ask(number, q.columns, level / len(questions))]
            if hit is not None
        ]
        if not hits:
            break
        best = min(hits, key=lambda hit: (questions[hit.number].later, -hit.clear))
        found.append(best)
        columns = questions[best.number].columns
        left, base = left - columns @ best.coefficients, np.column_stack([base, columns])
    return found


@dataclass(frozen=True)
class _Scale:
    """What is left of a residual, plain and whitened, freed from what is known already."""

    models: Sequence[Autoregression]
    lengths: Sequence[int]
    free: Array
    known: Array
    white: Array
    white_known: Array

    @classmethod
    def of(cls, residual: Array, known: Array, lengths: Sequence[int]) -> _Scale:
        models = noise_models(residual, known, lengths)
        plain, white = _base(known), _base(_white(known, models, lengths))
        e = _white(residual[:, None], models, lengths)[:, 0]
        free = residual - plain @ (plain.T @ residual)
        return cls(models, lengths, free, plain, e - white @ (white.T @ e), white)

    def ask(self, number: int, columns: Array, level: float) -> Followed | None:
        """Whether the residual follows one pattern."""
        size = np.linalg.norm(columns, axis=0)
        unit = columns / np.where(size > 0.0, size, 1.0)
        X = _white(unit, self.models, self.lengths)
        whole = np.linalg.norm(X, axis=0)
        X = X - self.white_known @ (self.white_known.T @ X)
        if not np.all(np.linalg.norm(X, axis=0) > _NEW * whole):
            return None
        coefficients, *_ = np.linalg.lstsq(X, self.white, rcond=_RANK)
        after = float(np.square(self.white - X @ coefficients).sum())
        before = float(self.white @ self.white)
        count = X.shape[1]
        found = len(X) * float(np.log(max(before, 1e-300) / max(after, 1e-300)))
        if found <= chi2.isf(level, count):
            return None
        degrees = self._degrees(X)
        swollen = min(1.0 + _SWELLING / degrees, _MOST_SWOLLEN)
        clear = found / (swollen * count * float(fisher.isf(level, count, degrees)))
        P = _base(unit - self.known @ (self.known.T @ unit))
        share = float(np.square(P.T @ self.free).sum() / max(float(self.free @ self.free), 1e-300))
        if clear <= 1.0 or share < _MATERIAL:
            return None
        return Followed(number, coefficients / np.where(size > 0.0, size, 1.0), share, clear)

    def _degrees(self, X: Array) -> float:
        """Degrees of freedom of the noise's spectrum where the whitened patterns `X` are."""
        total, doubt = np.zeros(X.shape[1]), np.zeros(X.shape[1])
        for model, part in zip(self.models, np.split(X, np.cumsum(self.lengths)[:-1]), strict=True):
            weights = lfilter(model.a, [1.0], part[::-1], axis=0)[::-1] / max(model.variance, np.finfo(float).tiny)
            variance, uncertain = model.scatter(weights)
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
