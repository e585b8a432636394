"""Estimates of the parameters with their intervals, from the optimum of a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, positive
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import CovarianceEstimate, sandwich_covariance
from brightgrey.estimation.uncertainty.heterogeneity import heterogeneity
from brightgrey.estimation.uncertainty.identifiability import UnidentifiableDirection, unidentifiable_directions
from brightgrey.estimation.uncertainty.options import UNCERTAINTY_DEFAULTS, UncertaintyOptions
from brightgrey.simulation import Settings

__all__ = ["Estimate", "Estimates", "UpperLimit", "estimates_of"]

BoundSide = Literal["low", "high"]
_BOUND_SIDES: dict[int, BoundSide | None] = {-1: "low", 0: None, 1: "high"}


@dataclass(frozen=True)
class Estimate:
    """One parameter in SI."""

    #: The standard deviation is 0 if the parameter is fixed and not a number where it is unknown.
    value: float
    std: float
    ci95: tuple[float, float]  #: 95 % interval.
    at_bound: BoundSide | None  #: one of 'low', 'high'} or None.
    #: Standard deviation between the estimates of single recordings; None where not compared, or unknown.
    between: float | None = None


class UpperLimit(NamedTuple):
    """Upper limit of a parameter at its low bound."""

    high: float  #: Upper end of its 95 % interval, SI.
    partner: str  #: Parameter whose errors correlate most with its own.
    correlation: float  #: Their correlation.


class Estimates(NamedTuple):
    """All estimates of a fit."""

    by_name: dict[str, Estimate]
    unidentifiable: tuple[UnidentifiableDirection, ...]  #: Directions that the recordings do not identify.
    differing: tuple[str, ...]  #: Parameters that differ between the recordings, if these were compared.
    #: Of the estimation errors in the scaled space, for pairs of parameters that have an interval.
    correlation: dict[tuple[str, str], float]
    #: Of parameters at a low bound that stands for zero, although others could take their place.
    upper_limits: dict[str, UpperLimit]


class _Spread(NamedTuple):
    """Standard deviations, quantiles, shape (P,), and covariance, shape (P, P), not a number where unknown."""

    std: Array
    quantile: Array
    covariance: Array
    unidentifiable: list[UnidentifiableDirection]
    upper_limits: dict[str, UpperLimit]


def estimates_of(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    options: UncertaintyOptions = UNCERTAINTY_DEFAULTS,
    *,
    compare_recordings: bool = False,
) -> Estimates:
    """Estimates with intervals, which are symmetric in the scaled space; a parameter at its bound has none.

    The size of an effect that may be zero as well, by its standard deviation, has an interval from zero: the residual
    is linear in it there, and a symmetric interval of its logarithm would end anywhere.

    A parameter at a low bound that stands for zero may be larger all the same. It counts as free, linearly, when the
    intervals of the others are computed.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    best : OptimumWithJacobian
    options : UncertaintyOptions
    compare_recordings : bool
        Fit each recording alone, too, and say which parameters differ between them. That may take longer than the fit.
    """
    side = space.active_bounds(best.values)
    spread = _spread(problem, space, best, side, options)
    between, differs = np.full(len(side), np.nan), np.zeros(len(side), bool)
    if compare_recordings:
        between, differs = heterogeneity(problem, space, settings, best, options)
    result = {name: Estimate(value, 0.0, (value, value), None) for name, value in space.fixed.items()}
    for i, name in enumerate(space.names):
        declared = problem.structure.parameters.get(name)
        vanishes = declared is not None and declared.size
        result[name] = _to_si(space, i, best.values, spread, float(between[i]), _BOUND_SIDES[int(side[i])], vanishes)
    names = tuple(name for name, differing in zip(space.names, differs, strict=True) if differing)
    correlation = _correlations(space, spread.covariance, spread.std)
    return Estimates(result, tuple(spread.unidentifiable), names, correlation, spread.upper_limits)


def _spread(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    best: OptimumWithJacobian,
    side: NDArray[np.int64],
    options: UncertaintyOptions,
) -> _Spread:
    """Covariance in the scaled space of the parameters that are not at a bound."""
    count = len(side)
    spread = _Spread(np.full(count, np.nan), np.full(count, np.nan), np.full((count, count), np.nan), [], {})
    inside = np.flatnonzero(side == 0)
    if not inside.size:
        return spread
    J, lengths = best.jacobian[:, inside], problem.segment_lengths
    at_zero = (side < 0) & space.log & (space.low <= options.zero_bound * space.high)
    vanished = np.flatnonzero(at_zero & (np.linalg.norm(best.jacobian, axis=0) > 0.0))
    found = sandwich_covariance(best.residual, np.hstack([J, best.jacobian[:, vanished]]), lengths)
    alone = sandwich_covariance(best.residual, J, lengths).covariance if vanished.size else found.covariance
    known = slice(inside.size)
    spread.quantile[inside] = found.quantile[known]
    spread.std[inside] = found.std[known]
    spread.covariance[np.ix_(inside, inside)] = found.covariance[known, known]
    spread.unidentifiable.extend(unidentifiable_directions(J, alone, space, inside, options))
    spread.upper_limits.update(_upper_limits(space, best, found, inside, vanished))
    for direction in spread.unidentifiable:
        if direction.blind:
            spread.std[list(direction.indices)] = np.nan
    return spread


def _upper_limits(
    space: ParameterSpace,
    best: OptimumWithJacobian,
    found: CovarianceEstimate,
    inside: NDArray[np.intp],
    vanished: NDArray[np.intp],
) -> dict[str, UpperLimit]:
    """Upper limits of the vanished parameters, whose rows are the last of the covariance, relative to their values."""
    std = np.sqrt(positive(np.diag(found.covariance)))
    result = {}
    for k, i in enumerate(vanished, start=inside.size):
        high = float(best.values[i] * (1.0 + found.quantile[k] * std[k]))
        correlation = found.covariance[k, : inside.size] / (std[k] * std[: inside.size])
        j = int(np.abs(correlation).argmax())
        if high < space.high[i]:
            result[space.names[i]] = UpperLimit(high, space.names[inside[j]], float(correlation[j]))
    return result


def _correlations(space: ParameterSpace, covariance: Array, std: Array) -> dict[tuple[str, str], float]:
    """Correlation of the errors, by pairs of names, of the parameters whose standard deviation is known."""
    known = [i for i in range(len(std)) if np.isfinite(std[i]) and std[i] > 0.0]
    return {
        (space.names[i], space.names[j]): float(np.clip(covariance[i, j] / (std[i] * std[j]), -1.0, 1.0))
        for i in known
        for j in known
    }


def _to_si(
    space: ParameterSpace,
    i: int,
    values: Array,
    spread: _Spread,
    between: float,
    at_bound: BoundSide | None,
    vanishes: bool,
) -> Estimate:
    """Estimate of parameter i in SI, from standard deviations in the scaled space; `vanishes` if it is a size."""
    value, std = float(values[i]), float(spread.std[i])
    half = float(spread.quantile[i]) * std
    if space.log[i]:
        unit = abs(value)
        factor = float(np.exp(min(half, 700.0)))  # the largest exponent whose exponential is finite
        from_zero = vanishes and half >= 1.0  # up to there the logarithm reaches no less
        interval = (0.0, value * max(1.0 + half, math.e)) if from_zero else (value / factor, value * factor)
    else:
        unit = float(space.width[i])
        interval = (value - half * unit, value + half * unit)
    if not np.isfinite(std):
        interval = (np.nan, np.nan)
    other = between * unit
    return Estimate(value, std * unit, interval, at_bound, other if np.isfinite(std) and np.isfinite(other) else None)
