"""Cochran's test for parameters that differ between recordings of one drive."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import sandwich_covariance
from brightgrey.estimation.uncertainty.identifiability import unidentifiable_directions
from brightgrey.estimation.uncertainty.options import UNCERTAINTY_DEFAULTS, UncertaintyOptions
from brightgrey.numerics.distributions import chi2
from brightgrey.simulation import Settings

__all__ = ["Heterogeneity", "heterogeneity"]


class Heterogeneity(NamedTuple):
    """Differences of the parameters between recordings, in the scaled space."""

    #: Standard deviation between recordings; not a number where less than two recordings identify the parameter, shape
    #: (P,).
    std_between: Array
    differs: NDArray[np.bool_]  #: True where the recordings differ by more than chance explains, shape (P,).


def heterogeneity(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    options: UncertaintyOptions = UNCERTAINTY_DEFAULTS,
) -> Heterogeneity:
    """Fit every recording alone, from the joint optimum, and compare.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    best : OptimumWithJacobian
        The joint optimum.
    options : UncertaintyOptions

    Notes
    -----
    Recordings differ in a parameter if two conditions hold. Cochran's Q of their values exceeds chance
    (doi:10.2307/3001666). And the standard deviation between them exceeds half the interval that they would have
    together if they agreed. The joint fit's own interval is no measure: differences widen it.
    """
    count = len(best.values)
    if len(problem.recordings) < 2 or not np.any(best.jacobian):
        return Heterogeneity(np.full(count, np.nan), np.zeros(count, bool))
    parts = [
        replace(problem, recordings=(r,), initial_states=(state,))
        for r, state in zip(problem.recordings, problem.initial_states, strict=True)
    ]
    fits = [_single_fit(part, space, settings, best.values, options) for part in parts]
    value, std = np.array([f[0] for f in fits]), np.array([f[1] for f in fits])
    identified = np.isfinite(std) & (std > 0.0)
    weight = np.where(identified, 1.0 / np.where(identified, std, 1.0) ** 2, 0.0)
    number = identified.sum(axis=0)
    total = np.where(number > 0, weight.sum(axis=0), 1.0)
    cochran_q = np.sum(weight * (value - (weight * value).sum(axis=0) / total) ** 2, axis=0)
    degrees = np.maximum(number - 1, 1)
    between = np.where(number > 1, np.sqrt(cochran_q / total * number / degrees), np.nan)
    significant = (number > 1) & (cochran_q > chi2.isf(options.heterogeneity_level / count, degrees))
    half_width = 1.96 / np.sqrt(total)  # of the 95 % interval of all recordings together
    return Heterogeneity(between, significant & (between > half_width))


def _single_fit(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    start: Array,
    options: UncertaintyOptions,
) -> tuple[Array, Array]:
    """Estimate and standard deviation of one recording in the scaled space; infinite where it is not identifiable."""
    found = fit_to_convergence(problem, space, settings, start)
    theta = space.to_scaled(found.values)
    std = np.full(len(theta), np.inf)
    inside = np.flatnonzero(space.active_bounds(found.values) == 0)
    if inside.size:
        J = found.jacobian[:, inside]
        own = sandwich_covariance(found.residual, J, problem.segment_lengths)
        std[inside] = own.std
        for direction in unidentifiable_directions(J, own.covariance, space, inside, options):
            std[list(direction.indices)] = np.inf
    return theta, std
