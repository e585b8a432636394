"""History of a genetic search: every evaluation, and the best of them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.search.criteria import Criterion
from brightgrey.search.genetic.evaluation import Evaluated, Job
from brightgrey.search.genetic.offspring import Offspring
from brightgrey.search.genetic.tree import Node, with_values

__all__ = ["HISTORY_COLUMNS", "Evaluation", "Progress", "Run", "history_csv"]


@dataclass(frozen=True)
class Evaluation:
    """One individual of one generation."""

    #: Both from 0; generation 0 is the initial population.
    generation: int
    individual: int
    parents: tuple[int, ...]  #: Individuals of the generation before.
    operator: str  #: Such as ``initial``, ``clone``, ``recombination+point``.
    tree: Node  #: With the estimates as parameter values.
    job: Job  #: Structure and start.
    result: Evaluated
    value: float  #: Criterion; the larger, the better.
    repeated: bool  #: Taken from an earlier identification of the same job.

    @classmethod
    def of(
        cls,
        generation: int,
        number: int,
        individual: Offspring,
        job: Job,
        result: Evaluated,
        criterion: Criterion,
        *,
        repeated: bool = False,
    ) -> Evaluation:
        """Evaluation of an `individual` by its `result`, with the estimates in its tree."""
        return cls(
            generation=generation,
            individual=number,
            parents=individual.parents,
            operator=individual.operator,
            tree=with_values(individual.tree, dict(result.values)),
            job=job,
            result=result,
            value=criterion.value(result.misfit, result.n_parameters),
            repeated=repeated,
        )


@dataclass(frozen=True)
class Progress:
    """Progress of a search after a generation."""

    generation: int
    generations: int
    best: Evaluation
    seconds_left: float  #: A guess from the time so far.
    random: Mapping[str, Any]  #: State of the random generator that the next generation is drawn with.
    population: Sequence[Evaluation]  #: This generation.

    @property
    def fit_percent(self) -> float:
        """Fit of the best individual so far."""
        return self.best.result.misfit.fit_percent


@dataclass(frozen=True)
class Run:
    """A search."""

    evaluations: tuple[Evaluation, ...]  #: In the order of generations and individuals.
    interrupted: bool = False  #: Ended by the user before its last generation.

    @property
    def best(self) -> Evaluation:
        """Best individual of all generations, the first of equals."""
        return max(self.evaluations, key=lambda e: e.value)

    @property
    def generations(self) -> int:
        """Number of generations that were evaluated, the initial one included."""
        return self.evaluations[-1].generation + 1

    @property
    def spent(self) -> SimulationCount:
        """Simulations in all."""
        return sum((e.result.spent for e in self.evaluations), SimulationCount())

    @property
    def simulations(self) -> int:
        """Parameter sets that were simulated in all."""
        return self.spent.sets

    @property
    def passes(self) -> float:
        """Passes over the recordings: a set simulated on a beginning of them counts by its share of samples."""
        return self.spent.samples / self.evaluations[0].result.misfit.samples

    @property
    def identifications(self) -> int:
        """Identifications that were made, repeated ones not counted."""
        return sum(not e.repeated for e in self.evaluations)

    def generation(self, number: int) -> tuple[Evaluation, ...]:
        """Evaluations of one generation."""
        return tuple(e for e in self.evaluations if e.generation == number)

    def best_of(self, number: int) -> Evaluation:
        """Best individual of one generation."""
        return max(self.generation(number), key=lambda e: e.value)

    def structures(self) -> Iterator[Evaluation]:
        """Best evaluation of every structure that was tried, best first."""
        seen = set()
        for e in sorted(self.evaluations, key=lambda e: -e.value):
            if e.job.structure not in seen:
                seen.add(e.job.structure)
                yield e


HISTORY_COLUMNS = (
    *("generation", "individual", "parents", "operator", "structure", "tree", "n_parameters"),
    *("rss", "criterion", "simulations", "repeated", "start", "estimate"),
)


def history_csv(run: Run) -> str:
    """Every evaluation as one row; floats read back exactly, values are SI."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HISTORY_COLUMNS)
    for e in run.evaluations:
        writer.writerow(
            (
                e.generation,
                e.individual,
                " ".join(map(str, e.parents)),
                e.operator,
                str(e.job.structure),
                str(e.tree),
                e.result.n_parameters,
                " ".join(map(repr, e.result.misfit.rss)),
                repr(e.value),
                e.result.simulations,
                "true" if e.repeated else "false",
                _assignments(e.job.start),
                _assignments(e.result.values),
            )
        )
    return text.getvalue()


def _assignments(values: tuple[tuple[str, float], ...]) -> str:
    return " ".join(f"{name}={value!r}" for name, value in values)
