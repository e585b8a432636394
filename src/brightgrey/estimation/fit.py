"""Parameters of a given structure from recordings: start values, descent, uncertainty, outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brightgrey.errors import SettingsError
from brightgrey.estimation.bounds import Search, search_space
from brightgrey.estimation.estimates import Estimate, estimates_of
from brightgrey.estimation.leastsquares import descend, descend_many
from brightgrey.estimation.outcome import Outcome, outcome_of
from brightgrey.estimation.problem import Problem, initial_state, predict_many
from brightgrey.estimation.scales import scales
from brightgrey.estimation.starts import starting_points
from brightgrey.kit import Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings
from brightgrey.simulation.settings import Level

__all__ = ["Estimate", "Fit", "Outcome", "OutputFit", "Start", "fit", "predict"]

Array = NDArray[np.float64]
_SHARPNESS = 100.0  # default f_tanh times the largest speed
_FINISHED = 2  # descents that are finished at the accurate level
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
    start: Mapping[str, float] | Sequence[Mapping[str, float]] | None = None,
    starts: int = 8,
    seed: int = 0,
    level: Level = "accurate",
    threads: int = 1,
) -> Fit:
    """Estimate the parameters of `structure` by bounded least squares on the simulation error.

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
    seed : int
        Of the candidates.
    level : {'accurate', 'fast', 'euler'}
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
    problem = Problem.of(structure, recordings, threads)
    given = [] if start is None else [start] if isinstance(start, Mapping) else list(start)
    begins = starting_points(problem, search, settings, given, starts, seed)
    ends = descend_many(problem, search, settings, begins)
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    final = replace(settings, level=level)
    finished = [
        descend(problem, search, final, ends[i].values)
        for i in order[:_FINISHED]
        if ends[i].cost <= _RIVAL * ends[order[0]].cost
    ]
    best = min(finished, key=lambda d: d.cost)
    evaluations = 1 + max(end.evaluations for end in ends) + sum(d.evaluations for d in finished)
    tried = tuple(
        Start(_named(search, begins[:, i]), _named(search, ends[i].values), ends[i].cost, ends[i].converged)
        for i in order
    )
    estimates = estimates_of(search, best, recordings)
    return Fit(
        structure=structure,
        estimates={name: estimates[name] for name in structure.parameters},
        bounds=dict(zip(search.names, zip(search.low.tolist(), search.high.tolist(), strict=True), strict=True)),
        settings=final,
        initial_states=tuple(_initial(structure, _named(search, best.values), r, final) for r in recordings),
        train=_train(problem, best.residual),
        outcome=outcome_of(search, best, estimates),
        cost=best.cost,
        evaluations=evaluations,
        starts=tried,
    )


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
