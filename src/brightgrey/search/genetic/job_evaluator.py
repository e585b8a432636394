"""Evaluation of individuals as independent identifications, each from its own start (paper section 3.1, step 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Structure
from brightgrey.search.criteria import Criterion
from brightgrey.search.genetic.evaluation import Estimator, Evaluated, Job
from brightgrey.search.genetic.history import Evaluation
from brightgrey.search.genetic.offspring import Offspring
from brightgrey.search.genetic.settings import HEURISTICS
from brightgrey.search.genetic.tree import Node
from brightgrey.search.parallel import in_order

__all__ = ["JobEvaluator"]


@dataclass
class JobEvaluator:
    """Evaluator that identifies each job once; jobs of one structure run side by side."""

    estimator: Estimator
    executor: Executor  #: Calls the estimator.
    criterion: Criterion
    #: Start values of a structure by name, SI. By default an individual starts at the values of its nodes, inherited
    #: or random.
    default_start: Callable[[Structure], Mapping[str, float]] | None = None
    _known: dict[Job, Evaluated] = field(default_factory=dict, repr=False)

    def evaluate(self, generation: int, born: Sequence[Offspring]) -> list[Evaluation]:
        """Identify the individuals of a generation."""
        jobs = [self._job(individual.tree) for individual in born]
        return [
            Evaluation.of(generation, number, individual, job, result, self.criterion, repeated=repeated)
            for number, (individual, job, (result, repeated)) in enumerate(
                zip(born, jobs, self._identify(jobs), strict=True)
            )
        ]

    def revise(self, evaluations: Sequence[Evaluation]) -> list[Evaluation]:
        """Return the evaluations as they are: no job learns from another."""
        return list(evaluations)

    def has_lost(self, structure: Structure) -> bool:
        """Return False: of no structure it is known that it cannot win any more."""
        return False

    def _job(self, tree: Node) -> Job:
        return Job.of(tree.structure, self.default_start(tree.structure) if self.default_start else tree.parameters)

    def _identify(self, jobs: Sequence[Job]) -> list[tuple[Evaluated, bool]]:
        """Results in the order of `jobs`; a job that was identified before is marked and costs nothing."""
        unknown: dict[Structure, dict[Job, None]] = {}
        for job in jobs:
            if job not in self._known:
                unknown.setdefault(job.structure, {})[job] = None
        groups = sorted(unknown.items(), key=lambda group: -_effort(group[0]) * len(group[1]))
        calls = [(structure, tuple(job.start for job in wanted)) for structure, wanted in groups]
        results = in_order(self.executor, self.estimator, calls)
        first: set[Job] = set()
        for (_, wanted), result in zip(groups, results, strict=True):
            self._known |= zip(wanted, result, strict=True)
            first |= set(wanted)
        out = []
        for job in jobs:
            known = self._known[job]
            out.append((known, False) if job in first else (replace(known, spent=SimulationCount()), True))
            first.discard(job)
        return out


def _effort(structure: Structure) -> int:
    """Rough simulation time of a structure: by far the longest with a hard limit."""
    return len(structure.parameters) * (HEURISTICS.hard_limit_cost if structure.has_hard_limit else 1)
