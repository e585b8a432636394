"""Estimation by pattern search, the paper's estimator (section 3.1, step 4), in place of least squares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.optimisation.costs import cost_function
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, evaluate
from brightgrey.estimation.optimisation.pattern_search import PatternEnd, pattern_search
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = ["Estimator", "check_estimator", "pattern_descent", "pattern_searches"]

Estimator = Literal["least-squares", "pattern-search"]
ESTIMATORS: tuple[Estimator, ...] = ("least-squares", "pattern-search")
ITERATIONS = 500
"""Of one search; the paper's limit (section 4)."""


def check_estimator(text: str) -> Estimator:
    """Return `text` if it is an estimator.

    Raises
    ------
    SettingsError
        Names the nearest one.
    """
    for allowed in ESTIMATORS:
        if text == allowed:
            return allowed
    raise SettingsError(unknown_name("estimator", text, ESTIMATORS))


def pattern_searches(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, begins: Sequence[Array]
) -> tuple[PatternEnd, ...]:
    """Pattern search from every start, SI, all side by side; ends stand in the searched scale."""
    low, high = search.box
    theta = search.to_scaled(np.stack(begins, axis=1))
    return pattern_search(cost_function(problem, search, settings), theta, low, high, iterations=ITERATIONS)


def pattern_descent(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, begin: Array
) -> OptimumWithJacobian:
    """Pattern search from one start, SI, with residual and Jacobian where it ended, for uncertainty and outcome."""
    (end,) = pattern_searches(problem, search, settings, [begin])
    theta = np.array(end.values)
    residual, jacobian = evaluate(problem, search, settings, theta)
    cost = float(residual @ residual)
    simulations = end.evaluations + 1 + len(theta)
    return OptimumWithJacobian(
        search.from_scaled(theta), cost, end.reason == "mesh", end.evaluations, simulations, residual, jacobian
    )
