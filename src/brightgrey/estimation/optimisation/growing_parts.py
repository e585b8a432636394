"""Growing parts of the recordings, and a population of fits that follows them.

Contacts and unstable motions make the valley of the cost narrower the longer the recording is. So a drive with them is
fitted on a first part that grows. A gap shows its width when it is crossed for the first time. Until then the cost says
nothing about the width, and afterwards a descent from a wrong one leads nowhere. So a population draws its parameters
anew before each longer part, as far as the last part has left them open (Chopin 2002, doi:10.1093/biomet/89.3.539).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from brightgrey.arrays import Array, positive
from brightgrey.estimation.optimisation.least_squares import Optimum, fit_many
from brightgrey.estimation.optimisation.options import MULTISTART_DEFAULTS, MultistartOptions, PopulationOptions
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = ["follow_growing_parts", "growing_horizons", "growing_parts"]


def growing_horizons(share: float, options: MultistartOptions = MULTISTART_DEFAULTS) -> Iterator[float]:
    """Growing parts of the excitation, less than the whole, on which a drive is fitted in succession.

    From one part to the next, the estimate has to improve more than the valley narrows.
    """
    while share < 1.0:
        yield share
        share *= options.share_growth


def growing_parts(problem: SimulationErrorProblem, shares: Iterator[float]) -> list[SimulationErrorProblem]:
    """Problems on the first parts of the recordings, each longer than the one before, none of them the whole."""
    parts = [problem.truncated(share) for share in shares]
    longer = [k == 0 or part.samples > parts[k - 1].samples for k, part in enumerate(parts)]
    return [part for part, more in zip(parts, longer, strict=True) if more and part.samples < problem.samples]


def follow_growing_parts(
    parts: Sequence[SimulationErrorProblem],
    space: ParameterSpace,
    settings: Settings,
    starts: Array,
    rng: np.random.Generator,
    options: MultistartOptions = MULTISTART_DEFAULTS,
) -> tuple[list[Array], SimulationCount]:
    """Fit a population on growing parts, of which each takes the best fits of the last one and draws around them.

    Parameters
    ----------
    parts : sequence of SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    starts : ndarray, shape (P, S)
        SI, of the fits on the first part.
    rng : numpy.random.Generator
    options : MultistartOptions

    Returns
    -------
    list of ndarray, shape (P,)
        Best fits of the longest part, SI, best first. They derive from one another.
    SimulationCount
    """
    how, limit, simulations = options.population, options.first_rounds, SimulationCount()
    optima: list[Optimum] = []
    for number, part in enumerate(parts):
        if number:
            drawn = _draws_around(space, optima, parts[number - 1].samples, rng, how)
            starts = _best_on_part(part, space, settings, optima, drawn)
            simulations += part.count(len(optima) + drawn.shape[1])
            limit = options.stage_rounds
        ends = fit_many(part, space, settings, starts, limit=limit, tolerance=options.stage_tolerance)
        simulations += part.count(sum(e.simulations for e in ends))
        optima = _distinct_ends(space, ends, how)
    return [optimum.values for optimum in optima[: how.ends]], simulations


def _draws_around(
    space: ParameterSpace, optima: Sequence[Optimum], samples: int, rng: np.random.Generator, how: PopulationOptions
) -> Array:
    """Draws from the normal distributions that the curvature of each optimum gives, shape (P, K), SI."""
    low, high = space.box
    drawn = []
    for numbers, optimum in zip(np.array_split(np.arange(how.draws), len(optima)), optima, strict=True):
        curvature, axes = np.linalg.eigh(optimum.curvature)
        variance = optimum.cost / max(samples - len(low), 1)
        deviation = np.minimum(how.spread * np.sqrt(variance / positive(curvature)), how.largest_shift)
        shifts = (rng.standard_normal((len(numbers), len(low))) * deviation) @ axes.T
        drawn.append(np.clip(space.to_scaled(optimum.values) + shifts, low, high))
    return space.from_scaled(np.concatenate(drawn).T)


def _best_on_part(
    part: SimulationErrorProblem, space: ParameterSpace, settings: Settings, optima: Sequence[Optimum], drawn: Array
) -> Array:
    """Better half of the optima of the last part, and as many of the rest as there were optima, shape (P, S), SI.

    A draw that does worse than every optimum is given up.
    """
    own = np.stack([optimum.values for optimum in optima], axis=1)
    cost = part.costs(space.named(own), settings)
    order = np.argsort(cost, kind="stable")
    kept = order[: (len(order) + 1) // 2]
    rest = np.concatenate([own[:, order[len(kept) :]], drawn], axis=1)
    limits = np.full(drawn.shape[1], cost.max())
    others = np.concatenate([cost[order[len(kept) :]], part.costs(space.named(drawn), settings, limits)])
    chosen = np.argsort(others, kind="stable")[: len(order) - len(kept)]
    return np.concatenate([own[:, kept], rest[:, chosen]], axis=1)


def _distinct_ends(space: ParameterSpace, ends: Sequence[Optimum], how: PopulationOptions) -> list[Optimum]:
    """Best of the fits, best first, of which no two differ by less than the part can show."""
    found: list[Optimum] = []
    for end in sorted(ends, key=lambda e: e.cost):
        steps = [(space.to_scaled(end.values) - space.to_scaled(o.values), o) for o in found]
        if len(found) < how.size and all(s @ o.curvature @ s > how.same_place * o.cost for s, o in steps):
            found.append(end)
    return found
