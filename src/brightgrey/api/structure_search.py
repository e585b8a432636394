"""From recordings to a structure: all structures one after the other, or the genetic search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import numpy as np

from brightgrey.api.to_si import Range, bounds_si, f_tanh_si, fixed_si
from brightgrey.errors import SettingsError
from brightgrey.estimation import scales, settings_for
from brightgrey.kit import Structure, function_set
from brightgrey.model.ranking import Row
from brightgrey.model.schema import CriterionPart
from brightgrey.recordings import Recording
from brightgrey.search import IdentificationTask
from brightgrey.search.evidence import Evidence
from brightgrey.search.exhaustive import ExhaustiveResult, SearchProgress, candidates, search_exhaustively
from brightgrey.search.genetic import GeneticSettings, Progress, Run, genetic_search, history_csv
from brightgrey.search.genetic.settings import TUNED_SETTINGS
from brightgrey.search.parallel import thread_pool

__all__ = ["SearchRequest", "SearchResult", "search_structure"]

T = TypeVar("T")
AFFORDABLE = 448 * 50_000  # structures times samples: up to half an hour


@dataclass(frozen=True)
class SearchResult:
    """What a search found: a structure with its estimates (SI), the ranking of all that were tried, and why."""

    structure: Structure
    values: Mapping[str, float]
    ranking: tuple[Row, ...]
    criterion: CriterionPart
    note: str
    files: Mapping[str, bytes] = field(default_factory=dict)
    evidence: Evidence | None = None
    run: Run | None = None
    stopped: bool = False

    def own(self, given: Mapping[str, T] | None) -> dict[str, T]:
        """Those of `given` that are about a parameter of the structure."""
        return {name: value for name, value in (given or {}).items() if name in self.structure.parameters}


@dataclass(frozen=True)
class SearchRequest:
    """What is asked of a search, in the recording's units.

    Attributes
    ----------
    how : {'auto', 'exhaustive'} or GeneticSettings
        ``auto`` is exhaustive while that takes minutes at most, else genetic.
    require, exclude : tuple of str
        Effects.
    bounds, fixed : mapping
        By names of parameters of any structure.
    f_tanh : float or None
    seed, workers : int
    progress : callable or None
        Called after every structure (`Stage`) or generation (`Progress`).
    executor : Executor or None
        Where evaluations are made; `workers` threads if there is none.
    """

    how: Literal["auto", "exhaustive"] | GeneticSettings
    require: tuple[str, ...]
    exclude: tuple[str, ...]
    bounds: Mapping[str, Range]
    fixed: Mapping[str, float]
    f_tanh: float | None
    seed: int
    workers: int
    progress: Callable[[SearchProgress | Progress], None] | None
    executor: Executor | None = None


def search_structure(recordings: Sequence[Recording], wish: SearchRequest) -> SearchResult:
    """Search the structures of the function set on `recordings`, which are of one drive and have the same outputs.

    Raises
    ------
    SettingsError
        For wrong bounds, values and effects, or if no structure could be simulated.
    """
    units = recordings[0].units
    widest = max(function_set().structures(), key=lambda s: len(s.parameters))
    known = scales(recordings)
    task = IdentificationTask(
        recordings=tuple(recordings),
        scales=known,
        settings=settings_for(recordings, known, None if wish.f_tanh is None else f_tanh_si(wish.f_tanh, units)),
        bounds=bounds_si(widest, wish.bounds, units),
        fixed=fixed_si(widest, wish.fixed, units),
    )
    structures = candidates(wish.require, wish.exclude, function_set())
    if isinstance(wish.how, GeneticSettings):
        if wish.require or wish.exclude:
            raise SettingsError("--require and --exclude belong to the exhaustive search")
        return _genetic(task, wish.how, wish)
    affordable = len(structures) * sum(r.samples for r in recordings) <= AFFORDABLE
    if wish.how == "exhaustive" or affordable or wish.require or wish.exclude:
        return _exhaustive(task, structures, wish)
    return _genetic(task, TUNED_SETTINGS, wish)


def _exhaustive(task: IdentificationTask, structures: Sequence[Structure], wish: SearchRequest) -> SearchResult:
    with thread_pool(wish.executor, wish.workers) as executor:
        done = search_exhaustively(task, structures, seed=wish.seed, executor=executor, progress=wish.progress)
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
        )
        for r in done.ranking
    )
    return SearchResult(
        structure=best.structure,
        values=best.values,
        ranking=rows,
        criterion=CriterionPart(name="BIC", value=done.ranking[0].criterion),
        note=_note_on_survey(done, len(structures)),
        evidence=done.evidence,
        stopped=done.evidence is None,
    )


def _note_on_survey(done: ExhaustiveResult, structures: int) -> str:
    if done.evidence is None:
        count = len(done.fitted)
        return f"stopped: {count} of {structures} structures fitted, the simple ones first; the best so far, unweighed"
    if structures == 1:
        return "one structure tried"
    count = len(done.evidence.minimal)
    return f"all {structures} structures tried; {count} minimal {'ones' if count > 1 else 'one'}"


def _genetic(task: IdentificationTask, settings: GeneticSettings, wish: SearchRequest) -> SearchResult:
    done = genetic_search(
        task,
        settings,
        wish.seed,
        workers=wish.workers,
        executor=wish.executor,
        progress=wish.progress,
        grammar=function_set(),
    )
    best = done.best
    if not best.value > float("-inf") or not best.result.misfit.fit_percent > float("-inf"):
        raise SettingsError("no structure gave a finite simulation; check units, bounds and --input-gain")
    return SearchResult(
        structure=best.job.structure,
        values=dict(best.result.values),
        ranking=_ranking(done, task),
        criterion=CriterionPart(name=settings.criterion, value=best.value),
        files={"history.csv": history_csv(done).encode()},
        note=_note(done, settings),
        run=done,
        stopped=done.interrupted,
    )


def _ranking(done: Run, task: IdentificationTask) -> tuple[Row, ...]:
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


def _note(done: Run, settings: GeneticSettings) -> str:
    count = len({e.job.structure for e in done.evaluations})
    end = f"interrupted after generation {done.generations - 1} of" if done.interrupted else "over"
    return (
        f"genetic search {end} {settings.generations} generations of {settings.population}: {count} structures tried,"
        f" {done.identifications} identifications, {done.simulations} simulations; others may fit as well"
    )
