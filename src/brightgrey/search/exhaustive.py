"""Search of all structures of a grammar: fits, ranking, and the verdict on every effect."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass

import numpy as np

from brightgrey.errors import SettingsError, unknown_name
from brightgrey.kit import PAPER, Grammar, Placed, Structure
from brightgrey.search.comparison import Judged
from brightgrey.search.criteria import Misfit, bic
from brightgrey.search.evidence import Evidence, assess_effects, has
from brightgrey.search.fits import Fits
from brightgrey.search.fitting import Fitted, Options
from brightgrey.search.lattice import one_larger
from brightgrey.search.missed import seek_missed
from brightgrey.search.parallel import Stopped, thread_pool
from brightgrey.search.policy import BUDGET
from brightgrey.search.task import IdentificationTask

__all__ = ["ExhaustiveResult", "Ranked", "SearchProgress", "candidates", "fit_all", "search_exhaustively"]


@dataclass(frozen=True)
class SearchProgress:
    """Progress of a search: the name of its stage, how much of it is done, and the best structure so far."""

    name: str
    done: int
    total: int | None
    structure: Structure


@dataclass(frozen=True)
class Ranked:
    """Structure in the ranking."""

    structure: Structure
    free: int  #: Number of estimated parameters.
    misfit: Misfit  #: At the level of the search; of a refitted structure at level ``accurate``.
    criterion: float  #: Bayesian information criterion with the number of independent samples; less is better.
    equivalent: bool  #: Minimal, or minimal with one optional effect.


@dataclass(frozen=True)
class ExhaustiveResult:
    """Result of :func:`search_exhaustively`."""

    ranking: tuple[Ranked, ...]  #: Minimal structures first, then by the criterion.
    evidence: Evidence | None  #: None if the search was stopped before its end.
    fitted: Mapping[Structure, Fitted]

    @property
    def best(self) -> Judged | Fitted:
        """The first minimal structure; the one with the best criterion if there is no evidence."""
        return self.evidence.minimal[0] if self.evidence else self.fitted[self.ranking[0].structure]


def candidates(
    require: Sequence[str] = (), exclude: Sequence[str] = (), grammar: Grammar = PAPER
) -> tuple[Structure, ...]:
    """Structures of a grammar that have all required effects and none of the excluded ones.

    Parameters
    ----------
    require, exclude : sequence of str
        Placed effects. Masses count cumulatively: ``two_mass`` required means at least two, ``three_mass`` excluded
        at most two.
    grammar : Grammar

    Raises
    ------
    SettingsError
        For an effect that the grammar lacks or that is both required and excluded, or if no structure is left.
    """
    known = {str(Placed(name, place)) for name, places in grammar.places.items() for place in places}
    for name in (*require, *exclude):
        if name not in known:
            raise SettingsError(unknown_name("effect", name, sorted(known)))
    for name in exclude:
        if Placed.parse(name).effect.masses == 1:
            raise SettingsError(f"'{name}' cannot be excluded: every structure has one mass at least")
    for name in require:
        if name in exclude:
            raise SettingsError(f"'{name}' is both required and excluded")
    left = tuple(
        s for s in grammar.structures() if all(has(s, r) for r in require) and not any(has(s, e) for e in exclude)
    )
    if not left:
        raise SettingsError(f"no structure has {', '.join(require)} and lacks {', '.join(exclude)}")
    return left


def fit_all(
    task: IdentificationTask,
    structures: Sequence[Structure],
    *,
    options: Options | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Fitted], None] | None = None,
    seeking: Callable[[Structure], None] | None = None,
) -> dict[Structure, Fitted]:
    """Fit all `structures` at the level of ``task.settings``.

    Parameters
    ----------
    task : IdentificationTask
    structures : sequence of Structure
    options : Options, optional
    seed : int
    executor : concurrent.futures.Executor, optional
        Makes the fits; the result does not depend on it. One thread by default.
    progress : callable, optional
        Called after the first fit of every structure, in the order of the result.
    seeking : callable, optional
        Called with every structure before it is fitted by multistart again.

    Returns
    -------
    dict of Structure to Fitted
        Simple ones first.
    """
    fits = Fits(task, structures, options=options, seed=seed)
    with thread_pool(executor) as workers:
        fits.add(structures, workers, progress)
        seek_missed(fits, workers, seeking)
    return fits.done


def search_exhaustively(
    task: IdentificationTask,
    structures: Sequence[Structure],
    *,
    options: Options | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[SearchProgress], None] | None = None,
) -> ExhaustiveResult:
    """Fit all `structures`, rank them, and assess every effect.

    Parameters
    ----------
    task : IdentificationTask
    structures : sequence of Structure
    options : Options, optional
        Of the fits.
    seed : int
    executor : concurrent.futures.Executor, optional
        The result does not depend on it.
    progress : callable, optional
        Called after every structure.

    Returns
    -------
    ExhaustiveResult
        With the fits so far, if it is stopped by Ctrl-C or the executor.

    Raises
    ------
    SettingsError
        If no structure could be simulated.
    KeyboardInterrupt, Stopped
        If it is stopped before the first fit.
    """
    least, leader = np.inf, structures[0]
    fitted: dict[Structure, Fitted] = {}

    def fitted_one(f: Fitted) -> None:
        nonlocal least, leader
        fitted[f.structure] = f
        if f.cost < least:
            least, leader = f.cost, f.structure
        if progress is not None:
            progress(SearchProgress("structures", len(fitted), len(structures), leader))

    def counted(name: str) -> Callable[[Structure], None]:
        numbers = itertools.count(1)

        def note(structure: Structure) -> None:
            if progress is not None:
                progress(SearchProgress(name, next(numbers), None, structure))

        return note

    evidence = None
    known: dict[Structure, Misfit] = {}
    try:
        with thread_pool(executor) as workers:
            fitted = fit_all(
                task,
                structures,
                options=options,
                seed=seed,
                executor=workers,
                progress=fitted_one,
                seeking=counted("missed optima"),
            )
            if not np.isfinite(least):
                raise SettingsError("no structure gave a finite simulation; check units, bounds and --input-gain")
            ahead = _misfits_ahead(workers, task, fitted)  # while evidence leaves workers idle
            evidence = assess_effects(task, fitted, seed=seed, executor=workers, progress=counted("evidence"))
            for part, found in ahead:
                known |= zip(part, found.result(), strict=True)
    except (KeyboardInterrupt, Stopped):
        if not np.isfinite(least):
            raise
    return ExhaustiveResult(_ranking(task, fitted, evidence, known), evidence, fitted)


def _misfits_ahead(
    executor: Executor, task: IdentificationTask, fitted: Mapping[Structure, Fitted]
) -> list[tuple[Sequence[Structure], Future[list[Misfit]]]]:
    """Misfits of all structures without redundant effects, several in a call."""
    own = [s for s, f in fitted.items() if not f.idle]
    parts = [own[i : i + BUDGET.misfits_per_call] for i in range(0, len(own), BUDGET.misfits_per_call)]
    declared = _declared(fitted)
    return [
        (part, executor.submit(_misfits, task, [_own(s, fitted[s].values, declared) for s in part])) for part in parts
    ]


def _declared(structures: Iterable[Structure]) -> frozenset[str]:
    return frozenset(name for s in structures for name in s.parameters)


def _own(
    structure: Structure, values: Mapping[str, float], declared: frozenset[str]
) -> tuple[Structure, dict[str, float]]:
    """Structure with its own values and those of an estimated initial state, which no structure declares."""
    return structure, {n: v for n, v in values.items() if n in structure.parameters or n not in declared}


def _misfits(task: IdentificationTask, valued: Sequence[tuple[Structure, Mapping[str, float]]]) -> list[Misfit]:
    """Misfit of each structure with its values, at the level of the search."""
    return [task.misfits(s, {n: np.array([v]) for n, v in values.items()})[0] for s, values in valued]


def _ranking(
    task: IdentificationTask,
    fitted: Mapping[Structure, Fitted],
    evidence: Evidence | None,
    known: Mapping[Structure, Misfit],
) -> tuple[Ranked, ...]:
    """Ranking of all structures; `known` are misfits at the values of `fitted`."""
    minimal, optional = ([j.structure for j in evidence.minimal], evidence.optional) if evidence else ([], ())
    tied = set(minimal)
    for s in minimal:
        tied.update(e for e in one_larger(s, fitted) if any(has(e, o) and not has(s, o) for o in optional))
    samples = sum(r.samples for r in task.recordings) * len(task.recordings[0].outputs)
    independent = evidence.independent if evidence else float(samples)
    declared = _declared(fitted)
    ranked = []
    for s, f in fitted.items():
        judged = evidence.judged.get(s) if evidence else None
        cost, values = (judged.cost, judged.values) if judged is not None else (f.cost, f.values)
        shown = s
        if judged is None and f.equals is not None:  # the values of its redundant effects would spoil the misfit
            shown, values = f.equals, fitted[f.equals].values
        misfit = known.get(shown) if judged is None else None
        if misfit is None:
            (misfit,) = _misfits(task, [_own(shown, values, declared)])
        value = bic(cost, samples, f.free, independent)
        ranked.append(Ranked(s, f.free, misfit, value, s in tied))
    place = {s: i for i, s in enumerate(minimal)}
    ranked.sort(key=lambda r: (place.get(r.structure, len(place)), r.criterion, str(r.structure)))
    return tuple(ranked)
