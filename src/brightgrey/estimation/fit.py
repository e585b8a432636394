"""Parameters of a given structure from recordings: start values, descent, uncertainty, outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales
from brightgrey.errors import SettingsError
from brightgrey.estimation.diagnostics.cautions import cautions
from brightgrey.estimation.diagnostics.chaos import chaos_findings
from brightgrey.estimation.diagnostics.equivalent_models import resolve_lag_pole_exchange
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.diagnostics.informativity import recording_findings
from brightgrey.estimation.diagnostics.outcome import FitContext, Outcome, outcome_of, unfitted
from brightgrey.estimation.diagnostics.symptoms import Symptom, symptoms
from brightgrey.estimation.optimisation.least_squares import Optimum, OptimumWithJacobian, fit_many, fit_to_convergence
from brightgrey.estimation.optimisation.multistart import MultistartResult, first_field, multistart
from brightgrey.estimation.optimisation.pattern_fit import Estimator, check_estimator, pattern_descent, pattern_searches
from brightgrey.estimation.problem.initial_state import Initial
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.estimation.uncertainty.estimates import Estimate, estimates_of
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings
from brightgrey.simulation.settings import Level

__all__ = ["Estimate", "Fit", "Outcome", "OutputFit", "Start", "fit", "predict", "settings_for"]

_SHARPNESS = 100.0  # default f_tanh times the largest speed
_ELSEWHERE = 0.1  # in the searched scale
_FINISHED = 2  # descents that are finished at the accurate level
_BEGINNING = 30  # rounds for the beginning of another recording
_RIVAL = 1.01  # ... if their cost is not larger than the least by this factor, which is what `fast` may be off


@dataclass(frozen=True)
class OutputFit:
    """Residual sum of squares, its root mean, and 100 (1 - |y - yhat| / |y - mean|), in SI."""

    rss: float
    rmse: float
    fit_percent: float


@dataclass(frozen=True)
class Start:
    """One start and where it ended, values in SI by name; `cost` is the weighted sum of squares."""

    start: Mapping[str, float]
    end: Mapping[str, float]
    cost: float
    converged: bool


@dataclass(frozen=True)
class Fit:
    """Result of :func:`fit`, all in SI.

    Attributes
    ----------
    structure : Structure
    estimates : mapping of str to Estimate
        Of every parameter; a fixed one has standard deviation 0.
    bounds : mapping of str to (low, high)
    settings : Settings
    initial_states : tuple of mapping of str to float
        One per recording, by state name.
    train : mapping of str to OutputFit
        By output name, pooled over recordings.
    outcome : Outcome
    cost : float
        Sum of squared residuals, each over its output's noise.
    evaluations : int
        Batches of simulations.
    starts : tuple of Start
        Best first.
    correlation : mapping of (str, str) to float
        Of the errors of two estimates, in the logarithm of what is always positive; parameters without an interval
        are not in it.
    symptoms : tuple of Symptom
        What speaks for something that the structure has not; none where nothing could be fitted.
    """

    structure: Structure
    estimates: Mapping[str, Estimate]
    bounds: Mapping[str, tuple[float, float]]
    settings: Settings
    initial_states: tuple[Mapping[str, float], ...]
    train: Mapping[str, OutputFit]
    outcome: Outcome
    cost: float
    evaluations: int
    starts: tuple[Start, ...]
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)
    symptoms: tuple[Symptom, ...] = ()


def fit(
    structure: Structure,
    recordings: Sequence[Recording],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    f_tanh: float | None = None,
    start: Mapping[str, float] | Sequence[Mapping[str, float]] | None = None,
    starts: int = 8,
    patience: int = 8,
    seed: int = 0,
    level: Level = "accurate",
    initial: Initial = "auto",
    estimator: Estimator = "least-squares",
    threads: int = 1,
) -> Fit:
    """Estimate the parameters of `structure` by bounded least squares on the simulation error, or by pattern search.

    Candidates that fill the bounds are simulated once, the best of them, the start from the torque balance and
    the user's are descended from at the ``fast`` level, and the best ends are finished at `level`.

    Parameters
    ----------
    structure : Structure
    recordings : sequence of Recording
        Of one drive, with the same outputs.
    bounds : mapping of str to (low, high), optional
        SI. Parameters that are not named take their range from the recordings.
    fixed : mapping of str to float, optional
        SI.
    f_tanh : float, optional
        s/rad (s/m); 100 over the largest speed by default.
    start : mapping of str to float or sequence of them, optional
        Starts to descend from, SI; parameters that are not named take their declared start.
    starts : int
        Descents. What `start` and the torque balance leave of them is filled up with candidates.
    patience : int
        Further fields of as many descents are tried, until the residual is white and two independent starts agree, or
        this many (with limits half as many again) have not improved on the best one, a quarter as many if the residual
        is white. With 0 it stays with the first field.
    seed : int
        Of the candidates.
    level : {'accurate', 'fast', 'euler'}
    initial : {'auto', 'rest', 'samples', 'estimated'}
        State before the first sample: at rest, moving as the first samples say, or estimated with the parameters
        within what the sensor's noise allows. ``auto`` is at rest unless the first samples clearly move, then
        estimated.
    estimator : {'least-squares', 'pattern-search'}
        Pattern search is the paper's; it takes hundreds of times as many simulations.
    threads : int
        The result does not depend on it.

    Returns
    -------
    Fit

    Raises
    ------
    SettingsError
        For wrong bounds, names or numbers of starts. A fit that fails is an outcome, not an error.
    """
    if starts < 1:
        raise SettingsError(f"starts is {starts}; at least 1 is needed")
    known = scales(recordings)
    settings = settings_for(recordings, known, f_tanh, "euler" if level == "euler" else "fast")
    problem = SimulationErrorProblem.of(structure, recordings, threads, initial)
    search = parameter_space(structure, known, bounds or {}, fixed or {}, problem.unknown_initial)
    final = replace(settings, level=level)
    told = recording_findings(recordings)
    tried: tuple[Start, ...] = ()
    if _blind(told):
        best, evaluations = unfitted(problem, search, final), 1
    else:
        given = [] if start is None else [start] if isinstance(start, Mapping) else list(start)
        if check_estimator(estimator) == "pattern-search":
            best, evaluations, tried = _by_patterns(problem, search, settings, final, given, starts, seed)
        else:
            found = multistart(problem, search, settings, given, starts=starts, patience=patience, seed=seed)
            best, evaluations, tried = _finished(problem, search, final, found)
    best, twins = resolve_lag_pole_exchange(problem, search, final, best)
    estimates = estimates_of(problem, search, final, best)
    named = {name: estimates.by_name[name] for name in structure.parameters}
    ended = FitContext(problem, search, final, best, estimates)
    doubtful = [] if _blind(told) else chaos_findings(problem, search, final, best)
    beside = (*told, *twins, *cautions(structure, named, recordings, known, final), *doubtful)
    outcome = outcome_of(ended, beside)
    return Fit(
        structure=structure,
        estimates=named,
        bounds=dict(zip(search.names, zip(search.low.tolist(), search.high.tolist(), strict=True), strict=True)),
        settings=final,
        initial_states=problem.states(_named(search, best.values), final.f_tanh),
        train=_train(problem, best.residual),
        outcome=outcome,
        cost=best.cost,
        evaluations=evaluations,
        starts=tried,
        correlation=estimates.correlation,
        symptoms=() if outcome.kind == "diverged" or _blind(told) else symptoms(ended, known),
    )


def _blind(told: Sequence[Finding]) -> bool:
    """Whether there is nothing to identify in the recordings."""
    return any(finding.kind == "not identifiable" for finding in told)


def _by_patterns(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    final: Settings,
    given: Sequence[Mapping[str, float]],
    starts: int,
    seed: int,
) -> tuple[OptimumWithJacobian, int, tuple[Start, ...]]:
    """Best pattern search, finished at the final level; points simulated, and all starts."""
    begins = first_field(problem, search, settings, given, starts, np.random.default_rng(seed))
    ends = pattern_searches(problem, search, settings, begins)
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    values = [search.from_scaled(np.array(end.values)) for end in ends]
    best = pattern_descent(problem, search, final, values[order[0]])
    tried = tuple(
        Start(_named(search, begins[i]), _named(search, values[i]), ends[i].cost, ends[i].reason == "mesh")
        for i in order
    )
    return best, sum(end.evaluations for end in ends) + best.evaluations, tried


def _finished(
    problem: SimulationErrorProblem, search: ParameterSpace, final: Settings, found: MultistartResult
) -> tuple[OptimumWithJacobian, int, tuple[Start, ...]]:
    """Best descent, finished at the final level, batches of simulations, and all starts."""
    ends = found.ends
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    finished = [fit_to_convergence(problem, search, final, ends[i].values) for i in _finalists(search, ends, order)]
    best = min(finished, key=lambda d: d.cost)
    evaluations = found.evaluations + sum(d.evaluations for d in finished)
    tried = tuple(
        Start(_named(search, found.begins[:, i]), _named(search, ends[i].values), ends[i].cost, ends[i].converged)
        for i in order
    )
    return best, evaluations, tried


def settings_for(
    recordings: Sequence[Recording], known: Scales, f_tanh: float | None, level: Level = "fast"
) -> Settings:
    """Settings that recordings are simulated with: `f_tanh` in SI, by default 100 over their largest speed."""
    sharpness = _SHARPNESS / known.speed if f_tanh is None else f_tanh
    return Settings(f_tanh=sharpness, speed_scale=known.speed, level=level, hold=recordings[0].hold)


def predict(
    structure: Structure,
    values: Mapping[str, float],
    recording: Recording,
    settings: Settings,
    initial: Mapping[str, float] | None = None,
) -> Array:
    """Simulate `structure` on a recording's input.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        SI.
    recording : Recording
        Gives input, outputs and, if `initial` is not given, the initial state.
    settings : Settings
    initial : mapping of str to float, optional
        Initial state by state name, SI. If it is not given and the recording begins in motion, what its first samples
        leave open of it is fitted to the recording, as in a fit; no parameter is.

    Returns
    -------
    ndarray, shape (outputs, samples)
        SI; not-a-number from the sample on at which the simulation diverged.
    """
    if initial is None:
        initial = _began(structure, values, recording, settings)
    arrays = {name: np.array([value]) for name, value in values.items()}
    return predict_many(structure, arrays, recording, settings, initial=initial)[:, :, 0]


def _began(
    structure: Structure, values: Mapping[str, float], recording: Recording, settings: Settings
) -> Mapping[str, float] | None:
    """Initial state of a recording for known parameters; None if it begins at rest."""
    problem = SimulationErrorProblem.of(structure, [recording])
    if not problem.unknown_initial:
        return None
    own = {name: values[name] for name in structure.parameters}
    search = parameter_space(structure, scales([recording]), {}, own, problem.unknown_initial)
    (end,) = fit_many(problem, search, settings, search.start[:, None], limit=_BEGINNING)
    named = dict(zip(search.names, end.values.tolist(), strict=True)) | own
    return problem.states(named, settings.f_tanh)[0]


def _finalists(search: ParameterSpace, ends: Sequence[Optimum], order: Sequence[int]) -> list[int]:
    """Ends that may turn out as the best one at the final level: nearly as good as it, and elsewhere."""
    chosen = [order[0]]
    for i in order[1:]:
        apart = [
            np.abs(search.to_scaled(ends[i].values) - search.to_scaled(ends[j].values)).max(initial=0.0) for j in chosen
        ]
        if ends[i].cost <= _RIVAL * ends[order[0]].cost and min(apart) > _ELSEWHERE and len(chosen) < _FINISHED:
            chosen.append(i)
    return chosen


def _named(search: ParameterSpace, values: Array) -> dict[str, float]:
    return dict(zip(search.names, values.tolist(), strict=True)) | dict(search.fixed)


def _train(problem: SimulationErrorProblem, residual: Array) -> dict[str, OutputFit]:
    """Fit of each output, pooled over the recordings."""
    outputs = problem.recordings[0].outputs
    pieces: list[list[Array]] = [[] for _ in outputs]
    begin = 0
    for r in problem.recordings:
        block = residual[begin : begin + r.y.size].reshape(r.y.shape) / problem.weights[:, None]
        begin += r.y.size
        for out in range(len(outputs)):
            pieces[out].append(block[out])
    result = {}
    for out, signal in enumerate(outputs):
        apart = np.concatenate(pieces[out])
        spread = np.concatenate([r.y[out] - r.y[out].mean() for r in problem.recordings])
        rss = float(apart @ apart)
        percent = 100.0 * (1.0 - np.sqrt(rss) / max(float(np.linalg.norm(spread)), 1e-300))
        result[signal.name] = OutputFit(rss, float(np.sqrt(rss / len(apart))), float(percent))
    return result
