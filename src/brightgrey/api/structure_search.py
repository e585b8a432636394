"""From recordings to a structure: by the border of the adequate ones, or by the genetic search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from brightgrey.errors import SettingsError, one_of
from brightgrey.kit import Grammar, Structure, grammar_named
from brightgrey.model.ranking import Row
from brightgrey.model.schema import CriterionPart
from brightgrey.search import IdentificationTask
from brightgrey.search.decision import Decision, decide_structures
from brightgrey.search.evidence import Evidence
from brightgrey.search.genetic import GeneticSettings, Progress, Run, genetic_search, history_csv
from brightgrey.search.parallel import thread_pool
from brightgrey.search.progress import SearchProgress
from brightgrey.search.undecided.question import UNDECIDED_FILE

__all__ = ["SearchKind", "SearchRequest", "SearchResult", "grammar_searched", "search_structure"]

SearchKind = Literal["auto", "exhaustive"] | GeneticSettings


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes
    ----------
    structure : Structure
        The best one.
    starts : sequence of mapping of str to float
        Its estimates, SI, at one optimum or several: the last fit starts there.
    ranking : tuple of Row
        All structures that were fitted, best first.
    criterion : CriterionPart
    search : {'auto', 'exhaustive', 'genetic'}
        Its kind.
    grammar : str
        Name of the function set.
    note : str
        One sentence about the search.
    files : mapping of str to bytes
        Further results by file name.
    evidence : Evidence or None
        Of any search but the genetic one.
    run : Run or None
        Of a genetic search.
    stopped : bool
        The search was stopped before its end.
    optima : mapping of Structure to mapping of str to float
        Best values of all structures that were fitted, SI; none after a genetic search.
    """

    structure: Structure
    starts: Sequence[Mapping[str, float]]
    ranking: tuple[Row, ...]
    criterion: CriterionPart
    search: Literal["auto", "exhaustive", "genetic"]
    grammar: str
    note: str
    files: Mapping[str, bytes] = field(default_factory=dict)
    evidence: Evidence | None = None
    run: Run | None = None
    stopped: bool = False
    optima: Mapping[Structure, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class SearchRequest:
    """Kind and limits of a search.

    Attributes
    ----------
    how : {'auto', 'exhaustive'} or GeneticSettings
        ``auto`` fits what the decision rests on, ``exhaustive`` every structure; both decide by the same rules.
    grammar : Grammar
    require, exclude : tuple of str
        Effects.
    seed, workers : int
    progress : callable or None
        Called after every structure (`SearchProgress`) or generation (`Progress`).
    executor : Executor or None
        Runs the evaluations; `workers` threads if it is None.
    """

    how: SearchKind
    grammar: Grammar
    require: tuple[str, ...]
    exclude: tuple[str, ...]
    seed: int
    workers: int
    progress: Callable[[SearchProgress | Progress], None] | None
    executor: Executor | None = None


def grammar_searched(search: SearchKind | None, name: str | None) -> Grammar:
    """Function set of a search: the one called `name`, or by default ``drive`` for the border and else ``paper``.

    Raises
    ------
    StructureError, SettingsError
        For an unknown name or search, and for an exhaustive search of a function set that is too large for it.
    """
    if search is not None and not isinstance(search, GeneticSettings):
        one_of("search", search, ("auto", "exhaustive"))
    grammar = grammar_named(name or ("drive" if search in (None, "auto") else "paper"))
    if search == "exhaustive" and grammar.held_back:
        raise SettingsError(
            f"an exhaustive search fits every structure, and '{grammar.name}' has millions: take 'paper'"
        )
    return grammar


def search_structure(task: IdentificationTask, request: SearchRequest) -> SearchResult:
    """Search the structures of the function set.

    Raises
    ------
    SettingsError
        For an unknown effect, or if no structure could be simulated.
    """
    if isinstance(request.how, GeneticSettings):
        if request.require or request.exclude:
            raise SettingsError("--require and --exclude do not belong to the genetic search")
        return _genetic(task, request.how, request)
    with thread_pool(request.executor, request.workers) as executor:
        done = decide_structures(
            task,
            request.grammar,
            require=request.require,
            exclude=request.exclude,
            how="exhaustive" if request.how == "exhaustive" else "border",
            seed=request.seed,
            executor=executor,
            progress=request.progress,
        )
    best = done.best
    factors = np.array([signal.factor for signal in task.recordings[0].outputs])
    weights = task.weights(best.structure)
    rows = tuple(
        Row(
            structure=str(r.structure),
            n_parameters=r.free,
            rss=float(np.sum(r.misfit.rss * (factors / weights) ** 2)),
            fit_percent=r.misfit.fit_percent,
            criterion=r.criterion,
            tied=r.equivalent,
            status=r.status,
        )
        for r in done.ranking
    )
    questions = done.evidence.questions if done.evidence else None
    return SearchResult(
        structure=best.structure,
        starts=done.starts,
        ranking=rows,
        criterion=CriterionPart(name="BIC", value=done.ranking[0].criterion),
        search=request.how,
        grammar=request.grammar.name,
        note=_note(done),
        files={UNDECIDED_FILE: questions.text().encode()} if questions else {},
        evidence=done.evidence,
        stopped=done.evidence is None,
        optima=done.optima,
    )


def _note(done: Decision) -> str:
    count = len(done.fitted)
    if done.evidence is None:
        return f"stopped: {count} structures fitted; the best so far; no verdict on effects yet"
    certificate = done.evidence.certificate
    if certificate.structures == 1:
        return "one structure tried"
    if certificate.undecided:
        return f"{count} structures were fitted; the budget ended before all {certificate.structures:,} were decided"
    return f"{count} structures were fitted, which decide all {certificate.structures:,}"


def _genetic(task: IdentificationTask, settings: GeneticSettings, request: SearchRequest) -> SearchResult:
    done = genetic_search(
        task,
        settings,
        request.seed,
        workers=request.workers,
        executor=request.executor,
        progress=request.progress,
        grammar=request.grammar,
    )
    best = done.best
    if not best.value > float("-inf") or not best.result.misfit.fit_percent > float("-inf"):
        raise SettingsError("no structure gave a finite simulation; check units, bounds and --input-gain")
    return SearchResult(
        structure=best.job.structure,
        starts=[dict(best.result.values)],
        ranking=_rank_evaluations(done, task),
        criterion=CriterionPart(name=settings.criterion, value=best.value),
        search="genetic",
        grammar=request.grammar.name,
        files={"history.csv": history_csv(done).encode()},
        note=_note_on_genetic(done, settings),
        run=done,
        stopped=done.interrupted,
    )


def _rank_evaluations(done: Run, task: IdentificationTask) -> tuple[Row, ...]:
    """Every structure that was tried, by its best identification at the level of the search, in the outputs' units."""
    factors = np.array([signal.factor for signal in task.recordings[0].outputs])
    return tuple(
        Row(
            structure=str(e.job.structure),
            n_parameters=e.result.n_parameters,
            rss=float(np.sum(e.result.misfit.rss * (factors / task.weights(e.job.structure)) ** 2)),
            fit_percent=e.result.misfit.fit_percent,
            criterion=e.value,
        )
        for e in done.structures()
    )


def _note_on_genetic(done: Run, settings: GeneticSettings) -> str:
    count = len({e.job.structure for e in done.evaluations})
    end = f"interrupted after generation {done.generations - 1} of" if done.interrupted else "over"
    return (
        f"genetic search {end} {settings.generations} generations of {settings.population}: {count} structures tried,"
        f" {done.identifications} identifications, {done.simulations} simulations; others may fit as well"
    )
