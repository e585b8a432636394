"""The same search with many seeds, and what comes of it."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import astuple, dataclass, fields

import numpy as np

from brightgrey.kit import PAPER, Grammar, Structure
from brightgrey.paper.experiment import RecoveryVerdict, first_appearance, recovery_verdict
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

__all__ = ["RunSummary", "Summary", "genetic_search", "repetitions_csv", "summarise_run", "summary", "wilson_interval"]


@dataclass(frozen=True)
class RunSummary:
    """One search for a known truth.

    Attributes
    ----------
    seed : int
    best, last : str
        Best structure of all generations, and of the last one.
    best_verdict, last_verdict : str
        See :func:`brightgrey.paper.experiment.verdict`.
    first : int or None
        Generation in which the true structure first is in the population.
    simulations, passes, identifications : int
        Parameter sets that were simulated; the same, each counted by its share of the recordings' samples.
    generations : str
        Best structure of each generation, separated by spaces.
    """

    seed: int
    best: str
    last: str
    best_verdict: RecoveryVerdict
    last_verdict: RecoveryVerdict
    first: int | None
    simulations: int
    passes: int
    identifications: int
    generations: str


@dataclass(frozen=True)
class Summary:
    """Of several repetitions.

    Attributes
    ----------
    count : int
    true, extras : int
        Best individual of all generations has the true structure; the true one with redundant extras.
    interval, lenient : (float, float)
        Wilson intervals (95 %) of the rates of `true`, and of `true` or `extras`.
    last_true : int
        Best individual of the last generation has the true structure.
    seen : int
        The true structure was in some population, or identified beside one.
    first : float or None
        Median generation in which it first was; None if it was not in at least half of the runs.
    simulations, passes : float
        Medians.
    """

    count: int
    true: int
    extras: int
    interval: tuple[float, float]
    lenient: tuple[float, float]
    last_true: int
    seen: int
    first: float | None
    simulations: float
    passes: float


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
    """
    judge = criterion(settings.criterion, settings.k_p)
    with thread_pool(executor, workers) as pool:
        evaluator: Evaluator
        if settings.start_from == "neighbours":
            structures, last = tuple(grammar.structures()), settings.generations
            evaluator = LatticeEvaluator(
                task, structures, pool, judge, options=settings.options, seed=seed, generations=last
            )
        else:
            chosen = identify or estimator(settings.estimator, task, settings.iterations, settings.stall_polls)
            start = task.default_start if settings.start_from == "standard" else None
            evaluator = JobEvaluator(chosen, pool, judge, start)
        return evolve(evaluator, task.draw, settings, grammar=grammar, seed=seed, progress=progress)


def summarise_run(done: Run, truth: Structure, seed: int) -> RunSummary:
    """What a search for `truth` came to."""
    per_generation = [done.best_of(g).job.structure for g in range(done.generations)]
    best = done.best.job.structure
    return RunSummary(
        seed=seed,
        best=str(best),
        last=str(per_generation[-1]),
        best_verdict=recovery_verdict(best, truth),
        last_verdict=recovery_verdict(per_generation[-1], truth),
        first=first_appearance(done, truth),
        simulations=done.simulations,
        passes=round(done.passes),
        identifications=done.identifications,
        generations=" ".join(map(str, per_generation)),
    )


def summary(repetitions: Sequence[RunSummary]) -> Summary:
    """Rates over `repetitions`, at least one."""
    n = len(repetitions)
    true = sum(r.best_verdict == "true" for r in repetitions)
    extras = sum(r.best_verdict == "true with extras" for r in repetitions)
    first = float(np.median([np.inf if r.first is None else r.first for r in repetitions]))
    return Summary(
        count=n,
        true=true,
        extras=extras,
        interval=wilson_interval(true, n),
        lenient=wilson_interval(true + extras, n),
        last_true=sum(r.last_verdict == "true" for r in repetitions),
        seen=sum(r.first is not None for r in repetitions),
        first=first if np.isfinite(first) else None,
        simulations=float(np.median([r.simulations for r in repetitions])),
        passes=float(np.median([r.passes for r in repetitions])),
    )


def wilson_interval(successes: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Interval of a rate (Wilson 1927, doi:10.1080/01621459.1927.10502953)."""
    rate, share = successes / count, z * z / count
    middle = (rate + 0.5 * share) / (1.0 + share)
    half = z / (1.0 + share) * float(np.sqrt(rate * (1.0 - rate) / count + 0.25 * share / count))
    return max(0.0, middle - half), min(1.0, middle + half)


def repetitions_csv(repetitions: Iterable[RunSummary]) -> str:
    """One row per seed."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f.name for f in fields(RunSummary)])
    writer.writerows(["" if cell is None else cell for cell in astuple(r)] for r in repetitions)
    return text.getvalue()
