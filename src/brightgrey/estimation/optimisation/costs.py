"""Sum of squares of many parameter sets: the cost without what only derivatives need."""

from __future__ import annotations

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.pattern_search import CostMany
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = ["cost_function"]


def cost_function(problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings) -> CostMany:
    """Weighted sum of squared residuals of K points in the searched scale; infinite where a simulation diverged.

    Parameters
    ----------
    problem : SimulationErrorProblem
    search : ParameterSpace
        Gives the searched scale and the fixed parameters.
    settings : Settings

    Returns
    -------
    callable
        ``cost(theta, most)`` with theta of shape (n, K) gives shape (K,); infinite, too, where the sum reaches `most`,
        shape (K,): the simulation is then given up.
    """

    def cost(theta: Array, most: Array) -> Array:
        return problem.costs(search.named(search.from_scaled(theta)), settings, most)

    return cost
