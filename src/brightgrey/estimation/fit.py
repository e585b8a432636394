"""Parameters of a given structure from recordings: start values, descent, uncertainty, outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brightgrey.errors import SettingsError
from brightgrey.estimation.bounds import Search, search_space
from brightgrey.estimation.cautions import cautions
from brightgrey.estimation.estimates import Estimate, estimates_of
from brightgrey.estimation.informative import recording_findings
from brightgrey.estimation.leastsquares import Descent, descend
from brightgrey.estimation.outcome import Ended, Outcome, outcome_of, unmoved
from brightgrey.estimation.patterns import Estimator, check_estimator, pattern_descent, pattern_searches
from brightgrey.estimation.problem import Problem, initial_state, predict_many
from brightgrey.estimation.scales import scales
from brightgrey.estimation.twins import untwin
from brightgrey.kit import Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings
from brightgrey.simulation.settings import Level

__all__ = ["Estimate", "Fit", "Outcome", "OutputFit", "Start", "fit", "predict"]

Array = NDArray[np.float64]
_CANDIDATES = 64
_SHARPNESS = 100.0  # default f_tanh times the largest speed
_FINISHED = 3  # descents that are finished at the accurate level


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


def fit(
    structure: Structure,
    recordings: Sequence[Recording],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    f_tanh: float | None = None,
    start: Mapping[str, float] | None = None,
    starts: int = 8,
    seed: int = 0,
    level: Level = "accurate",
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
    start : mapping of str to float, optional
        One more start, SI.
    starts : int
        Descents.
    seed : int
        Of the candidates.
    level : {'accurate', 'fast', 'euler'}
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
    search = search_space(structure, known, bounds or {}, fixed or {})
    settings = Settings(
        f_tanh=_SHARPNESS / known.speed if f_tanh is None else f_tanh,
        speed_scale=known.speed,
        level="euler" if level == "euler" else "fast",
        hold=recordings[0].hold,
    )
    problem = Problem.of(structure, recordings)
    final = replace(settings, level=level)
    told = recording_findings(recordings)
    tried: tuple[Start, ...] = ()
    if any(finding.kind == "not identifiable" for finding in told):
        best, evaluations = unmoved(problem, search, final), 1
    else:
        begins = _begins(problem, search, settings, start, starts, seed)
        by = _by_patterns if check_estimator(estimator) == "pattern-search" else _by_least_squares
        best, evaluations, tried = by(problem, search, settings, final, begins, threads)
    best, twins = untwin(problem, search, final, best)
    estimates = estimates_of(problem, search, final, best)
    named = {name: estimates.by_name[name] for name in structure.parameters}
    beside = (*told, *twins, *cautions(structure, named, recordings, known, final))
    return Fit(
        structure=structure,
        estimates=named,
        bounds=dict(zip(search.names, zip(search.low.tolist(), search.high.tolist(), strict=True), strict=True)),
        settings=final,
        initial_states=tuple(_initial(structure, _named(search, best.values), r, final) for r in recordings),
        train=_train(problem, best.residual),
        outcome=outcome_of(Ended(problem, search, final, best, estimates), beside),
        cost=best.cost,
        evaluations=evaluations,
        starts=tried,
    )


def _by_patterns(
    problem: Problem, search: Search, settings: Settings, final: Settings, begins: list[Array], threads: int
) -> tuple[Descent, int, tuple[Start, ...]]:
    """Best pattern search, finished at the final level; points simulated, and all starts."""
    ends = pattern_searches(replace(problem, threads=threads), search, settings, begins)
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    values = [search.outward(np.array(end.values)) for end in ends]
    best = pattern_descent(replace(problem, threads=threads), search, final, values[order[0]])
    tried = tuple(
        Start(_named(search, begins[i]), _named(search, values[i]), ends[i].cost, ends[i].reason == "mesh")
        for i in order
    )
    return best, _CANDIDATES + sum(end.evaluations for end in ends) + best.evaluations, tried


def _by_least_squares(
    problem: Problem, search: Search, settings: Settings, final: Settings, begins: list[Array], threads: int
) -> tuple[Descent, int, tuple[Start, ...]]:
    """Best descent, batches of simulations, and all starts."""

    def from_one(begin: Array) -> Descent:
        return descend(problem, search, settings, begin)

    with ThreadPoolExecutor(threads) as pool:
        ends = list(pool.map(from_one, begins))
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    finished = [descend(problem, search, final, ends[i].values) for i in order[:_FINISHED]]
    best = min(finished, key=lambda d: d.cost)
    evaluations = _CANDIDATES + sum(d.evaluations for d in (*ends, *finished))
    tried = tuple(
        Start(_named(search, begins[i]), _named(search, ends[i].values), ends[i].cost, ends[i].converged) for i in order
    )
    return best, evaluations, tried


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
        Initial state by state name, SI.

    Returns
    -------
    ndarray, shape (outputs, samples)
        SI; not-a-number from the sample on at which the simulation diverged.
    """
    arrays = {name: np.array([value]) for name, value in values.items()}
    return predict_many(structure, arrays, recording, settings, initial=initial)[:, :, 0]


def _begins(
    problem: Problem, search: Search, settings: Settings, start: Mapping[str, float] | None, starts: int, seed: int
) -> list[Array]:
    """Starts: the torque balance's, the user's, and the best of the candidates."""
    begins = [search.start]
    if start is not None:
        named = [start.get(name, value) for name, value in zip(search.names, search.start, strict=True)]
        begins.append(np.clip(named, search.low, search.high))
    if search.names and len(begins) < starts:
        candidates = search.candidates(_CANDIDATES, seed)
        values = dict(zip(search.names, candidates, strict=True))
        values |= {name: np.full(candidates.shape[1], value) for name, value in search.fixed.items()}
        cost = np.square(problem.residuals(values, settings)).sum(axis=0)
        chosen = np.argsort(cost, kind="stable")[: starts - len(begins)]
        begins += [candidates[:, i] for i in chosen]
    return begins


def _named(search: Search, values: Array) -> dict[str, float]:
    return dict(zip(search.names, values.tolist(), strict=True)) | dict(search.fixed)


def _initial(
    structure: Structure, values: Mapping[str, float], recording: Recording, settings: Settings
) -> Mapping[str, float]:
    system = assemble(structure, values, settings.f_tanh)
    return dict(zip(system.state_names, initial_state(recording, system).tolist(), strict=True))


def _train(problem: Problem, residual: Array) -> dict[str, OutputFit]:
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
