"""What the best structure's identification is worth to others: a start near their own best ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from brightgrey.kit import Placed, Structure
from brightgrey.search.evaluation import Job
from brightgrey.search.fitting import IMPROVED
from brightgrey.search.genetic.offspring import Born
from brightgrey.search.genetic.record import Evaluation, Run
from brightgrey.search.genetic.relatives import independent
from brightgrey.search.genetic.tree import Node, Values, attach, drop, relabel, with_values
from brightgrey.search.identification import Identification
from brightgrey.search.lattice import contains, ladder_of, simpler

__all__ = ["Leaders", "reshaped"]


class Leaders:
    """Follows the best structure of a search.

    The optimum of a structure with one effect less, or with more, is often near that of the leader. From a start that
    knows nothing of it the structure may end in another one, and what the leader has beyond it then seems to be needed.

    Parameters
    ----------
    structures : sequence of Structure
        All of the grammar.
    standard : callable
        Start values of a structure by name, SI, where the leader has none.
    task : Identification, optional
        What tells how many samples are independent; without it all are.
    """

    def __init__(
        self,
        structures: Sequence[Structure],
        standard: Callable[[Structure], Mapping[str, float]],
        task: Identification | None = None,
    ) -> None:
        self._structures, self._standard = structures, standard
        self._task = task and replace(task, settings=replace(task.settings, level="accurate"))
        self._led: dict[Structure, float] = {}
        self._offered: set[tuple[Structure, Structure, float]] = set()
        self._best: dict[Structure, Evaluation] = {}
        self._begun: set[Job] = set()

    def listen(self, done: Sequence[Evaluation]) -> float:
        """Share of the samples that are independent: what the closest fit does not explain counts as noise."""
        best = min(done, key=lambda e: (_rss(e), e.result.n_parameters))
        if self._task is None or not _rss(best) < float("inf"):
            return 1.0
        return independent(self._task, best.job.structure, dict(best.result.values))

    def job(self, structure: Structure) -> Job:
        """Identification of `structure` from the standard start, or its best one so far where that has been made."""
        begun = Job.of(structure, self._standard(structure))
        return self._best[structure].job if begun in self._begun else begun

    def born(self, done: Sequence[Evaluation]) -> tuple[Born, ...]:
        """Individuals that start from the leader's estimates; none if they have been before."""
        self._best = {e.job.structure: e for e in Run(tuple(done)).structures()}
        self._begun = {e.job for e in done}
        leader = next(iter(self._best.values()))
        structure, least = leader.job.structure, _rss(leader)
        wanted = [("+insertion", s) for s in self._larger(structure, least)]
        if least < IMPROVED * self._led.get(structure, float("inf")):
            self._led[structure] = least
            wanted += [("", structure), *(("+deletion", s) for s in simpler(structure, self._structures))]
        known = dict(leader.result.values)
        return tuple(
            Born(reshaped(leader.tree, s, {**self._standard(s), **known}), (), f"leader{step}") for step, s in wanted
        )

    def _larger(self, structure: Structure, least: float) -> list[Structure]:
        """Structures that contain `structure` and are worse, to which its optimum has not been offered yet."""
        worse = [s for s, e in self._best.items() if contains(s, structure) and least < IMPROVED * _rss(e)]
        fresh = [s for s in worse if s != structure and (s, structure, least) not in self._offered]
        self._offered.update((s, structure, least) for s in fresh)
        return fresh


def reshaped(tree: Node, structure: Structure, named: Mapping[str, float]) -> Node:
    """`tree` with the nodes that `structure` needs, those that it has where they are; `named` are all values."""
    for index in reversed(range(tree.size)):
        type = tree.types[index]
        if type.effect.masses:
            ladder = ladder_of(structure)
            tree = relabel(tree, index, ladder, _unknown(ladder))
        elif type not in structure.placed:
            tree = drop(tree, index) or tree  # the masses stay: something is always left
    for placed in structure.placed:
        if placed not in tree.types:
            tree = attach(tree, 0, Node(placed, _unknown(placed)))
    return with_values(tree, named)


def _unknown(placed: Placed) -> Values:
    return tuple((q.symbol, 0.0) for q in placed.effect.parameters)


def _rss(evaluation: Evaluation) -> float:
    return sum(evaluation.result.misfit.floored)
