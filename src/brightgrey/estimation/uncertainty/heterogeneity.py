"""Whether several recordings agree on the parameters that were fitted to all of them."""

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
from brightgrey.numerics.distributions import chi2
from brightgrey.simulation import Settings

__all__ = ["Heterogeneity", "heterogeneity"]

_CHANCE = 0.01  # of calling recordings that agree different, over all parameters
_NORMAL = 1.96  # standard deviations to each side of a 95 % interval


class Heterogeneity(NamedTuple):
    """Scatter of each parameter between recordings, shape (P,), and whether it is more than chance makes.

    In the searched scale; not a number where less than two recordings show the parameter.
    """

    between: Array
    apart: NDArray[np.bool_]


def heterogeneity(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, best: OptimumWithJacobian
) -> Heterogeneity:
    """Fit every recording alone, from the joint optimum, and compare.

    Parameters
    ----------
    problem : SimulationErrorProblem
    search : ParameterSpace
    settings : Settings
    best : OptimumWithJacobian
        The joint optimum.

    Returns
    -------
    Agreement
        `between` is the standard deviation between recordings, each counted by its information. Recordings disagree
        on a parameter if Cochran's Q of their values is beyond chance (1 % for all parameters together,
        doi:10.2307/3001666) and the scatter is beyond half of the interval that
        they would have together if they agreed (the joint fit's own is blown up by what they disagree on).
    """
    count = len(best.values)
    if len(problem.recordings) < 2 or not np.any(best.jacobian):
        return Heterogeneity(np.full(count, np.nan), np.zeros(count, bool))
    parts = [
        replace(problem, recordings=(r,), initial_states=(onset,))
        for r, onset in zip(problem.recordings, problem.initial_states, strict=True)
    ]
    alone = [_alone(part, search, settings, best.values) for part in parts]
    value, std = np.array([a[0] for a in alone]), np.array([a[1] for a in alone])
    shown = np.isfinite(std) & (std > 0.0)
    weight = np.where(shown, 1.0 / np.where(shown, std, 1.0) ** 2, 0.0)
    number = shown.sum(axis=0)
    total = np.where(number > 0, weight.sum(axis=0), 1.0)
    excess = np.sum(weight * (value - (weight * value).sum(axis=0) / total) ** 2, axis=0)
    more = np.maximum(number - 1, 1)
    between = np.where(number > 1, np.sqrt(excess / total * number / more), np.nan)
    beyond = (number > 1) & (excess > chi2.isf(_CHANCE / count, more))
    return Heterogeneity(between, beyond & (between > _NORMAL / np.sqrt(total)))


def _alone(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, start: Array
) -> tuple[Array, Array]:
    """Estimate and standard deviation of one recording, in the searched scale; infinite where it shows nothing."""
    found = fit_to_convergence(problem, search, settings, start)
    theta = search.to_scaled(found.values)
    std = np.full(len(theta), np.inf)
    inside = np.flatnonzero(search.active_bounds(found.values) == 0)
    if inside.size:
        J = found.jacobian[:, inside]
        own = sandwich_covariance(found.residual, J, [r.samples for r in problem.recordings for _ in r.outputs])
        std[inside] = np.sqrt(np.maximum(np.diag(own.covariance), 0.0))
        for hidden in unidentifiable_directions(J, own.covariance, search, inside):
            std[list(hidden.indices)] = np.inf
    return theta, std
