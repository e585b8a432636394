"""Refits of single structures at the level that counts, each begun from all that is known of its relatives."""

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
    """Descend from what relatives have found, `wanted`, best first."""
    problem, space = task.problem_and_space(structure)
    begins = _starts(task, structure, wanted, seed)
    ends = fit_many(
        problem, space, task.settings, begins, limit=REFIT.iterations, tolerance=REFIT.tolerance, cost_to_beat=np.inf
    )
    return last_descent(task, structure, min(ends, key=lambda e: e.cost).values)


def _starts(
    task: IdentificationTask, structure: Structure, wanted: Sequence[Mapping[str, float]], seed: Sequence[int]
) -> Array:
    """Best starts from the values `wanted`, what they lack drawn, shape (P, S), SI."""
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
    """Descend from the best of some values of larger structures; to the end if it may lead below the cost `rival`."""
    end = _descent_from_best(task, structure, larger, rival)
    off = float(
        task.error_floor(task.problem(structure).weights, FAST_LEVEL_ACCURACY).sum()
    )  # what this level may be off by
    return last_descent(task, structure, end.values) if end.cost < REFIT.polish_below * rival + off else end


def _refit_from_everywhere(
    task: IdentificationTask, structure: Structure, seed: int, known: Sequence[Fitted]
) -> Optimum:
    """Search anew, from `known` optima and everywhere else, and descend to the end from what is found."""
    found = from_everywhere(task, structure, Options(), seed, known)
    return last_descent(
        task, structure, np.array([found.values[n] for n in task.problem_and_space(structure)[1].names])
    )


def _refit_held(
    task: IdentificationTask, structure: Structure, values: Values, moved: Values, held: Values, rival: float
) -> Optimum:
    """Descend from `values` with some held and others moved, as long as that may lead to the cost `rival`.

    And from what makes up for those held. Where gaps make all rugged, from there no descent comes to an optimum that
    moves with the size: it is walked to in steps, too.
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
    """Let what is held grow step by step; each descent begins where the one before has ended."""
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
    """Last descent of `structure` from `begin`, shape (P,), SI, at the level ``accurate``."""
    problem, space = task.problem_and_space(structure)
    return polish(problem, space, replace(task.settings, level="accurate"), begin, tolerance=REFIT.polish_tolerance)


def _judged(task: IdentificationTask, structure: Structure, end: Optimum) -> Judged:
    """All that is compared of a structure; residual and Jacobian are too large to be sent or kept."""
    problem, space = task.problem_and_space(structure)
    settings = replace(task.settings, level="accurate")
    residual, jacobian = evaluate(problem, space, settings, space.to_scaled(end.values))
    inside = np.flatnonzero(space.active_bounds(end.values) == 0)
    values = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
    descent = OptimumWithJacobian(*end[:4], end.simulations + 1 + len(end.values), residual, jacobian)
    return Judged(structure, values, descent, len(space.names), tuple(inside.tolist()))


@dataclass
class Bench:
    """Keeps what has been refitted.

    Attributes
    ----------
    task : IdentificationTask
        Its level is that of the search.
    fitted : mapping of Structure to Fitted
    executor : concurrent.futures.Executor
        Makes the refits.
    seed : int
    judged : dict of Structure to Judged
    tried : set of (Structure, Structure, float)
        What was refitted from which larger structure, with the cost of that.
    sought : dict of Structure to int
        What was refitted from everywhere, and in how many fields of starts.
    vain : int
        Such fields since one has helped.
    """

    task: IdentificationTask
    fitted: Mapping[Structure, Fitted]
    executor: Executor
    seed: int = 0
    judged: dict[Structure, Judged] = field(default_factory=dict)
    tried: set[tuple[Structure, Structure, float]] = field(default_factory=set)
    sought: dict[Structure, int] = field(default_factory=dict)
    vain: int = 0

    def judge(self, structure: Structure) -> Judged:
        """Refit `structure`."""
        (judged,) = self.judge_all([structure])
        return judged

    def judge_all(self, structures: Sequence[Structure]) -> list[Judged]:
        """Refit `structures` side by side: none begins from what another one of them finds."""
        asked = []
        for s in structures:
            if s not in self.judged:
                seed = (self.seed, len(self.task.space(s, initial=True).names))
                asked.append((s, self.executor.submit(_refit, self.task, s, self._wanted(s), seed)))
        for s, end in asked:
            self.judged[s] = _judged(self.task, s, end.result())
        return [self.judged[s] for s in structures]

    def improve(self, structure: Structure) -> bool:
        """Refit from larger structures that have meanwhile come to fit better; whether that has helped."""
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
        """Refit from everywhere in `fields` fields of starts that neither the search nor a call before had.

        Returns whether it has helped.
        """
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
        """Refit from `values` with some held and others moved; what comes back waits for it, and nothing is kept.

        Nothing is asked but whether the cost comes near `rival`.
        """
        end = self.executor.submit(_refit_held, self.task, structure, values, moved, held, rival)
        task = replace(self.task, fixed={**self.task.fixed, **held})
        return lambda: _judged(task, structure, end.result())

    def cost(self, structure: Structure) -> float:
        """Least cost known of `structure`: its own, or that of a refitted one that it contains."""
        own = self.judged[structure].cost if structure in self.judged else self.fitted[structure].cost
        return min([own, *(j.cost for s, j in self.judged.items() if contains(structure, s))])

    def _information(self, judged: Judged) -> Array:
        """J' J by the estimated values, SI."""
        pace = self.task.space(judged.structure, initial=True).scale_derivative(judged.descent.values)
        return information(judged.descent.jacobian.T @ judged.descent.jacobian, pace)

    def _wanted(self, structure: Structure) -> list[Mapping[str, float]]:
        """Values of the structure's own fit and of its best relatives."""
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
