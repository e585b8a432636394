"""Parameters of a given structure from recordings: start values, descent, uncertainty, outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brightgrey.errors import SettingsError
from brightgrey.estimation.bounds import Search, search_space
from brightgrey.estimation.explore import explore
from brightgrey.estimation.leastsquares import Descent, End, descend
from brightgrey.estimation.onset import Initial
from brightgrey.estimation.problem import Problem, predict_many
from brightgrey.estimation.scales import scales
from brightgrey.estimation.uncertainty import covariance, weakest
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings
from brightgrey.simulation.settings import Level

__all__ = ["Estimate", "Fit", "Outcome", "OutputFit", "Start", "fit", "predict"]

Array = NDArray[np.float64]
_SHARPNESS = 100.0  # default f_tanh times the largest speed
_AT_BOUND = 1e-4  # of the searched range
_BLIND = 1e7  # condition number from which a combination of parameters cannot be seen
_ELSEWHERE = 0.1  # in the searched scale
_FINISHED = 2  # descents that are finished at the accurate level
_RIVAL = 1.01  # ... if their cost is not larger than the least by this factor, which is what `fast` may be off


@dataclass(frozen=True)
class Estimate:
    """One parameter in SI: value, standard deviation, 95 % interval, and the bound it ran to."""

    value: float
    std: float
    ci95: tuple[float, float]
    at_bound: Literal["low", "high"] | None


@dataclass(frozen=True)
class OutputFit:
    """Residual sum of squares, its root mean, and 100 (1 - |y - yhat| / |y - mean|), in SI."""

    rss: float
    rmse: float
    fit_percent: float


@dataclass(frozen=True)
class Outcome:
    """How a fit ended: numerical failure is a value, with its text as the message."""

    kind: Literal["converged", "at bound", "evaluation limit", "diverged", "not identifiable"]
    text: str


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
    patience: int = 4,
    seed: int = 0,
    level: Level = "accurate",
    initial: Initial = "auto",
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
    patience : int
        Further fields of as many descents are tried, until the residual is white or this many have not improved
        on the best one. With 0 it stays with the first field.
    seed : int
        Of the candidates.
    level : {'accurate', 'fast', 'euler'}
    initial : {'auto', 'rest', 'samples', 'estimated'}
        State before the first sample: at rest, moving as the first samples say, or estimated with the parameters
        within what the sensor's noise allows. ``auto`` is at rest unless the first samples clearly move, then
        estimated.
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
    settings = Settings(
        f_tanh=_SHARPNESS / known.speed if f_tanh is None else f_tanh,
        speed_scale=known.speed,
        level="euler" if level == "euler" else "fast",
        hold=recordings[0].hold,
    )
    problem = Problem.of(structure, recordings, threads, initial)
    search = search_space(structure, known, bounds or {}, fixed or {}, problem.unknown)
    given = [] if start is None else [start] if isinstance(start, Mapping) else list(start)
    found = explore(problem, search, settings, given, starts=starts, patience=patience, seed=seed)
    ends = found.ends
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    final = replace(settings, level=level)
    finished = [descend(problem, search, final, ends[i].values) for i in _finalists(search, ends, order)]
    best = min(finished, key=lambda d: d.cost)
    evaluations = found.evaluations + sum(d.evaluations for d in finished)
    tried = tuple(
        Start(_named(search, found.begins[:, i]), _named(search, ends[i].values), ends[i].cost, ends[i].converged)
        for i in order
    )
    estimates = _estimates(search, best, recordings)
    return Fit(
        structure=structure,
        estimates={name: estimates[name] for name in structure.parameters},
        bounds=dict(zip(search.names, zip(search.low.tolist(), search.high.tolist(), strict=True), strict=True)),
        settings=final,
        initial_states=problem.states(_named(search, best.values), final.f_tanh),
        train=_train(problem, best.residual),
        outcome=_outcome(search, best, estimates),
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


def _finalists(search: Search, ends: Sequence[End], order: Sequence[int]) -> list[int]:
    """Ends that may turn out as the best one at the final level: nearly as good as it, and elsewhere."""
    chosen = [order[0]]
    for i in order[1:]:
        apart = [np.abs(search.inward(ends[i].values) - search.inward(ends[j].values)).max(initial=0.0) for j in chosen]
        if ends[i].cost <= _RIVAL * ends[order[0]].cost and min(apart) > _ELSEWHERE and len(chosen) < _FINISHED:
            chosen.append(i)
    return chosen


def _named(search: Search, values: Array) -> dict[str, float]:
    return dict(zip(search.names, values.tolist(), strict=True)) | dict(search.fixed)


def _estimates(search: Search, best: Descent, recordings: Sequence[Recording]) -> dict[str, Estimate]:
    """Values with intervals in the searched scale; a parameter at its bound has none, and lends none to others."""
    theta, low, high = (search.inward(v) for v in (best.values, search.low, search.high))
    near = _AT_BOUND * (high - low)
    side = np.where(theta - low <= near, -1, np.where(high - theta <= near, 1, 0))
    inside = np.flatnonzero(side == 0)
    lengths = [r.samples for r in recordings for _ in r.outputs]
    std = np.full(len(theta), np.nan)
    if len(inside):
        spread = covariance(best.residual, best.jacobian[:, inside], lengths)
        std[inside] = np.sqrt(np.maximum(np.diag(spread), 0.0))
    result = {name: Estimate(value, 0.0, (value, value), None) for name, value in search.fixed.items()}
    for i, name in enumerate(search.names):
        value, s = float(best.values[i]), float(std[i])
        half = 1.96 * s
        if search.log[i]:
            interval = (value * float(np.exp(-min(half, 700.0))), value * float(np.exp(min(half, 700.0))))
            s *= value
        else:
            half *= float(search.width[i])
            interval = (value - half, value + half)
            s *= float(search.width[i])
        if not np.isfinite(s):
            interval = (np.nan, np.nan)
        at: dict[int, Literal["low", "high"] | None] = {-1: "low", 0: None, 1: "high"}
        result[name] = Estimate(value, s, interval, at[int(side[i])])
    return result


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


def _outcome(search: Search, best: Descent, estimates: Mapping[str, Estimate]) -> Outcome:
    """What there is to say about the end of the fit, the gravest first."""
    if not np.isfinite(best.cost) or (not np.any(best.jacobian) and search.names):
        return Outcome("diverged", "no parameter set gave a finite simulation that depends on the parameters")
    inside = [i for i, name in enumerate(search.names) if estimates[name].at_bound is None]
    condition, direction = weakest(best.jacobian[:, inside])
    if condition > _BLIND:
        involved = [search.names[i] for i, share in zip(inside, direction, strict=True) if abs(share) > 0.3]
        text = f"this recording cannot tell {' and '.join(involved)} apart"
        return Outcome("not identifiable", text if len(involved) > 1 else f"this recording does not show {involved[0]}")
    ran = [f"{name} at its {e.at_bound} bound" for name, e in estimates.items() if e.at_bound]
    if ran:
        return Outcome("at bound", ", ".join(ran))
    if not best.converged:
        return Outcome("evaluation limit", f"no optimum within {best.evaluations} batches of simulations")
    return Outcome("converged", "the cost has a minimum here, inside all bounds")
