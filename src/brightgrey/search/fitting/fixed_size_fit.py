"""FitTable of a structure with an effect held at some size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import Optimum, fit_many
from brightgrey.kit import Structure
from brightgrey.search.fitting.refined_fit import Refined, refine
from brightgrey.search.fitting.warm_start import exchanged, growing_from_zero
from brightgrey.search.policy import REFIT
from brightgrey.search.task import IdentificationTask

__all__ = ["fit_at_fixed_size"]

Values = Mapping[str, float]


def fit_at_fixed_size(
    task: IdentificationTask,
    whole: IdentificationTask,
    structure: Structure,
    values: Values,
    moved: Values,
    held: Values,
    rival: float,
    whitening: Whitening,
) -> Refined:
    """Refined fit from `values` with some held and others moved; exact only as far as it may reach the cost `rival`.

    Descents are made on `task`, whose recordings may be coarser, the last one on the `whole`.

    Starts in which another effect compensates for a held one are tried, too. With a hard limit the cost is rugged, and
    the optimum moves with the size. So the size is also approached in steps (continuation).
    """
    begin = {**values, **moved, **held}
    fixed = replace(task, fixed={**task.fixed, **held})
    parts = [part for part in ([begin], exchanged(begin, structure, held)) if part]
    ends = [_descent_from_best(fixed, structure, part, rival) for part in parts]
    if fixed.problem(structure).has_hard_limit:
        ends += [_walk(task, structure, values, moved, held, steps, rival) for steps in REFIT.path_steps]
    end = min(ends, key=lambda e: e.cost)
    space = fixed.problem_and_space(structure)[1]
    best = dict(zip(space.names, end.values.tolist(), strict=True))
    fixed = replace(whole, fixed={**whole.fixed, **held})
    return refine(fixed, structure, best, whitening, np.inf if end.cost < REFIT.compared_below * rival else 0.0)


def _walk(
    task: IdentificationTask,
    structure: Structure,
    values: Values,
    moved: Values,
    held: Values,
    steps: int,
    rival: float,
) -> Optimum:
    """Approach the held values step by step; each descent starts at the optimum of the one before."""
    growing, now = growing_from_zero(structure), dict(values)
    for k in range(1, steps + 1):
        now |= {name: now[name] + (value - values[name]) / steps for name, value in moved.items()}
        here = {name: value * (k / steps if name in growing else 1.0) for name, value in held.items()}
        fixed = replace(task, fixed={**task.fixed, **here})
        end = _descent_from_best(fixed, structure, [now], rival)
        now |= dict(zip(fixed.problem_and_space(structure)[1].names, end.values.tolist(), strict=True))
    return end


def _descent_from_best(
    task: IdentificationTask, structure: Structure, some: Sequence[Mapping[str, float]], rival: float
) -> Optimum:
    """Descend from the best of some values, as long as that may lead to the cost `rival`."""
    problem, space = task.problem_and_space(structure)
    table = [[values.get(n, start) for n, start in zip(space.names, space.start, strict=True)] for values in some]
    begins = np.clip(np.array(table).T, space.low[:, None], space.high[:, None])
    cost = problem.costs(space.named(begins), task.settings)
    begin = begins[:, [int(np.argmin(cost))]]
    (end,) = fit_many(
        problem, space, task.settings, begin, limit=REFIT.iterations, tolerance=REFIT.tolerance, cost_to_beat=rival
    )
    return end
