"""Estimates of parameters with their intervals, from where a descent ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.agreement import agreement
from brightgrey.estimation.bounds import Search
from brightgrey.estimation.combinations import Open, open_directions
from brightgrey.estimation.leastsquares import Descent
from brightgrey.estimation.problem import Problem
from brightgrey.estimation.uncertainty import spread
from brightgrey.simulation import Settings

__all__ = ["Estimate", "Estimates", "estimates_of"]

Array = NDArray[np.float64]
_AT_BOUND = 1e-4  # of the searched range
_LARGEST = 700.0  # exponent


@dataclass(frozen=True)
class Estimate:
    """One parameter in SI.

    Attributes
    ----------
    value, std : float
        The standard deviation is 0 if the parameter is fixed and not a number where nothing can be said.
    ci95 : (low, high)
    at_bound : {'low', 'high'} or None
    between : float or None
        Standard deviation of what the recordings alone would say; None with one recording or where nothing can
        be said.
    """

    value: float
    std: float
    ci95: tuple[float, float]
    at_bound: Literal["low", "high"] | None
    between: float | None = None


class Estimates(NamedTuple):
    """Estimates by name, directions that the recordings leave open, parameters that recordings disagree on.

    `correlation` is that of the estimation errors in the searched scale, by pairs of parameters that have an interval.
    """

    by_name: dict[str, Estimate]
    hidden: tuple[Open, ...]
    apart: tuple[str, ...]
    correlation: dict[tuple[str, str], float]


def estimates_of(problem: Problem, search: Search, settings: Settings, best: Descent) -> Estimates:
    """Values with intervals in the searched scale; a parameter at its bound has none, and lends none to others."""
    theta, low, high = (search.inward(v) for v in (best.values, search.low, search.high))
    near = _AT_BOUND * (high - low)
    side = np.where(theta - low <= near, -1, np.where(high - theta <= near, 1, 0))
    inside = np.flatnonzero(side == 0)
    std = np.full(len(theta), np.nan)
    quantile, hidden = np.full(len(theta), np.nan), []
    covariance: Array = np.full((len(theta), len(theta)), np.nan)
    if inside.size:
        J = best.jacobian[:, inside]
        found = spread(best.residual, J, [r.samples for r in problem.recordings for _ in r.outputs])
        quantile[inside] = found.quantile
        hidden = open_directions(J, found.covariance, search, inside)
        std[inside] = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
        covariance[np.ix_(inside, inside)] = found.covariance
        for direction in hidden:
            if direction.blind:
                std[list(direction.indices)] = np.nan
    between, apart = agreement(problem, search, settings, best)
    result = {name: Estimate(value, 0.0, (value, value), None) for name, value in search.fixed.items()}
    at: dict[int, Literal["low", "high"] | None] = {-1: "low", 0: None, 1: "high"}
    for i, name in enumerate(search.names):
        result[name] = _estimate(
            float(best.values[i]), float(std[i]), float(quantile[i]), float(between[i]), search, i, at[int(side[i])]
        )
    names = tuple(name for name, differs in zip(search.names, apart, strict=True) if differs)
    return Estimates(result, tuple(hidden), names, _correlation(search, covariance, std))


def _correlation(search: Search, covariance: Array, std: Array) -> dict[tuple[str, str], float]:
    """Correlation of the errors, by pairs of names, of the parameters whose standard deviation is known."""
    known = [i for i in range(len(std)) if np.isfinite(std[i]) and std[i] > 0.0]
    return {
        (search.names[i], search.names[j]): float(np.clip(covariance[i, j] / (std[i] * std[j]), -1.0, 1.0))
        for i in known
        for j in known
    }


def _estimate(
    value: float,
    std: float,
    quantile: float,
    between: float,
    search: Search,
    i: int,
    at_bound: Literal["low", "high"] | None,
) -> Estimate:
    """From standard deviations in the searched scale to SI."""
    half = quantile * std
    if search.log[i]:
        unit = abs(value)
        factor = float(np.exp(min(half, _LARGEST)))
        interval = (value / factor, value * factor)
    else:
        unit = float(search.width[i])
        interval = (value - half * unit, value + half * unit)
    if not np.isfinite(std):
        interval = (np.nan, np.nan)
    other = between * unit
    return Estimate(value, std * unit, interval, at_bound, other if np.isfinite(std) and np.isfinite(other) else None)
