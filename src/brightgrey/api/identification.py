"""Recordings and a structure in, a model with its uncertainty out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Literal

import numpy as np

from brightgrey import estimation
from brightgrey.api.differences import compare_for_control
from brightgrey.api.result import Result
from brightgrey.api.structure_search import SearchRequest, SearchResult, search_structure
from brightgrey.api.to_si import Range, bounds_si, check_alike, f_tanh_si, fixed_si, start_si
from brightgrey.errors import SettingsError, one_of
from brightgrey.estimation import Fit, Profile
from brightgrey.estimation.optimisation.pattern_fit import ESTIMATORS
from brightgrey.estimation.problem.initial_state import INITIALS
from brightgrey.kit import Structure, function_set
from brightgrey.model.criterion import bic_of_traces
from brightgrey.model.from_fit import model_of
from brightgrey.model.model import Model
from brightgrey.model.ranking import Row
from brightgrey.model.schema import CriterionPart
from brightgrey.model.trace import Trace, pooled_fit
from brightgrey.recordings import Recording
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.search.exhaustive import SearchProgress
from brightgrey.search.genetic import GeneticSettings, Progress
from brightgrey.version import __version__

__all__ = ["identify"]

_PATIENCE, _PATIENCE_FOUND = 8, 0  # a search has looked everywhere already


@one_blas_thread()
def identify(
    recordings: Recording | Sequence[Recording],
    structure: Structure | str | None = None,
    *,
    search: Literal["auto", "exhaustive"] | GeneticSettings | None = None,
    require: Sequence[str] = (),
    exclude: Sequence[str] = (),
    progress: Callable[[SearchProgress | Progress], None] | None = None,
    bounds: Mapping[str, Range] | None = None,
    fixed: Mapping[str, float] | None = None,
    f_tanh: float | None = None,
    start: Model | None = None,
    test: Recording | None = None,
    initial: Literal["auto", "rest", "samples", "estimated"] = "auto",
    starts: int = 8,
    seed: int = 0,
    workers: int = 1,
    executor: Executor | None = None,
    level: Literal["accurate", "fast"] = "accurate",
    estimator: Literal["least-squares", "pattern-search"] = "least-squares",
    profile: Sequence[str] = (),
) -> Result:
    """Estimate the parameters of `structure` from recordings, or search for the structure first.

    Bounds, scales and start values come from the recordings; the keyword arguments override them.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        From :func:`read_recording`. Several are fitted jointly, each with its own initial state.
    structure : Structure or str, optional
        Effects in the model, e.g. ``"two_mass+coulomb+viscous"``.
    search : {'auto', 'exhaustive'} or GeneticSettings, optional
        How to search where no structure is given: all structures of the grammar, with evidence for every effect, or
        genetic programming. ``auto`` (the default) takes all while that lasts minutes at most.
    require, exclude : sequence of str
        Effects that every structure of an exhaustive search has, or that none has; masses count cumulatively.
    progress : callable, optional
        Called after every structure or generation of the search. Ctrl-C ends a search with the best so far.
    bounds : mapping of str to (low, high), optional
        Ranges by parameter, in the recording's units.
    fixed : mapping of str to float, optional
        Parameters that are not estimated, in the recording's units.
    f_tanh : float, optional
        Gain of the smoothed sign of friction, in s per unit of motion of the recording. Default: 100 over the
        largest speed.
    start : Model, optional
        The estimation of a given structure starts from this model's values, too.
    test : Recording, optional
        Not fitted, only predicted.
    initial : {'auto', 'rest', 'samples', 'estimated'}
        State before the first sample: at rest, moving as the first samples say, or estimated within what their
        noise leaves open. ``auto`` is at rest unless the first samples clearly move, then
        estimated.
    starts : int
        Number of start points in each field of them; see :func:`brightgrey.estimation.fit`.
    seed : int
        Seed of all random draws. The same seed gives the same bytes, for any number of workers.
    workers : int
        Threads to simulate on.
    executor : concurrent.futures.Executor, optional
        Makes the evaluations of a search instead: threads, processes, a cluster. The result does not depend on it.
    level : {'accurate', 'fast'}
        Level of integration.
    estimator : {'least-squares', 'pattern-search'}
        Pattern search is the paper's.
    profile : sequence of str
        Parameters whose interval is found by profile likelihood, too: where the cost is no parabola. Each takes
        some tens of further fits.

    Returns
    -------
    Result
        Also where the estimation failed: ``result.model.outcome`` says so.

    Raises
    ------
    BrightgreyError
        For a structure that breaks a rule, unknown parameters, bounds with low > high, recordings that do not
        fit each other.

    Notes
    -----
    One start may end in a local minimum: keep several. The intervals rest on a quadratic picture of the cost.

    Examples
    --------
    >>> recording = read_recording("axis.csv", input="torque", outputs=["velocity"])  # doctest: +SKIP
    >>> result = identify(recording, "one_mass+coulomb+viscous")  # doctest: +SKIP
    """
    several = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    check_alike(several, test)
    units = several[0].units
    for name in sorted((bounds or {}).keys() & (fixed or {}).keys()):
        raise SettingsError(f"{name} is both bounded and fixed; do one of them")
    found = None
    if structure is None:
        if start is not None:
            raise SettingsError("a start model was given without a structure; a search draws its starts itself")
        wish = SearchRequest(
            search or "auto",
            tuple(require),
            tuple(exclude),
            bounds or {},
            fixed or {},
            f_tanh,
            seed,
            workers,
            progress,
            executor,
        )
        found = search_structure(several, wish)
        structure, bounds, fixed = found.structure, found.own(bounds), found.own(fixed)
    elif search is not None or require or exclude:
        raise SettingsError("a structure and a search were given; do one of them")
    checked = function_set().check(Structure.parse(structure) if isinstance(structure, str) else structure)
    ranges = bounds_si(checked, bounds or {}, units)
    constants = fixed_si(checked, fixed or {}, units)
    fit = estimation.fit(
        checked,
        several,
        bounds=ranges,
        fixed=constants,
        f_tanh=None if f_tanh is None else f_tanh_si(f_tanh, units),
        start=found.values if found else start_si(checked, start, units, constants),
        starts=starts,
        patience=_PATIENCE_FOUND if found else _PATIENCE,
        seed=seed,
        level=level,
        estimator=one_of("estimator", estimator, ESTIMATORS),
        initial=one_of("initial state", initial, INITIALS),
        threads=workers,
    )
    profiles = tuple(estimation.profile(fit, several, name) for name in dict.fromkeys(profile))
    values = {name: estimate.value for name, estimate in fit.estimates.items()}
    train = tuple(
        Trace.of(r, estimation.predict(checked, values, r, fit.settings, initial))
        for r, initial in zip(several, fit.initial_states, strict=True)
    )
    unseen = (
        ()
        if test is None
        else (
            Trace.of(
                test,
                estimation.predict(checked, values, test, replace(fit.settings, hold=test.hold)),
                test=True,
            ),
        )
    )
    return _result(fit, several, train, unseen, constants, seed, test, found, profiles)


def _result(
    fit: Fit,
    several: tuple[Recording, ...],
    train: tuple[Trace, ...],
    unseen: tuple[Trace, ...],
    constants: Mapping[str, float],
    seed: int,
    test: Recording | None,
    found: SearchResult | None,
    profiles: tuple[Profile, ...],
) -> Result:
    """Put the model, its place in the ranking and the notes together."""
    free = len(fit.structure.parameters) - len(constants)
    steps = np.max([r.resolution for r in several], axis=0) * [s.factor for s in several[0].outputs]
    value = bic_of_traces(train, free, steps.tolist())
    fits = pooled_fit(train)
    criterion = None if value is None else CriterionPart(name="BIC", value=value)
    model = model_of(
        fit,
        several,
        train=fits,
        test=pooled_fit(unseen) if unseen else None,
        criterion=found.criterion if found else criterion,
        fixed=constants,
        seed=seed,
        version=__version__,
        profiles=profiles,
        evidence=found.evidence if found else None,
    )
    row = Row(
        structure=str(fit.structure),
        n_parameters=free,
        rss=sum(f.rss if f.rss is not None else np.nan for f in fits.values()),
        fit_percent=float(np.mean([np.nan if f.fit_percent is None else f.fit_percent for f in fits.values()])),
        criterion=value,
    )
    notes = _notes(several if test is None else (*several, test))
    if found:
        first = replace(found.ranking[0], rss=row.rss, fit_percent=row.fit_percent)
        ranking, notes = (first, *found.ranking[1:]), (*notes, found.note)
    else:
        ranking = (row,)
    files, evidence, run = (found.files, found.evidence, found.run) if found else ({}, None, None)
    apart = compare_for_control(evidence, several, fit.settings) if evidence else ()
    return Result(
        model,
        (*train, *unseen),
        ranking,
        notes,
        fit,
        files,
        profiles,
        evidence,
        run=run,
        differences=apart,
        stopped=found is not None and found.stopped,
    )


def _notes(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Notes of all recordings, each said once with the names of those it holds for."""
    names: dict[str, list[str]] = {}
    for recording in recordings:
        for note in recording.notes:
            names.setdefault(note, []).append(recording.name)
    return tuple(f"{', '.join(dict.fromkeys(who))}: {note}" for note, who in names.items())
