"""One genetic search: the evaluator that the settings ask for, and the engine."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

from brightgrey.kit import PAPER, Grammar
from brightgrey.search.criteria import criterion
from brightgrey.search.genetic.engine import Evaluator, evolve
from brightgrey.search.genetic.estimators import estimator
from brightgrey.search.genetic.evaluation import Estimator
from brightgrey.search.genetic.history import Progress, Run
from brightgrey.search.genetic.job_evaluator import JobEvaluator
from brightgrey.search.genetic.lattice_evaluator import LatticeEvaluator
from brightgrey.search.genetic.settings import GeneticSettings
from brightgrey.search.parallel import thread_pool
from brightgrey.search.task import IdentificationTask

__all__ = ["genetic_search"]


def genetic_search(
    task: IdentificationTask,
    settings: GeneticSettings,
    seed: int,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
    identify: Estimator | None = None,
    grammar: Grammar = PAPER,
) -> Run:
    """Search once on `task` by genetic programming.

    Parameters
    ----------
    task : IdentificationTask
    settings : GeneticSettings
    seed : int
    workers : int
        Threads, if there is no executor.
    executor : concurrent.futures.Executor, optional
        Makes the identifications; the result does not depend on it.
    progress : callable, optional
        Called after every generation.
    identify : Estimator, optional
        Replaces the estimator of `settings`.
    grammar : Grammar
        What it holds back may be part of any individual.
    """
    judge = criterion(settings.criterion, settings.k_p)
    with thread_pool(executor, workers) as pool:
        evaluator: Evaluator
        if settings.start_from == "neighbours":
            structures, last = tuple(grammar.structures()), settings.generations
            evaluator = LatticeEvaluator(
                task,
                structures,
                pool,
                judge,
                options=settings.options,
                seed=seed,
                generations=last,
                holds_back=bool(grammar.further),
            )
        else:
            chosen = identify or estimator(settings.estimator, task, settings.iterations, settings.stall_polls)
            start = task.default_start if settings.start_from == "standard" else None
            evaluator = JobEvaluator(chosen, pool, judge, start)
        return evolve(evaluator, task.draw, settings, grammar=grammar.whole, seed=seed, progress=progress)
