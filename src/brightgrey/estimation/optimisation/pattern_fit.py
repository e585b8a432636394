"""Estimation by pattern search, the paper's estimator (section 3.1, step 4), in place of least squares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, evaluate
from brightgrey.estimation.optimisation.pattern_search import CostMany, PatternSearchResult, pattern_search
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = ["ESTIMATORS", "Estimator", "cost_function", "fit_by_pattern_search", "pattern_searches"]

Estimator = Literal["least-squares", "pattern-search"]
ESTIMATORS: tuple[Estimator, ...] = ("least-squares", "pattern-search")
"""Names of the estimators."""


def cost_function(problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings) -> CostMany:
    """Cost of many points in the scaled space: the weighted sum of squared residuals.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
        Gives the scaled space and the fixed parameters.
    settings : Settings

    Returns
    -------
    callable
        ``cost(theta, upper_limits)`` with theta of shape (n, K) gives shape (K,). A cost is infinite where the
        simulation diverged, and where the sum reaches its upper limit, shape (K,): the simulation is then aborted.
    """

    def cost(theta: Array, upper_limits: Array) -> Array:
        return problem.costs(space.named(space.from_scaled(theta)), settings, upper_limits)

    return cost


def pattern_searches(
    problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings, starts: Sequence[Array]
) -> tuple[PatternSearchResult, ...]:
    """Search from every start, each of shape (P,), SI, all at once; results are in the scaled space."""
    low, high = space.box
    theta = space.to_scaled(np.stack(starts, axis=1))
    return pattern_search(cost_function(problem, space, settings), theta, low, high)


def fit_by_pattern_search(
    problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings, start: Array
) -> OptimumWithJacobian:
    """Fit from one start, shape (P,), SI, with the residual and Jacobian that uncertainty and outcome need."""
    (end,) = pattern_searches(problem, space, settings, [start])
    theta = np.array(end.values)
    residual, jacobian = evaluate(problem, space, settings, theta)
    cost = float(residual @ residual)
    simulations = end.evaluations + 1 + len(theta)
    return OptimumWithJacobian(
        space.from_scaled(theta), cost, end.reason == "mesh", end.evaluations, simulations, residual, jacobian
    )
