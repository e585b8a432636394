"""Search for the global optimum: fields of starts, until the residual is explained or nothing improves.

The cost of an elastic drive has many local minima: a resonance that is a little off is worse than none. Six
things help against them. Descents begin on the beginning of the recording, where few periods have passed and
the valleys are wide; where limits make the cost rugged, the beginning grows step by step. Other fields begin with
simulations that are held to the measured motion, less and less (:mod:`~brightgrey.estimation.problem.output_feedback`):
with limits every
second one. Later fields hold offspring of the best ends so far, with some parameters drawn anew (iterated local
search), and some that ring where the residual of the best end does. Where fields bring nothing new, resonances are
looked for line by line. Every field holds fresh starts, so that no optimum is final.

A white residual alone proves little: 1800 samples may be white to any test, with 3 % more power than the noise
has. So the search ends early only if independent starts agree, too, and no parameter has run to a bound (but with a
patience of one field, that of the search for structures, where bounds are the rule).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import SAME_OPTIMUM_RTOL, Optimum, fit_many
from brightgrey.estimation.optimisation.start_points import (
    best_diverse,
    given_starts,
    perturbed_starts,
    resonance_scan,
    starts_at_residual_peaks,
)
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = [
    "FIRST_BEGINNING",
    "FURTHER_ROUNDS",
    "MultistartResult",
    "first_field",
    "growing_horizons",
    "is_white",
    "multistart",
]

_PER_PARAMETER = 16  # candidates
_FIRST_ROUNDS, _ROUNDS = 20, 40  # on a beginning, on the whole
_GROWTH = 1.15  # of the beginning, with limits
FIRST_BEGINNING = 0.3
"""Part of the recordings on which descents begin; with limits the most of it."""
FURTHER_ROUNDS = 6
"""Of a descent on each stage after the first."""
_HELD = (3.0, 1.0, 0.3, 0.1, 0.03)  # how firmly, in one descent after the other
_BEGINNINGS = (FIRST_BEGINNING, None, 1.0, 0.6)  # of one field after the other; None: held to the measured motion
_LEAST_BEGINNING = 0.05  # with limits: drawn from there to the first one, since no one part is best for all
_ROUGH = 1e-3  # tolerance on a beginning
_PARENTS = 4  # best ends that have offspring
_RETUNED, _TUNING = 48, 3  # starts that ring where the residual does, and rounds after which the best are chosen
_HEARD, _HEARD_BEST = 16, 2  # valleys among lines, and those that are descended from
_LISTEN = 4  # fields without improvement from one look for a resonance to the next; the first after one
_AGREE = 2  # independent starts that make an optimum trustworthy
_DOUBT = 0.25  # of the patience, if the residual is white and starts do not agree or one is at a bound
_MOST = 4  # fields per unit of patience
_RUGGED = 1.5  # times the patience, with limits
_IMPROVED = 0.995  # of the least cost: what counts as an improvement
_LAGS = 25
_WHITE = 50.0  # Ljung-Box statistic that white residuals exceed once in 500 (chi-squared, 25 lags)


@dataclass(frozen=True)
class MultistartResult:
    """Starts, shape (P, S) in SI, and their ends, in the order of the search; the batches and all that it took."""

    begins: Array
    ends: tuple[Optimum, ...]
    evaluations: int
    spent: SimulationCount


def multistart(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    given: Sequence[Mapping[str, float]],
    *,
    starts: int,
    patience: int,
    seed: int,
) -> MultistartResult:
    """Descend from field after field of starts.

    Parameters
    ----------
    problem : SimulationErrorProblem
    search : ParameterSpace
    settings : Settings
    given : sequence of mapping of str to float
        Starts of the first field, SI. What they and the declared start leave is filled up.
    starts : int
        Descents per field.
    patience : int
        Fields without improvement after which the search ends, a quarter as many if the residual is white; 0 for the
        first field alone. With limits half as many again.
    seed : int
    """
    patience = int(_RUGGED * patience) if problem.has_hard_limit else patience
    parts: list[_Part] = []
    ends: list[Optimum] = []
    heard: list[float] = []
    best, idle, needed = np.inf, 0, min(_AGREE, starts)
    first = _first(search, given, starts)
    if given and problem.has_hard_limit:  # a short beginning may lose what a given start is good for
        field = _StartField(first[: len(given)], [False] * len(given))
        parts.append(_descended(problem, [], search, settings, field, best, needed))
        ends += parts[-1].ends
        best = parts[-1].least
    for number in range(1 + _MOST * patience):
        rng = np.random.default_rng([seed, number])
        missing = needed - _agreeing(parts)
        stages = _stages(problem, number, rng)
        before = ends if number else []
        field = _field(problem, [*stages, problem][0], search, settings, first, before, starts, rng)
        part = _descended(problem, stages, search, settings, field, best, missing)
        parts, ends = [*parts, part], ends + part.ends
        idle = 0 if part.least < _IMPROVED * best else idle + 1
        best = min(best, part.least)
        if patience > 1 and idle % _LISTEN == 1:
            part = _resonance_restarts(problem, search, settings, ends, heard)
            parts, ends = [*parts, part], ends + part.ends
            idle = 0 if part.least < _IMPROVED * best else idle
            best = min(best, part.least)
        if idle >= patience or not search.names:
            break
        leader = min(ends, key=lambda end: end.cost)
        bound = np.any(search.active_bounds(leader.values)[search.high > search.low])
        agreed = not (bound and patience > 1) and _agreeing(parts) >= needed
        if agreed or idle >= _DOUBT * patience:
            parts.append(_Part([], [], [], 0, problem.spent(1)))
            if _explained(problem, search, settings, leader):
                break
        first = [] if leader.converged else [leader.values]
    begins = np.stack([begin for part in parts for begin in part.starts], axis=1)
    spent = sum((part.spent for part in parts), SimulationCount())
    return MultistartResult(begins, tuple(ends), sum(part.batches for part in parts), spent)


class _Part(NamedTuple):
    """Starts in SI, each of shape (P,), their ends, which of them owe nothing to ends before; and what it took."""

    starts: list[Array]
    ends: list[Optimum]
    alone: list[bool]
    batches: int
    spent: SimulationCount

    @property
    def least(self) -> float:
        """Least cost of its ends."""
        return min((end.cost for end in self.ends), default=np.inf)


def _first(search: ParameterSpace, given: Sequence[Mapping[str, float]], starts: int) -> list[Array]:
    return [*given_starts(search, given), search.start][: max(starts, len(given), 1)]


def first_field(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    given: Sequence[Mapping[str, float]],
    starts: int,
    rng: np.random.Generator,
) -> list[Array]:
    """Starts of the first field, each of shape (P,), SI: those given, the declared one, and the best candidates."""
    return _field(problem, problem, search, settings, _first(search, given, starts), [], starts, rng).starts


class _StartField(NamedTuple):
    """Starts in SI, each of shape (P,), which of them owe nothing to ends before, and what it took to choose them."""

    starts: list[Array]
    alone: list[bool]
    spent: SimulationCount = SimulationCount()


def _field(
    problem: SimulationErrorProblem,
    part: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    first: list[Array],
    ends: Sequence[Optimum],
    starts: int,
    rng: np.random.Generator,
) -> _StartField:
    """Starts of one field: the first ones, and of fresh ones and offspring of the best ends equally many.

    Candidates are judged by the `part` of the problem that descents begin on.
    """
    missing = starts - len(first)
    if missing <= 0 or not search.names:
        return _StartField(first, [not ends] * len(first))
    candidates = search.sample(_PER_PARAMETER * (1 + len(search.names)), rng)
    if not ends:
        chosen = first + best_diverse(part, search, settings, candidates, missing)
        return _StartField(chosen, [True] * starts, part.spent(candidates.shape[1]))
    young = perturbed_starts(search, _best(ends, _PARENTS), candidates, rng)
    half = missing // 2
    fresh = best_diverse(part, search, settings, candidates, missing - half)
    leader = min(ends, key=lambda end: end.cost)
    spent = part.spent(candidates.shape[1] + young.shape[1]) + problem.spent(part is problem)
    rings = part is problem and not _explained(problem, search, settings, leader)
    tuned, tuning = (
        _resonance_starts(problem, search, settings, leader.values, half // 2, rng)
        if rings
        else ([], SimulationCount())
    )
    chosen = first + fresh + tuned + best_diverse(part, search, settings, young, half - len(tuned))
    return _StartField(chosen, [False] * len(first) + [True] * len(fresh) + [False] * half, spent + tuning)


def _resonance_starts(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    parent: Array,
    count: int,
    rng: np.random.Generator,
) -> tuple[list[Array], SimulationCount]:
    """Best `count` of the starts that ring where the residual of `parent` does, after a few rounds of descent.

    And what that took. At first their resonances are off in phase and size, and most starts like the parent fit better.
    """
    begins = starts_at_residual_peaks(problem, search, settings, parent, _RETUNED, rng)
    looked = problem.spent(1)
    if not (begins.size and count):
        return [], looked
    ends = fit_many(problem, search, settings, begins, limit=_TUNING)
    return _best(ends, count), looked + problem.spent(_sets(ends))


def _resonance_restarts(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    ends: Sequence[Optimum],
    heard: list[float],
) -> _Part:
    """Starts that ring where they explain most, about an end, and their ends.

    Of the ends it is the best one that has converged and is not among those whose costs are in `heard`, where it is
    added: one that is not the leader may lie nearer to the optimum in all but the resonance. Starts are chosen after
    a few rounds of descent, since a resonance that is off in size looks worse than it is.
    """
    fresh = [
        end for end in ends if end.converged and all(abs(end.cost - cost) > SAME_OPTIMUM_RTOL * cost for cost in heard)
    ]
    leader = min(ends, key=lambda end: end.cost)
    if not fresh or _explained(problem, search, settings, leader):
        return _Part([], [], [], 0, problem.spent(min(len(fresh), 1)))
    parent = min(fresh, key=lambda end: end.cost)
    heard.append(parent.cost)
    begins, sets = resonance_scan(problem, search, settings, parent.values, _HEARD)
    spent = problem.spent(1 + sets)
    if not begins.size:
        return _Part([], [], [], 0, spent)
    rough = fit_many(problem, search, settings, begins, limit=_TUNING)
    tuned = _best(rough, _HEARD_BEST)
    found = fit_many(problem, search, settings, np.stack(tuned, axis=1), limit=_ROUNDS, cost_to_beat=leader.cost)
    batches = sum(max(end.evaluations for end in some) for some in (rough, found))
    return _Part(tuned, found, [False] * len(found), batches, spent + problem.spent(_sets(rough) + _sets(found)))


def _best(ends: Sequence[Optimum], count: int) -> list[Array]:
    return [end.values for end in sorted(ends, key=lambda end: end.cost)[:count]]


def _sets(ends: Sequence[Optimum]) -> int:
    return sum(end.simulations for end in ends)


def _stages(problem: SimulationErrorProblem, number: int, rng: np.random.Generator) -> list[SimulationErrorProblem]:
    """What descents of a field begin on: a beginning, or held to the measured motion, less and less."""
    if problem.has_hard_limit:
        share = None if number % 2 else float(np.exp(rng.uniform(np.log(_LEAST_BEGINNING), np.log(FIRST_BEGINNING))))
    else:
        share = _BEGINNINGS[number % len(_BEGINNINGS)]
    if share is None:
        held = [problem.with_output_feedback(firmly) for firmly in _HELD]
        return [stage for stage in held if stage is not None]
    shares = growing_horizons(share) if problem.has_hard_limit else [share] if share < 1.0 else []
    parts = [problem.truncated(share) for share in shares]
    longer = [k == 0 or part.samples > parts[k - 1].samples for k, part in enumerate(parts)]
    return [part for part, more in zip(parts, longer, strict=True) if more and part.samples < problem.samples]


def _descended(
    whole: SimulationErrorProblem,
    stages: Sequence[SimulationErrorProblem],
    search: ParameterSpace,
    settings: Settings,
    field: _StartField,
    best: float,
    needed: int,
) -> _Part:
    """Ends of a field that has descended through all `stages` first."""
    begins = np.stack(field.starts, axis=1)
    batches, spent = 0, field.spent
    rounds = _FIRST_ROUNDS
    for stage in stages:
        rough = fit_many(stage, search, settings, begins, limit=rounds, tolerance=_ROUGH, cost_to_beat=np.inf)
        batches += max(end.evaluations for end in rough)
        spent += stage.spent(_sets(rough))
        begins, rounds = np.stack([end.values for end in rough], axis=1), FURTHER_ROUNDS
    ends = fit_many(
        whole,
        search,
        settings,
        begins,
        limit=_ROUNDS,
        cost_to_beat=best,
        stop_when=lambda r: is_white(whole, r),
        min_agreeing=needed,
    )
    batches += max(end.evaluations for end in ends)
    return _Part(field.starts, ends, field.alone, batches, spent + whole.spent(_sets(ends)))


def growing_horizons(share: float) -> Iterator[float]:
    """Beginnings, less than the whole, to descend on one after the other where there are limits.

    Contacts make the valley of the cost narrower the longer the recording is. From one beginning to the next the
    estimate has to become better than the valley narrower.
    """
    while share < 1.0:
        yield share
        share *= _GROWTH


def _agreeing(parts: Sequence[_Part]) -> int:
    """How many independent starts have ended at the best optimum."""
    least = min((part.least for part in parts), default=0.0)
    ended = (pair for part in parts for pair in zip(part.ends, part.alone, strict=True))
    return sum(own and end.cost <= (1.0 + SAME_OPTIMUM_RTOL) * least for end, own in ended)


def _explained(problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, end: Optimum) -> bool:
    return is_white(problem, problem.residuals(search.named(end.values[:, None]), settings)[:, 0])


def is_white(problem: SimulationErrorProblem, residual: Array) -> bool:
    """Whether nothing is left to explain: no autocorrelation within any output (Ljung and Box 1978)."""
    begin = 0
    for r in problem.recordings:
        for piece in residual[begin : begin + r.y.size].reshape(r.y.shape):
            n, power = len(piece), float(piece @ piece)
            lags = range(1, min(_LAGS, n // 4) + 1)
            rho = np.array([float(piece[k:] @ piece[:-k]) for k in lags]) / max(power, 1e-300)
            if n * (n + 2) * np.sum(rho**2 / (n - np.array(lags))) > _WHITE:
                return False
        begin += r.y.size
    return True
