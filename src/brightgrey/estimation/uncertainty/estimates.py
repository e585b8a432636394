"""Estimates of parameters with their intervals, from where a descent ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import CovarianceEstimate, sandwich_covariance
from brightgrey.estimation.uncertainty.heterogeneity import heterogeneity
from brightgrey.estimation.uncertainty.identifiability import UnidentifiableDirection, unidentifiable_directions
from brightgrey.simulation import Settings

__all__ = ["Estimate", "Estimates", "estimates_of"]

_LARGEST = 700.0  # exponent
_NOTHING = 1e-3  # of the high bound: a low bound that stands for nothing


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


class UpperLimit(NamedTuple):
    """How far from its low bound a parameter may be: the high end of its 95 % interval, SI, and its errors' partner.

    `partner` is the parameter whose errors correlate most with its own, by `correlation`; empty if there is none.
    """

    high: float
    partner: str
    correlation: float


class Estimates(NamedTuple):
    """Estimates by name, directions that the recordings leave open, parameters that recordings disagree on.

    `correlation` is that of the estimation errors in the searched scale, by pairs of parameters that have an interval;
    `reach` of parameters that have run to a low bound although others could take their place.
    """

    by_name: dict[str, Estimate]
    hidden: tuple[UnidentifiableDirection, ...]
    apart: tuple[str, ...]
    correlation: dict[tuple[str, str], float]
    reach: dict[str, UpperLimit]


def estimates_of(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, best: OptimumWithJacobian
) -> Estimates:
    """Values with intervals in the searched scale; a parameter at its bound has none.

    One that has faded away, at the low bound of a logarithmic range, may be larger all the same: its size is free
    (linearly) when the intervals of the others are found.
    """
    theta, side = search.to_scaled(best.values), search.active_bounds(best.values)
    inside = np.flatnonzero(side == 0)
    std = np.full(len(theta), np.nan)
    quantile, hidden, reach = np.full(len(theta), np.nan), [], dict[str, UpperLimit]()
    covariance: Array = np.full((len(theta), len(theta)), np.nan)
    if inside.size:
        J = best.jacobian[:, inside]
        lengths = [r.samples for r in problem.recordings for _ in r.outputs]
        gone = (side < 0) & search.log & (search.low <= _NOTHING * search.high)
        faded = np.flatnonzero(gone & (np.linalg.norm(best.jacobian, axis=0) > 0.0))
        found = sandwich_covariance(best.residual, np.hstack([J, best.jacobian[:, faded]]), lengths)
        known = slice(inside.size)
        reach = _reach(search, best, found, inside, faded)
        alone = sandwich_covariance(best.residual, J, lengths).covariance if faded.size else found.covariance
        quantile[inside] = found.quantile[known]
        hidden = unidentifiable_directions(J, alone, search, inside)
        std[inside] = np.sqrt(np.maximum(np.diag(found.covariance)[known], 0.0))
        covariance[np.ix_(inside, inside)] = found.covariance[known, known]
        for direction in hidden:
            if direction.blind:
                std[list(direction.indices)] = np.nan
    between, apart = heterogeneity(problem, search, settings, best)
    result = {name: Estimate(value, 0.0, (value, value), None) for name, value in search.fixed.items()}
    at: dict[int, Literal["low", "high"] | None] = {-1: "low", 0: None, 1: "high"}
    for i, name in enumerate(search.names):
        result[name] = _estimate(
            float(best.values[i]), float(std[i]), float(quantile[i]), float(between[i]), search, i, at[int(side[i])]
        )
    names = tuple(name for name, differs in zip(search.names, apart, strict=True) if differs)
    return Estimates(result, tuple(hidden), names, _correlation(search, covariance, std), reach)


def _reach(
    search: ParameterSpace,
    best: OptimumWithJacobian,
    found: CovarianceEstimate,
    inside: NDArray[np.intp],
    faded: NDArray[np.intp],
) -> dict[str, UpperLimit]:
    """Reach of the parameters that have faded away; the last of the covariance are theirs, relative to their values."""
    std = np.sqrt(np.maximum(np.diag(found.covariance), 1e-300))
    result = {}
    for k, i in enumerate(faded, start=inside.size):
        high = float(best.values[i] * (1.0 + found.quantile[k] * std[k]))
        together = found.covariance[k, : inside.size] / (std[k] * std[: inside.size])
        j = int(np.abs(together).argmax())
        if high < search.high[i]:
            result[search.names[i]] = UpperLimit(high, search.names[inside[j]], float(together[j]))
    return result


def _correlation(search: ParameterSpace, covariance: Array, std: Array) -> dict[tuple[str, str], float]:
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
    search: ParameterSpace,
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
