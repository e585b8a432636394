"""Multistart search for the global optimum: batches of starts until the residual is white or nothing improves.

The cost of an elastic drive has many local minima: a resonance at a slightly wrong frequency is worse than none. Six
measures help against them:

- Descents begin on the first part of the recording, where few periods have passed and the valleys are wide. With hard
  limits, which make the cost rugged, that part grows step by step.
- Other batches begin with output feedback of decreasing gain
  (:mod:`~brightgrey.estimation.problem.output_feedback`); with hard limits every second one.
- Later batches, and with given optima the first, hold perturbed copies of the best ones (iterated local search).
- Some starts have a resonance at a peak of the residual of the best optimum.
- Where batches bring nothing new, resonances are scanned line by line.
- Every batch holds fresh samples, so that no optimum is final.

A white residual alone proves little: 1800 samples may pass any test with 3 % more power than the noise has. So the
search ends early only if independent starts agree, too, and no parameter is at a bound. With a patience of one batch,
which the structure search uses, bounds do not count: there they are the rule.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.residual_analysis import is_white
from brightgrey.estimation.optimisation.least_squares import SAME_OPTIMUM_RTOL, Optimum, fit_many
from brightgrey.estimation.optimisation.options import MULTISTART_DEFAULTS, MultistartOptions
from brightgrey.estimation.optimisation.start_points import (
    best_diverse,
    given_starts,
    perturbed_starts,
    resonance_scan,
    starts_at_residual_peaks,
    torque_rows,
)
from brightgrey.estimation.optimisation.torque_regression import with_regressed_sizes, with_waves
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = [
    "DescentBatch",
    "MultistartResult",
    "agreeing_starts",
    "first_starts",
    "growing_horizons",
    "multistart",
]


@dataclass(frozen=True)
class MultistartResult:
    """Result of a multistart search."""

    starts: Array  #: SI, shape (P, S).
    optima: tuple[Optimum, ...]  #: In the order of the starts.
    evaluations: int  #: Batches of simulations.
    simulations: SimulationCount
    agreeing: int  #: Independent starts that have reached the best optimum.


class DescentBatch(NamedTuple):
    """A batch of starts and the optima that they led to."""

    starts: list[Array]  #: SI, shape (P,).
    optima: list[Optimum]  #: In the order of the starts.
    independent: list[bool]  #: True for starts that do not derive from earlier optima.
    evaluations: int  #: Batches of simulations.
    simulations: SimulationCount

    @property
    def least_cost(self) -> float:
        """Least cost of the optima."""
        return min((optimum.cost for optimum in self.optima), default=np.inf)


class _StartBatch(NamedTuple):
    """Starts in SI, each of shape (P,), a mask of the independent ones, and the simulations that chose them."""

    starts: list[Array]
    independent: list[bool]
    simulations: SimulationCount = SimulationCount()


def multistart(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    given: Sequence[Mapping[str, float]] | None,
    *,
    starts: int,
    patience: int,
    seed: int,
    enough: float = np.inf,
    cost_to_beat: float = np.inf,
    options: MultistartOptions = MULTISTART_DEFAULTS,
) -> MultistartResult:
    """Search for the global optimum by batches of starts.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    given : sequence of mapping of str to float, optional
        Starts of the first batch, SI, in place of the declared one; samples fill it up. They may be earlier optima, so
        they do not count as independent.
    starts : int
        Starts per batch. Some more balance the torques.
    patience : int
        Batches without improvement after which the search ends, a quarter as many if the residual is white; 0 for the
        first batch alone. With hard limits half as many again.
    seed : int
    enough : float
        Cost above which a white residual does not end the search, because another structure is known to fit better.
    cost_to_beat : float
        Cost above which an optimum is of no use: descents that would not get below it soon are given up.
    options : MultistartOptions
    """
    patience = int(options.hard_limit_patience * patience) if problem.has_hard_limit else patience
    search = _Multistart(problem, space, settings, options, starts, enough, cost_to_beat)
    first = _first_starts(space, given)
    if given and _grows(problem):  # the first part of a recording may lose the quality of a given start
        search.descend([], first, search.agreeing)
    for number in range(1 + options.max_batches * patience):
        search.next_batch(number, first, np.random.default_rng([seed, number]))
        if patience > 1 and search.idle % options.scan_interval == 1:
            search.scan_resonances()
        if search.idle >= patience or not space.names or search.is_finished(patience):
            break
        first = _StartBatch([], []) if search.leader.converged else _StartBatch([search.leader.values], [False])
    return search.result()


@dataclass
class _Multistart:
    """State of a multistart search: the batches so far, and the number of batches without improvement."""

    problem: SimulationErrorProblem
    space: ParameterSpace
    settings: Settings
    options: MultistartOptions
    starts: int
    enough: float = np.inf
    cost_to_beat: float = np.inf
    batches: list[DescentBatch] = field(default_factory=list)
    scanned_costs: list[float] = field(default_factory=list)
    idle: int = 0

    @property
    def agreeing(self) -> int:
        """Independent starts that have to agree."""
        return min(self.options.agreeing, self.starts)

    @property
    def optima(self) -> list[Optimum]:
        """All optima so far."""
        return [optimum for batch in self.batches for optimum in batch.optima]

    @property
    def leader(self) -> Optimum:
        """Best optimum so far."""
        return min(self.optima, key=lambda optimum: optimum.cost)

    @property
    def least_cost(self) -> float:
        """Least cost so far."""
        return min((batch.least_cost for batch in self.batches), default=np.inf)

    def result(self) -> MultistartResult:
        """Result of all batches."""
        starts = np.stack([start for batch in self.batches for start in batch.starts], axis=1)
        simulations = sum((batch.simulations for batch in self.batches), SimulationCount())
        evaluations = sum(batch.evaluations for batch in self.batches)
        return MultistartResult(starts, tuple(self.optima), evaluations, simulations, agreeing_starts(self.batches))

    def next_batch(self, number: int, first: _StartBatch, rng: np.random.Generator) -> None:
        """Choose the starts of a batch, `first` among them, and descend from them."""
        missing = self.agreeing - agreeing_starts(self.batches)
        stages = _stages(self.problem, number, self.options, rng)
        easiest = stages[0] if stages else self.problem
        batch = self.choose_starts(easiest, first, rng, number)
        least = self.least_cost
        self.descend(stages, batch, missing)
        self.idle = 0 if self.batches[-1].least_cost < self.options.improvement * least else self.idle + 1

    def choose_starts(
        self, easiest: SimulationErrorProblem, first: _StartBatch, rng: np.random.Generator, number: int = 0
    ) -> _StartBatch:
        """Starts of one batch: the `first` ones, and equally many samples and perturbed optima.

        The first batch has samples, and beside them perturbed optima of the given starts. Samples are judged by the
        `easiest` problem, on which the descents begin.
        """
        space, settings, options, optima = self.space, self.settings, self.options, self.optima
        missing = max(self.starts - len(first.starts), 0)
        beside = self.starts if optima else 0
        wanted, near = (missing - missing // 2, missing // 2) if number else (missing, beside)
        if not (wanted or near) or not space.names:
            return first
        samples = space.sample(options.candidates_per_parameter * (1 + len(space.names)), rng)
        fresh, count = self.fresh_starts(easiest, samples, wanted)
        tuned, rest = list[Array](), list[Array]()
        if near:
            torques, parents = torque_rows(self.problem.structure, space), _best(optima, options.parents)
            perturbed = perturbed_starts(space, parents, samples, rng, torques, options.start_points)
            count += easiest.count(perturbed.shape[1])
            if easiest is self.problem:
                tuned, tuning = self.starts_at_peaks(near // 2, rng)
                count += tuning
            rest = best_diverse(easiest, space, settings, perturbed, near - len(tuned), options.start_points)
        independent = first.independent + [True] * len(fresh) + [False] * len(tuned + rest)
        return _StartBatch(first.starts + fresh + tuned + rest, independent, count)

    def fresh_starts(
        self, easiest: SimulationErrorProblem, samples: Array, count: int
    ) -> tuple[list[Array], SimulationCount]:
        """Best `count` of the samples, shape (P, K), and some more with sizes that balance the torques.

        The latter take the drive for rigid. Drives with shafts have other optima, too, so they come in addition.
        """
        space, settings, options = self.space, self.settings, self.options
        chosen = best_diverse(easiest, space, settings, samples, count, options.start_points)
        simulations, balanced = easiest.count(samples.shape[1]), round(options.balanced_share * count)
        if count and any(p.effect.search.wave for p in self.problem.structure.placed):
            balanced = max(balanced, 1)  # draws seldom meet the right number of periods
        part = samples[:, : samples.shape[1] * balanced // max(count, 1)]
        regressed = with_regressed_sizes(self.problem, space, settings, with_waves(self.problem, space, settings, part))
        if regressed is None:
            return chosen, simulations
        chosen += best_diverse(easiest, space, settings, regressed, balanced, options.start_points)
        return chosen, simulations + easiest.count(regressed.shape[1])

    def starts_at_peaks(self, count: int, rng: np.random.Generator) -> tuple[list[Array], SimulationCount]:
        """Best `count` starts with a resonance at a peak of the leader's residual, after a few rounds of descent.

        Before these rounds, resonances are off in phase and size, and most starts like the leader fit better.
        """
        problem, space, settings, leader = self.problem, self.space, self.settings, self.leader
        simulations = problem.count(1)
        if self.is_explained(leader):
            return [], simulations
        starts = starts_at_residual_peaks(problem, space, settings, leader.values, self.options.peak_starts, rng)
        simulations += problem.count(1)
        if not (starts.size and count):
            return [], simulations
        tuned = fit_many(problem, space, settings, starts, limit=self.options.tuning_rounds)
        return _best(tuned, count), simulations + problem.count(_sets(tuned))

    def scan_resonances(self) -> None:
        """Scan the resonances of an optimum, and descend from the best frequencies.

        It is the best converged optimum that has not been scanned: one that is not the leader may be nearer to the
        global optimum in all but the resonance. Starts are chosen after a few rounds of descent, because a resonance of
        the wrong size looks worse than it is.
        """
        problem, space, settings, options = self.problem, self.space, self.settings, self.options
        seen = np.array(self.scanned_costs)
        unscanned = [o for o in self.optima if o.converged and not np.isclose(o.cost, seen, SAME_OPTIMUM_RTOL, 0).any()]
        leader = self.leader
        if not unscanned or self.is_explained(leader):
            self.batches.append(DescentBatch([], [], [], 0, problem.count(min(len(unscanned), 1))))
            return
        parent = min(unscanned, key=lambda optimum: optimum.cost)
        self.scanned_costs.append(parent.cost)
        starts, sets = resonance_scan(
            problem, space, settings, parent.values, options.scan_starts, options.start_points
        )
        simulations = problem.count(1 + sets)
        if not starts.size:
            self.batches.append(DescentBatch([], [], [], 0, simulations))
            return
        tuned = fit_many(problem, space, settings, starts, limit=options.tuning_rounds)
        best = _best(tuned, options.scan_kept)
        stacked = np.stack(best, axis=1)
        optima = fit_many(problem, space, settings, stacked, limit=options.rounds, cost_to_beat=leader.cost)
        evaluations = _evaluations(tuned) + _evaluations(optima)
        simulations += problem.count(_sets(tuned) + _sets(optima))
        self.batches.append(DescentBatch(best, optima, [False] * len(optima), evaluations, simulations))
        self.idle = 0 if self.batches[-1].least_cost < options.improvement * leader.cost else self.idle

    def descend(self, stages: Sequence[SimulationErrorProblem], batch: _StartBatch, min_agreeing: int) -> None:
        """Descend from a batch of starts through all `stages`, then on the whole problem."""
        problem, space, settings, options = self.problem, self.space, self.settings, self.options
        starts, simulations = np.stack(batch.starts, axis=1), batch.simulations
        evaluations, limit, tolerance = 0, options.first_rounds, options.stage_tolerance
        for stage in stages:
            rough = fit_many(stage, space, settings, starts, limit=limit, tolerance=tolerance, cost_to_beat=np.inf)
            evaluations += _evaluations(rough)
            simulations += stage.count(_sets(rough))
            starts, limit = np.stack([optimum.values for optimum in rough], axis=1), options.stage_rounds
        optima = fit_many(
            problem,
            space,
            settings,
            starts,
            limit=options.rounds,
            cost_to_beat=min(self.least_cost, self.cost_to_beat),
            stop_when=self.is_enough,
            min_agreeing=min_agreeing,
        )
        evaluations += _evaluations(optima)
        simulations += problem.count(_sets(optima))
        self.batches.append(DescentBatch(batch.starts, optima, batch.independent, evaluations, simulations))

    def is_finished(self, patience: int) -> bool:
        """True if the residual is white, and starts agree or part of the patience is used up."""
        leader, space = self.leader, self.space
        at_bound = np.any(space.active_bounds(leader.values)[space.high > space.low])
        agreed = not (at_bound and patience > 1) and agreeing_starts(self.batches) >= self.agreeing
        if not (agreed or self.idle >= self.options.agreement_patience * patience):
            return False
        self.batches.append(DescentBatch([], [], [], 0, self.problem.count(1)))
        return self.is_explained(leader)

    def is_enough(self, residual: Array) -> bool:
        """True if a residual is white, and no other structure leaves less."""
        return float(residual @ residual) <= self.enough and is_white(residual, self.problem.segment_lengths)

    def is_explained(self, optimum: Optimum) -> bool:
        """True if the residual of an optimum is white, and no other structure leaves less."""
        return self.is_enough(self.problem.residuals(self.space.named(optimum.values[:, None]), self.settings)[:, 0])


def first_starts(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    given: Sequence[Mapping[str, float]] | None,
    starts: int,
    rng: np.random.Generator,
) -> list[Array]:
    """Starts of the first batch, each of shape (P,), SI: those given, or the declared one, and the best samples."""
    search = _Multistart(problem, space, settings, MULTISTART_DEFAULTS, starts)
    return search.choose_starts(problem, _first_starts(space, given), rng).starts


def growing_horizons(share: float, options: MultistartOptions = MULTISTART_DEFAULTS) -> Iterator[float]:
    """Growing parts of the excitation, less than the whole, on which a drive is fitted in succession.

    Contacts and unstable motions make the valley of the cost narrower the longer the recording is. From one part to
    the next, the estimate has to improve more than the valley narrows.
    """
    while share < 1.0:
        yield share
        share *= options.share_growth


def agreeing_starts(batches: Sequence[DescentBatch]) -> int:
    """Number of independent starts that have reached the best optimum of all batches."""
    least = min((batch.least_cost for batch in batches), default=0.0)
    pairs = (pair for batch in batches for pair in zip(batch.optima, batch.independent, strict=True))
    return sum(independent and o.cost <= (1.0 + SAME_OPTIMUM_RTOL) * least for o, independent in pairs)


def _stages(
    problem: SimulationErrorProblem, number: int, options: MultistartOptions, rng: np.random.Generator
) -> list[SimulationErrorProblem]:
    """Easier problems that the descents of batch `number` pass through: truncated ones, or with output feedback."""
    share = options.shares[number % len(options.shares)]
    if problem.has_hard_limit:
        low, high = np.log(options.min_share), np.log(options.first_share)
        share = None if number % 2 else float(np.exp(rng.uniform(low, high)))
    if share is None:
        stages = [problem.with_output_feedback(gain) for gain in options.feedback_shares]
        return [stage for stage in stages if stage is not None]
    shares = growing_horizons(share, options) if _grows(problem) else [share] if share < 1.0 else []
    parts = [problem.truncated(share) for share in shares]
    longer = [k == 0 or part.samples > parts[k - 1].samples for k, part in enumerate(parts)]
    return [part for part, more in zip(parts, longer, strict=True) if more and part.samples < problem.samples]


def _grows(problem: SimulationErrorProblem) -> bool:
    """True if descents begin on a small part of the recordings: hard limits and instability make the cost rugged."""
    return problem.has_hard_limit or problem.structure.may_be_unstable


def _first_starts(space: ParameterSpace, given: Sequence[Mapping[str, float]] | None) -> _StartBatch:
    if given is None or not space.names:
        return _StartBatch([space.start], [True])
    return _StartBatch(given_starts(space, given), [False] * len(given))


def _best(optima: Sequence[Optimum], count: int) -> list[Array]:
    return [optimum.values for optimum in sorted(optima, key=lambda optimum: optimum.cost)[:count]]


def _sets(optima: Sequence[Optimum]) -> int:
    return sum(optimum.simulations for optimum in optima)


def _evaluations(optima: Sequence[Optimum]) -> int:
    return max(optimum.evaluations for optimum in optima)
