"""Recordings and a structure in, a model with its uncertainty out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from brightgrey import estimation
from brightgrey.api.result import Result
from brightgrey.api.to_si import Range, check_alike, identification_task, start_si
from brightgrey.arguments import checked_arguments
from brightgrey.errors import SettingsError, one_of
from brightgrey.estimation import Fit, Profile
from brightgrey.estimation.optimisation.pattern_fit import ESTIMATORS
from brightgrey.estimation.problem.initial_state import INITIALS
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Structure, function_set
from brightgrey.model.criterion import bic_of_traces
from brightgrey.model.from_fit import model_of
from brightgrey.model.model import Model
from brightgrey.model.ranking import Row
from brightgrey.model.run_record import FittedPart, RecordingPart, RunRecord
from brightgrey.model.schema import CriterionPart
from brightgrey.model.trace import Trace, pooled_fit
from brightgrey.recordings import Recording
from brightgrey.recordings.checks.checkup import Checkup
from brightgrey.recordings.checks.checkup import check as check_recordings
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.search import IdentificationTask
from brightgrey.simulation import shared_cores
from brightgrey.version import __version__

if TYPE_CHECKING:
    from brightgrey.api.differences import ControlDifference
    from brightgrey.api.structure_search import SearchKind, SearchResult
    from brightgrey.search.evidence import Evidence
    from brightgrey.search.genetic import Progress
    from brightgrey.search.progress import SearchProgress
    from brightgrey.simulation import Settings

__all__ = ["identify"]

_PATIENCE = 8  # of the multistart of a given structure
_PATIENCE_AFTER_SEARCH = 0  # the search has made multistarts itself


@checked_arguments
@one_blas_thread()
def identify(
    recordings: Recording | Sequence[Recording],
    structure: Structure | str | None = None,
    *,
    search: SearchKind | None = None,
    grammar: Literal["drive", "paper"] | None = None,
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
    per_recording: Sequence[str] = (),
    check: bool = True,
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
        How to search where no structure is given. ``auto`` (the default) fits the few dozen structures that decide all
        others, ``exhaustive`` fits every one; both give a verdict on every effect. Or genetic programming.
    grammar : {'drive', 'paper'}, optional
        Function set that is searched. ``drive`` begins with the paper's and offers friction at other masses and further
        effects where that leaves something unexplained; it is the default of ``auto``. ``paper`` is the default of the
        other searches. Genetic programming takes all effects of ``drive`` from the start.
    require, exclude : sequence of str
        Effects that every structure has, or that none has; masses count cumulatively. Not in genetic programming.
    progress : callable, optional
        Called after every structure or generation of the search. Ctrl-C ends a search with the best so far.
    bounds : mapping of str to (low, high), optional
        Ranges by parameter, in the recording's units.
    fixed : mapping of str to float, optional
        Parameters that are not estimated, in the recording's units.
    f_tanh : float, optional
        Gain of the smoothed sign of friction (eq. 2), in s per unit of motion of the recording. By default its
        inverse, the width of friction's reversal, is estimated with the parameters.
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
    per_recording : sequence of str
        Parameters that may differ between the recordings, like the friction of a cold and a warm drive. The model has
        their mean, of logarithms where they are always positive.
    check : bool
        Check the recordings first, and refuse them where a check says *stop*; see :func:`brightgrey.check`.

    Returns
    -------
    Result
        Also where the estimation failed: ``result.model.outcome`` says so.

    Raises
    ------
    BrightgreyError
        For a structure that breaks a rule, unknown parameters, bounds with low > high, recordings that do not
        fit each other, or that a check refuses.

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
    checkup = check_recordings(several if test is None else (*several, test))
    if check:
        checkup.refuse()
    searching = search is not None or grammar is not None or bool(require or exclude)
    _check_request(several[0], structure, start, searching=searching)
    named = Structure.parse(structure) if isinstance(structure, str) else structure
    task = identification_task(several, named, bounds or {}, fixed or {}, f_tanh, per_recording)
    found = None
    if named is None:
        from brightgrey.api.structure_search import SearchRequest, grammar_searched, search_structure

        request = SearchRequest(
            search or "auto",
            grammar_searched(search, grammar),
            tuple(require),
            tuple(exclude),
            seed,
            workers,
            progress=progress,
            executor=executor,
        )
        found = search_structure(task, request)
    chosen = found.structure if found else function_set().check(cast("Structure", named))
    constants = task.fixed_of(chosen)
    for name in profile:  # before the fit takes its time
        one_of("estimated parameter", name, [each for each in chosen.parameters if each not in constants])
    with shared_cores(workers):
        fit = estimation.fit(
            chosen,
            several,
            bounds=task.bounds_of(chosen),
            fixed=constants,
            f_tanh=None if task.friction_width else task.settings.f_tanh,
            start=found.starts if found else start_si(chosen, start, several[0].units, constants),
            starts=starts,
            patience=_PATIENCE_AFTER_SEARCH if found else _PATIENCE,
            seed=seed,
            level=level,
            estimator=one_of("estimator", estimator, ESTIMATORS),
            initial=one_of("initial state", initial, INITIALS),
            per_recording=task.per_recording,
        )
        profiles = tuple(estimation.profile(fit, several, name) for name in dict.fromkeys(profile))
        made = _assemble_result(fit, several, test, constants, seed, found, profiles, checkup)
    asked = _Asked(task, tuple(require), tuple(exclude), initial, level, seed)
    return replace(made, record=_record(asked, fit, found), recordings=several)


def _check_request(
    recording: Recording, structure: Structure | str | None, start: Model | None, *, searching: bool
) -> None:
    """Refuse a structure beside a search, and what a search has no use for."""
    if structure is not None:
        if searching:
            raise SettingsError("a structure and a search were given; do one of them")
        return
    if start is not None:
        raise SettingsError("a start model was given without a structure; a search draws its starts itself")
    if recording.input.mass > 1:
        raise SettingsError(
            f"'{recording.input.name}' acts on mass {recording.input.mass}, and a search needs it at mass 1; give the"
            " structure, or count the masses from the driven one"
        )


@dataclass(frozen=True)
class _Asked:
    """Request of an identification."""

    task: IdentificationTask
    require: tuple[str, ...]
    exclude: tuple[str, ...]
    initial: str
    level: Literal["accurate", "fast"]
    seed: int


def _record(asked: _Asked, fit: Fit, found: SearchResult | None) -> RunRecord:
    """Record of an identification."""
    task = asked.task
    return RunRecord(
        recordings=tuple(map(RecordingPart.of, task.recordings)),
        search=None if found is None else found.search,
        grammar=None if found is None else found.grammar,
        require=asked.require,
        exclude=asked.exclude,
        bounds=task.bounds,
        fixed=task.fixed,
        f_tanh=None if task.friction_width else task.settings.f_tanh,
        per_recording=task.per_recording,
        initial=one_of("initial state", asked.initial, INITIALS),
        level=asked.level,
        seed=asked.seed,
        fits=_fitted_parts(fit, found),
    )


def _fitted_parts(fit: Fit, found: SearchResult | None) -> tuple[FittedPart, ...]:
    """Optima of a search, those of the best structures first; of a given structure its estimates."""
    if found is None or found.evidence is None:
        width = {} if fit.friction_width is None else {FRICTION_WIDTH: fit.friction_width.value}
        values = {name: estimate.value for name, estimate in fit.estimates.items()} | dict(fit.deviations) | width
        return (FittedPart(structure=str(fit.structure), status="given", values=values),)
    leading = {str(m.structure): m.values for m in (found.evidence.first, *found.evidence.minimal)}
    optima = dict(leading)
    optima |= {str(s): values for s, values in found.optima.items()}
    status = {str(s): text for s, text in found.evidence.status.items()}
    names = [*leading, *(name for name in optima if name not in leading)]
    return tuple(FittedPart(structure=n, status=status[n], values=optima[n]) for n in names)


def _traces(fit: Fit, recordings: Sequence[Recording], test: Recording | None) -> tuple[tuple[Trace, ...], ...]:
    """Recordings beside the model's prediction: those of the fit, and the test recording if there is one."""
    train = tuple(
        Trace.of(r, estimation.predict(fit.structure, fit.values_in(k), r, fit.settings, fit.initial_states[k]))
        for k, r in enumerate(recordings)
    )
    if test is None:
        return train, ()
    values = {name: estimate.value for name, estimate in fit.estimates.items()}
    simulated = estimation.predict(fit.structure, values, test, replace(fit.settings, hold=test.hold))
    return train, (Trace.of(test, simulated, test=True),)


def _differences(
    evidence: Evidence, recordings: Sequence[Recording], settings: Settings
) -> tuple[ControlDifference, ...]:
    """Differences of equivalent structures for control, whose analysis a given structure does not need."""
    from brightgrey.api.differences import compare_for_control

    return compare_for_control(evidence, recordings, settings)


def _assemble_result(
    fit: Fit,
    several: tuple[Recording, ...],
    test: Recording | None,
    constants: Mapping[str, float],
    seed: int,
    found: SearchResult | None,
    profiles: tuple[Profile, ...],
    checkup: Checkup,
) -> Result:
    """Put the model, its place in the ranking and the notes together."""
    train, unseen = _traces(fit, several, test)
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
    notes = (
        *_notes(several if test is None else (*several, test)),
        *(m.text for m in checkup.of_grade("stop", "mind")),
    )
    if found:
        first = replace(found.ranking[0], rss=row.rss, fit_percent=row.fit_percent)
        ranking, notes = (first, *found.ranking[1:]), (*notes, found.note)
    else:
        ranking = (row,)
    files, evidence, run = (found.files, found.evidence, found.run) if found else ({}, None, None)
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
        differences=_differences(evidence, several, fit.settings) if evidence else (),
        checkup=checkup,
        stopped=found is not None and found.stopped,
    )


def _notes(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Notes of all recordings, each said once with the names of those it holds for."""
    names: dict[str, list[str]] = {}
    for recording in recordings:
        for note in recording.notes:
            names.setdefault(note, []).append(recording.name)
    return tuple(f"{', '.join(dict.fromkeys(who))}: {note}" for note, who in names.items())
