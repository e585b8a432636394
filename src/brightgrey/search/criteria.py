"""Criteria by which a search compares structures, and the chances of having offspring that follow from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.noise.residual_analysis import nrmse_fit_percent
from brightgrey.search.policy import SELECTION

__all__ = ["CRITERIA", "Criterion", "Misfit", "bic", "criterion"]

_TINY = 1e-300  # keeps the logarithm of a perfect fit finite


@dataclass(frozen=True)
class Misfit:
    """Misfit of the outputs after an identification."""

    #: Residual sum of squares of each output, over its noise squared if there are several; inf if the simulation
    #: diverged.
    rss: tuple[float, ...]
    least: tuple[float, ...]  #: What rounding to the sensor's resolution leaves on the average: the floor.
    samples: int  #: Of each output.
    spread: tuple[float, ...]  #: Sum of squares of each output about its mean, in the unit of `rss`.
    #: Of the samples, how many are independent; less than 1 where residuals are known to hang together.
    share: float = 1.0

    @property
    def independent(self) -> float:
        """Number of independent samples of each output."""
        return self.share * self.samples

    @property
    def fit_percent(self) -> float:
        """Mean over the outputs of 100 (1 - |y - yhat| / |y - mean|); -inf if the simulation diverged."""
        return float(np.mean([nrmse_fit_percent(*pair) for pair in zip(self.rss, self.spread, strict=True)]))

    @property
    def floored(self) -> tuple[float, ...]:
        """RSS of each output, not below what a perfect model leaves at most in 19 of 20 recordings.

        The floor is the mean of that. A uniform error's square varies by 4/5 of its mean squared, so that the mean of n
        independent ones is off by sqrt(4/5 / n). A model within that chance is not refuted, and none is better.
        """
        most = 1.0 + SELECTION.rounding_quantile * float(np.sqrt(0.8 / self.independent))
        return tuple(max(rss, most * least) for rss, least in zip(self.rss, self.least, strict=True))


@dataclass(frozen=True)
class Criterion:
    """A criterion."""

    name: str
    #: ``value(misfit, d)`` for d estimated parameters; the larger, the better; -inf or 0 if nothing is good.
    value: Callable[[Misfit, int], float]
    #: ``chances(values, samples)``: weights, shape (individuals,), not negative, for the roulette wheel; so many
    #: samples are independent.
    chances: Callable[[Sequence[float], float], Array]


def fitness(misfit: Misfit, d: int, k_p: float) -> float:
    """Fitness of the paper, eq. (19): 1 / (RSS (1 + k_P d)).

    RSS does not count below what a perfect model may leave on a sensor of the recording's resolution (step²/12 per
    sample, and its chance). Without this floor a perfect fit has infinite fitness, and the roulette wheel only one
    sector.
    """
    total = sum(misfit.floored)
    return 1.0 / (total * (1.0 + k_p * d)) if np.isfinite(total) else 0.0


def bic(rss: float | Sequence[float], samples: float, parameters: int, independent: float | None = None) -> float:
    """Bayesian information criterion, smaller is better (Schwarz 1978, doi:10.1214/aos/1176344136).

    ``n sum over outputs of ln(RSS / N) + d ln(n outputs)``, for noise of unknown size that differs between outputs.

    Parameters
    ----------
    rss : float or sequence of float
        Residual sum of squares of each output.
    samples : float
        Samples N of each output.
    parameters : int
        Estimated parameters d.
    independent : float, optional
        Independent samples n of each output that the N are worth; all N by default.

    Returns
    -------
    float
        Infinite if a sum of squares is.
    """
    n = samples if independent is None else independent
    each = (rss,) if isinstance(rss, float | int) else rss
    likelihood = n * sum(float(np.log(max(one, _TINY) / samples)) for one in each)
    return likelihood + parameters * float(np.log(n * len(each)))


def negative_half_bic(misfit: Misfit, d: int) -> float:
    """Logarithm of the odds of a model, -BIC/2, with the floor as in `fitness`; -inf if its simulation diverged."""
    value = bic(misfit.floored, misfit.samples, d, misfit.independent)
    return -0.5 * value if np.isfinite(value) else -np.inf


def in_proportion(values: Sequence[float], samples: float) -> Array:
    """Chances are the values themselves, as in the paper."""
    return np.asarray(values, float)


def by_likelihood(values: Sequence[float], samples: float) -> Array:
    """Chances are the odds that `values` are logarithms of, per sample, 1 for the best.

    The odds of all samples together run to exp(hundreds) and would leave one individual. Per sample they are
    proportional to 1/RSS, up to the parameters' penalty, as the paper's fitness (19) is.
    """
    v = np.asarray(values, float)
    if not np.isfinite(v).any():
        return np.zeros(len(v))
    return np.asarray(np.exp(2.0 * (v - v.max()) / samples))


CRITERIA = ("fitness", "bic")


def criterion(name: str, k_p: float = 2.0) -> Criterion:
    """Criterion by its name: ``fitness`` is the paper's (19) with `k_p`, ``bic`` an information criterion.

    Raises
    ------
    SettingsError
        For any other name.
    """
    if name == "fitness":
        return Criterion(name, lambda misfit, d: fitness(misfit, d, k_p), in_proportion)
    if name == "bic":
        return Criterion(name, negative_half_bic, by_likelihood)
    raise SettingsError(unknown_name("criterion", name, CRITERIA))
