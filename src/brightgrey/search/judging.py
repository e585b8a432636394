"""Refits of single structures at level ``accurate``, each from the optima of all neighbouring structures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import Optimum, OptimumWithJacobian, evaluate, fit_many, polish
from brightgrey.kit import Structure
from brightgrey.search.comparison import Judged
from brightgrey.search.fitting import Fitted, Options, from_everywhere
from brightgrey.search.lattice import contains
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import REFIT
from brightgrey.search.task import FAST_LEVEL_ACCURACY, IdentificationTask
from brightgrey.search.warm_start import exchanged, growing_from_zero, handed_down, information

__all__ = ["Bench", "last_descent"]

Values = Mapping[str, float]


def _refit(
    task: IdentificationTask,
    structure: Structure,
    wanted: Sequence[Mapping[str, float]],
    seed: Sequence[int],
) -> Optimum:
    """Descend from the optima of neighbours, `wanted`, best first."""
    problem, space = task.problem_and_space(structure)
    begins = _starts(task, structure, wanted, seed)
    ends = fit_many(
        problem, space, task.settings, begins, limit=REFIT.iterations, tolerance=REFIT.tolerance, cost_to_beat=np.inf
    )
    return last_descent(task, structure, min(ends, key=lambda e: e.cost).values)


def _starts(
    task: IdentificationTask, structure: Structure, wanted: Sequence[Mapping[str, float]], seed: Sequence[int]
) -> Array:
    """Best starts from the values `wanted`, missing ones sampled, shape (P, S), SI."""
    problem, space = task.problem_and_space(structure)
    drawn = space.sample(REFIT.random_starts, np.random.default_rng(list(seed)))
    drawn = np.concatenate([space.start[:, None], drawn], axis=1)
    tried = []
    for values in wanted:
        block = np.array(drawn)
        held = [i for i, name in enumerate(space.names) if name in values]
        block[held] = np.array([values[space.names[i]] for i in held])[:, None]
        tried.append(block if len(held) < len(space.names) else block[:, :1])
    begins = np.concatenate(tried, axis=1) if tried else drawn
    begins = np.unique(np.clip(begins, space.low[:, None], space.high[:, None]), axis=1)
    cost = problem.costs(space.named(begins), task.settings)
    return np.asarray(begins[:, np.argsort(cost, kind="stable")[: REFIT.descents]])


def _refit_from(
    task: IdentificationTask, structure: Structure, larger: Sequence[Mapping[str, float]], rival: float
) -> Optimum:
    """Descend from the best values of supermodels; to convergence if that may lead below the cost `rival`."""
    end = _descent_from_best(task, structure, larger, rival)
    off = float(task.error_floor(task.problem(structure).weights, FAST_LEVEL_ACCURACY).sum())
    return last_descent(task, structure, end.values) if end.cost < REFIT.polish_below * rival + off else end


def _refit_from_everywhere(
    task: IdentificationTask, structure: Structure, seed: int, known: Sequence[Fitted]
) -> Optimum:
    """Fit by multistart with `known` optima among the starts, and polish the result."""
    found = from_everywhere(task, structure, Options(), seed, known)
    return last_descent(
        task, structure, np.array([found.values[n] for n in task.problem_and_space(structure)[1].names])
    )


def _refit_held(
    task: IdentificationTask, structure: Structure, values: Values, moved: Values, held: Values, rival: float
) -> Optimum:
    """Descend from `values` with some held and others moved, as long as that may lead to the cost `rival`.

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
    return last_descent(fixed, structure, end.values) if end.cost < REFIT.compared_below * rival else end


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


def last_descent(task: IdentificationTask, structure: Structure, begin: Array) -> Optimum:
    """Descend from `begin`, shape (P,), SI, to convergence at level ``accurate``."""
    problem, space = task.problem_and_space(structure)
    return polish(problem, space, replace(task.settings, level="accurate"), begin, tolerance=REFIT.polish_tolerance)


def _judged(task: IdentificationTask, structure: Structure, end: Optimum) -> Judged:
    """Refined fit with residual and Jacobian, which are too large to be sent or stored."""
    problem, space = task.problem_and_space(structure)
    settings = replace(task.settings, level="accurate")
    residual, jacobian = evaluate(problem, space, settings, space.to_scaled(end.values))
    inside = np.flatnonzero(space.active_bounds(end.values) == 0)
    values = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
    descent = OptimumWithJacobian(*end[:4], end.simulations + 1 + len(end.values), residual, jacobian)
    return Judged(structure, values, descent, len(space.names), tuple(inside.tolist()))


@dataclass
class Bench:
    """Refined fits of structures, made when they are asked for."""

    task: IdentificationTask  #: Task at the level of the search.
    fitted: Mapping[Structure, Fitted]
    executor: Executor  #: Makes the refits.
    seed: int = 0
    judged: dict[Structure, Judged] = field(default_factory=dict)
    #: Refits from a supermodel: structure, supermodel and the cost of that.
    tried: set[tuple[Structure, Structure, float]] = field(default_factory=set)
    sought: dict[Structure, int] = field(default_factory=dict)  #: Multistarts of each structure.
    vain: int = 0  #: Multistarts since the last that has helped.

    def judge(self, structure: Structure) -> Judged:
        """Refit `structure`."""
        (judged,) = self.judge_all([structure])
        return judged

    def judge_all(self, structures: Sequence[Structure]) -> list[Judged]:
        """Refit `structures` in parallel: none starts at the result of another one of them."""
        asked = []
        for s in structures:
            if s not in self.judged:
                seed = (self.seed, len(self.task.space(s, initial=True).names))
                asked.append((s, self.executor.submit(_refit, self.task, s, self._wanted(s), seed)))
        for s, end in asked:
            self.judged[s] = _judged(self.task, s, end.result())
        return [self.judged[s] for s in structures]

    def improve(self, structure: Structure) -> bool:
        """Refit from supermodels that meanwhile fit better; returns True if that has helped."""
        own, space = self.judged[structure], self.task.space(structure, initial=True)
        better = [
            j
            for s, j in self.judged.items()
            if s != structure and contains(s, structure) and j.cost < REFIT.improved * own.cost
        ]
        new = {(structure, j.structure, j.cost) for j in better} - self.tried
        if not new:
            return False
        self.tried |= new
        larger = [
            values
            for j in better
            for values in handed_down(j.values, self._information(j), j.structure, structure, space)
        ]
        end = self.executor.submit(_refit_from, self.task, structure, larger, own.cost).result()
        if end.cost >= REFIT.improved * own.cost:
            return False
        self.judged[structure] = _judged(self.task, structure, end)
        return True

    def seek(self, structure: Structure, fields: int) -> bool:
        """Refit by `fields` multistarts, with starts that no earlier one had; returns True if that has helped."""
        own, known, had = self.judged[structure], [self.fitted[structure]], self.sought.get(structure, 0)
        self.sought[structure] = had + fields
        self.vain += fields
        first = self.seed + REFIT.first_restart_seed + had
        calls = [(self.task, structure, seed, known) for seed in range(first, first + fields)]
        end = min(in_order(self.executor, _refit_from_everywhere, calls), key=lambda e: e.cost)
        if end.cost >= REFIT.improved * own.cost:
            return False
        self.vain = 0
        self.judged[structure] = _judged(self.task, structure, end)
        return True

    def held(
        self, structure: Structure, values: Values, moved: Values, held: Values, rival: float
    ) -> Callable[[], Judged]:
        """Refit from `values` with some held and others moved; returns a function that waits for the fit.

        The fit is made only as exact as needed to compare its cost with `rival`, and it is not stored.
        """
        end = self.executor.submit(_refit_held, self.task, structure, values, moved, held, rival)
        task = replace(self.task, fixed={**self.task.fixed, **held})
        return lambda: _judged(task, structure, end.result())

    def cost(self, structure: Structure) -> float:
        """Least known cost of `structure`: its own, or that of a refined submodel."""
        own = self.judged[structure].cost if structure in self.judged else self.fitted[structure].cost
        return min([own, *(j.cost for s, j in self.judged.items() if contains(structure, s))])

    def _information(self, judged: Judged) -> Array:
        """J' J by the estimated values, SI."""
        pace = self.task.space(judged.structure, initial=True).scale_derivative(judged.descent.values)
        return information(judged.descent.jacobian.T @ judged.descent.jacobian, pace)

    def _wanted(self, structure: Structure) -> list[Mapping[str, float]]:
        """Values of the structure's own fit and of its best neighbours."""
        own: list[Mapping[str, float]] = [self.fitted[structure].values] if structure in self.fitted else []
        kin: list[tuple[float, Mapping[str, float]]] = []
        for s, j in self.judged.items():
            if contains(structure, s) or contains(s, structure):
                kin.append((j.cost, j.values))
        for s, f in self.fitted.items():
            if s not in self.judged and (contains(s, structure) or contains(structure, s)) and not f.idle:
                kin.append((f.cost, f.values))
        kin.sort(key=lambda item: item[0])
        return own + [values for _, values in kin[: REFIT.neighbour_starts]]

    def outputs(self, structure: Structure, sets: Sequence[Mapping[str, float]]) -> Array:
        """Weighted residuals at the accurate level for some values, shape (residuals, K)."""
        problem = self.task.problem(structure)
        names = (*structure.parameters, *(part.name for part in problem.unknown_initial))
        start = {part.name: part.start for part in problem.unknown_initial}
        values = {name: np.array([{**start, **s}[name] for s in sets]) for name in names}
        return problem.residuals(values, replace(self.task.settings, level="accurate"))
