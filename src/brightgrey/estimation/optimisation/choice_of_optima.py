"""Choice of the optima of a multistart from which descents go on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import SAME_OPTIMUM_RTOL, Optimum
from brightgrey.estimation.optimisation.options import FitOptions
from brightgrey.estimation.problem.parameter_space import ParameterSpace

__all__ = ["best_different", "finalists"]


def best_different(
    space: ParameterSpace, optima: Sequence[tuple[Optimum, Array]], options: FitOptions
) -> list[tuple[Optimum, Array]]:
    """The best optima, each with its start: nearly as good as the best, and no two alike in cost and parameters."""
    found: list[tuple[Optimum, Array]] = []
    for optimum, start in sorted(optima, key=lambda pair: pair[0].cost):
        if found and optimum.cost > options.continued_cost * found[0][0].cost:
            break
        alike = [o for o, _ in found if optimum.cost <= (1.0 + SAME_OPTIMUM_RTOL) * o.cost]
        if all(_distance(space, optimum, o) > options.finalist_distance for o in alike):
            found.append((optimum, start))
    return found[: options.continued]


def _distance(space: ParameterSpace, one: Optimum, other: Optimum) -> float:
    """Largest difference of two optima in the scaled space."""
    return float(np.abs(space.to_scaled(one.values) - space.to_scaled(other.values)).max(initial=0.0))


def finalists(space: ParameterSpace, optima: Sequence[Optimum], options: FitOptions) -> list[Optimum]:
    """Optima, best first, that may be the best at the final level: nearly as good as the best, and different."""
    chosen = [optima[0]]
    for optimum in optima[1:]:
        distance = min(_distance(space, optimum, other) for other in chosen)
        similar = optimum.cost <= options.finalist_cost * optima[0].cost
        if similar and distance > options.finalist_distance and len(chosen) < options.finalists:
            chosen.append(optimum)
    return chosen
