"""The loop of figure 5: identify all individuals, judge them, let them have offspring."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.errors import SettingsError
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import PAPER, Grammar, Structure
from brightgrey.search.criteria import Criterion, criterion
from brightgrey.search.fits import Fits
from brightgrey.search.genetic.evaluation import Estimator, Evaluated, Job
from brightgrey.search.genetic.history import Evaluation, Progress, Run
from brightgrey.search.genetic.lattice_evaluator import LatticeEvaluator
from brightgrey.search.genetic.offspring import Offspring, offspring, remutate_duplicates, untried_neighbours
from brightgrey.search.genetic.population import Draw, initial
from brightgrey.search.genetic.rules import Rules
from brightgrey.search.genetic.settings import GeneticSettings
from brightgrey.search.genetic.tree import Node, tree_of, with_values
from brightgrey.search.parallel import Stopped, in_order, thread_pool

__all__ = ["evolve"]

_LIMITED = 5  # times as long takes a simulation with a limited state


def evolve(
    estimator: Estimator,
    draw: Draw,
    settings: GeneticSettings | None = None,
    *,
    standard: Callable[[Structure], Mapping[str, float]] | None = None,
    fits: Fits | None = None,
    grammar: Grammar = PAPER,
    seed: int = 0,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Run:
    """Search for a structure by the paper's degenerate genetic programming.

    All draws are made here, one after the other, and the results of a generation are put in their order before
    anything is drawn again: the same seed gives the same run for any number of workers.

    Parameters
    ----------
    estimator : callable
        Identifies a structure from several starts; called wherever `executor` does.
    draw : callable
        Random parameters of a submodel.
    settings : GeneticSettings, optional
        The paper's by default.
    standard : callable, optional
        Start values of a structure by name, SI; needed where `settings` begin there.
    fits : Fits, optional
        Fits of the grammar's structures, needed where `settings` begin at relatives; then nothing is asked of
        `estimator`.
    grammar : Grammar
    seed : int
    workers : int
        Threads, if there is no executor.
    executor : concurrent.futures.Executor, optional
        The result does not depend on it.
    progress : callable, optional
        Called after every generation.

    Returns
    -------
    Run
        An interruption (Ctrl-C, or the executor says so) ends it with what is there so far.

    Raises
    ------
    SettingsError
        If the standard start or relatives are wanted and there are none.
    KeyboardInterrupt, Stopped
        If there is nothing so far.
    """
    settings = settings or GeneticSettings()
    start = _start(settings, standard, fits)
    rules, rng = Rules(grammar), np.random.default_rng(seed)
    judge = criterion(settings.criterion, settings.k_p)
    began = time.monotonic()
    done: list[Evaluation] = []
    born: Sequence[Offspring] = [
        Offspring(tree, (), "initial") for tree in initial(settings.population, rules, draw, rng)
    ]
    with thread_pool(executor, workers) as workforce:
        bench = _JobEvaluator(estimator, workforce)
        relatives = (
            LatticeEvaluator(fits, workforce, judge)
            if fits is not None and settings.start_from == "neighbours"
            else None
        )
        seeking = _seeking(settings.generations, relatives)
        for generation in range(settings.generations + 1):
            try:
                current = _evaluate(generation, born, start, relatives or bench, judge)
                done += current
                if relatives:
                    spent = relatives.seek(Run(tuple(done)).best.job.structure)
                    if generation in seeking:
                        spent += relatives.seek_missed()
                    done += _improved(done, relatives, judge)
                    done[-1] = _add_cost(done[-1], spent + relatives.update_effective_samples())
                    done, current = ([_shared(e, relatives.share, judge) for e in part] for part in (done, current))
                if progress:
                    share = (settings.generations - generation) / (generation + 1)
                    left = share * (time.monotonic() - began)
                    state = rng.bit_generator.state
                    progress(Progress(generation, settings.generations, Run(tuple(done)).best, left, state, current))
            except (KeyboardInterrupt, Stopped):
                if not done:
                    raise
                return Run(tuple(done), interrupted=True)
            trees = [e.tree for e in current]
            chances = judge.chances([e.value for e in current], current[0].result.misfit.independent)
            children = offspring(trees, chances, settings, rules, draw, rng)
            tried = {e.job.structure for e in done} | (relatives.eliminated() if relatives else set())
            best = [e.tree for e in Run(tuple(done)).structures() if not e.result.idle]
            close = untried_neighbours(best, tried, settings, rules, draw, rng)
            children = remutate_duplicates(
                children, tried | {b.tree.structure for b in close}, settings, rules, draw, rng
            )
            born = (*(Offspring(tree, (), "elite") for tree in best[: settings.elite]), *close, *children)
    return Run(tuple(done))


def _start(
    settings: GeneticSettings, standard: Callable[[Structure], Mapping[str, float]] | None, fits: Fits | None
) -> Callable[[Node], Job]:
    """Identification of an individual, with its start; none where it is left to relatives."""
    if settings.start_from == "inherited":
        return lambda tree: Job.of(tree.structure, tree.parameters)
    if settings.start_from == "neighbours":
        if fits is None:
            raise SettingsError("start_from is 'neighbours', but no fits were given")
        return lambda tree: Job(tree.structure, ())
    if standard is None:
        raise SettingsError("begin is 'standard', but no standard start was given")
    return lambda tree: Job.of(tree.structure, standard(tree.structure))


def _seeking(last: int, relatives: LatticeEvaluator | None) -> set[int]:
    """Generations after which optima that were missed are sought: early, since they say what has lost.

    Within narrow ranges little is missed, and it is done in the end only.
    """
    if relatives is None or relatives.narrow:
        return {last}
    return {max(1, last // 8), max(1, last // 3), last}


def _evaluate(
    generation: int,
    born: Sequence[Offspring],
    start: Callable[[Node], Job],
    bench: _JobEvaluator | LatticeEvaluator,
    judge: Criterion,
) -> list[Evaluation]:
    """Identify the individuals of one generation and judge them."""
    jobs = [start(b.tree) for b in born]
    results = (
        bench.identify([j.structure for j in jobs]) if isinstance(bench, LatticeEvaluator) else bench.identify(jobs)
    )
    return [
        Evaluation(
            generation=generation,
            individual=number,
            parents=b.parents,
            operator=b.operator,
            tree=with_values(b.tree, dict(result.values)),
            job=job,
            result=result,
            value=judge.value(result.misfit, result.n_parameters),
            repeated=repeated,
        )
        for number, (b, job, (result, repeated)) in enumerate(zip(born, jobs, results, strict=True))
    ]


def _improved(done: Sequence[Evaluation], relatives: LatticeEvaluator, judge: Criterion) -> list[Evaluation]:
    """Individuals of structures that are identified better than before, or were never bred, behind the latest ones."""
    latest, known = done[-1], {e.job.structure: e.tree for e in done}
    out = []
    for number, structure in enumerate(relatives.better, latest.individual + 1):
        result = relatives.evaluated(structure)
        values = dict(result.values)
        bred = structure in known
        out.append(
            Evaluation(
                generation=latest.generation,
                individual=number,
                parents=(),
                operator="neighbours",
                tree=with_values(known[structure], values) if bred else tree_of(structure, values),
                job=Job(structure, ()),
                result=result,
                value=judge.value(result.misfit, result.n_parameters),
                repeated=False,
            )
        )
    return out


def _add_cost(evaluation: Evaluation, spent: SimulationCount) -> Evaluation:
    """The same with what was `spent` beside it: on no individual, or without success."""
    return replace(evaluation, result=replace(evaluation.result, spent=evaluation.result.spent + spent))


def _shared(evaluation: Evaluation, share: float, judge: Criterion) -> Evaluation:
    """The same, judged anew with what is known now of how many samples are independent."""
    result = evaluation.result
    misfit = replace(result.misfit, share=share)
    value = judge.value(misfit, result.n_parameters)
    return replace(evaluation, result=replace(result, misfit=misfit), value=value)


@dataclass
class _JobEvaluator:
    """Has jobs identified, each one once; those of one structure side by side."""

    estimator: Estimator
    executor: Executor
    known: dict[Job, Evaluated] = field(default_factory=dict)

    def identify(self, jobs: Sequence[Job]) -> list[tuple[Evaluated, bool]]:
        """Results in the order of `jobs`, each with whether it had been there before: nothing was spent on it then."""
        fresh: dict[Structure, dict[Job, None]] = {}
        for job in jobs:
            if job not in self.known:
                fresh.setdefault(job.structure, {})[job] = None
        groups = sorted(fresh.items(), key=lambda group: -_effort(group[0]) * len(group[1]))
        calls = [(structure, tuple(job.start for job in wanted)) for structure, wanted in groups]
        results = in_order(self.executor, self.estimator, calls)
        first: set[Job] = set()
        for (_, wanted), result in zip(groups, results, strict=True):
            self.known |= zip(wanted, result, strict=True)
            first |= set(wanted)
        out = []
        for job in jobs:
            known = self.known[job]
            out.append((known, False) if job in first else (replace(known, spent=SimulationCount()), True))
            first.discard(job)
        return out


def _effort(structure: Structure) -> int:
    """Roughly how long a structure takes: by far the longest where a law of two ports is between limits."""
    return len(structure.parameters) * (_LIMITED if structure.has_hard_limit else 1)
