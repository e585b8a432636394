"""The two ways to identify parameters within a search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import one_of
from brightgrey.estimation.optimisation.least_squares import fit_to_convergence
from brightgrey.estimation.optimisation.pattern_fit import ESTIMATORS, cost_function
from brightgrey.estimation.optimisation.pattern_search import pattern_search
from brightgrey.kit import Structure
from brightgrey.search.genetic.evaluation import Estimator, Evaluated, NamedValues
from brightgrey.search.task import IdentificationTask

__all__ = ["LeastSquares", "PatternSearch", "estimator"]


@dataclass(frozen=True)
class PatternSearch:
    """Pattern search from every start, as in the paper (section 3.1, step 4), all starts in one batch."""

    task: IdentificationTask
    iterations: int = 500  #: Limit for each start (paper: 500).
    patience: int = 0  #: Polls that have to be worth a hundredth of the cost; 0 if they need not.

    def __call__(self, structure: Structure, starts: Sequence[NamedValues]) -> Sequence[Evaluated]:
        """Identify `structure` from each of `starts`."""
        problem, space = self.task.problem_and_space(structure)

        cost_many = cost_function(problem, space, self.task.settings)
        low, high = space.box
        begins = space.to_scaled(self.task.clip_starts(space, starts))
        patience = self.patience or None
        found = pattern_search(cost_many, begins, low, high, iterations=self.iterations, patience=patience)
        ends = self.task.arrays(space, space.from_scaled(np.array([end.values for end in found]).T))
        return _evaluated(self.task, structure, ends, [end.evaluations for end in found], len(space.names))


@dataclass(frozen=True)
class LeastSquares:
    """Bounded least squares from every start."""

    task: IdentificationTask
    iterations: int = 50  #: Limit for each start.

    def __call__(self, structure: Structure, starts: Sequence[NamedValues]) -> Sequence[Evaluated]:
        """Identify `structure` from each of `starts`."""
        problem, space = self.task.problem_and_space(structure)
        begins = self.task.clip_starts(space, starts)
        ends = [
            fit_to_convergence(problem, space, self.task.settings, begin, limit=self.iterations) for begin in begins.T
        ]
        simulations = [end.simulations for end in ends]
        values = self.task.arrays(space, np.array([end.values for end in ends]).T.reshape(-1, len(starts)))
        return _evaluated(self.task, structure, values, simulations, len(space.names))


def _evaluated(
    task: IdentificationTask, structure: Structure, values: Mapping[str, Array], simulations: Sequence[int], free: int
) -> list[Evaluated]:
    """Results of all starts, judged by one more simulation each."""
    problem = task.problem(structure)
    return [
        Evaluated(
            values=tuple((name, float(values[name][i])) for name in structure.parameters),
            misfit=misfit,
            n_parameters=free,
            spent=problem.count(spent + 1),
        )
        for i, (misfit, spent) in enumerate(zip(task.misfits(structure, values), simulations, strict=True))
    ]


def estimator(name: str, task: IdentificationTask, iterations: int, patience: int = 0) -> Estimator:
    """Estimator by its name: ``pattern-search``, which ends where it is not worth its `patience`, or ``least-squares``.

    Raises
    ------
    SettingsError
        For any other name.
    """
    one_of("estimator", name, ESTIMATORS)
    return PatternSearch(task, iterations, patience) if name == "pattern-search" else LeastSquares(task, iterations)
