"""Estimation of the parameters of a given structure: starts, descent, uncertainty, outcome."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales
from brightgrey.errors import SettingsError, one_of
from brightgrey.estimation.diagnostics.cautions import cautions
from brightgrey.estimation.diagnostics.chaos import chaos_findings
from brightgrey.estimation.diagnostics.equivalent_models import resolve_lag_pole_exchange
from brightgrey.estimation.diagnostics.informativity import recording_findings
from brightgrey.estimation.diagnostics.instability import instability_findings
from brightgrey.estimation.diagnostics.outcome import FitContext, Outcome, outcome_of, unfitted
from brightgrey.estimation.diagnostics.second_opinion import TermOpinion, contradictions, second_opinion
from brightgrey.estimation.diagnostics.short_periods import short_period_findings
from brightgrey.estimation.diagnostics.symptoms import Symptom, symptoms
from brightgrey.estimation.noise.residual_analysis import is_white, nrmse_fit_percent
from brightgrey.estimation.optimisation.choice_of_optima import best_different, finalists
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_many, fit_to_convergence
from brightgrey.estimation.optimisation.multistart import MultistartResult, first_starts, multistart
from brightgrey.estimation.optimisation.options import FIT_DEFAULTS, MULTISTART_DEFAULTS, FitOptions
from brightgrey.estimation.optimisation.pattern_fit import (
    ESTIMATORS,
    Estimator,
    fit_by_pattern_search,
    pattern_searches,
)
from brightgrey.estimation.optimisation.start_points import given_starts
from brightgrey.estimation.problem.decimation import decimated_together
from brightgrey.estimation.problem.initial_state import Initial
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH, FRICTION_WIDTH_RANGE, friction_width_nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.segments import segments
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.estimates import Estimate, estimates_of
from brightgrey.estimation.uncertainty.friction_width import FrictionWidth, estimated_width
from brightgrey.estimation.uncertainty.recording_estimates import estimates_in_recordings, with_spread
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings
from brightgrey.simulation.settings import Level

__all__ = ["Estimate", "Fit", "Outcome", "OutputFit", "Start", "fit", "settings_for"]


@dataclass(frozen=True)
class OutputFit:
    """Residual sum of squares and root mean square error in SI, and fit in percent (NRMSE)."""

    rss: float
    rmse: float
    fit_percent: float


@dataclass(frozen=True)
class Start:
    """One start and the optimum it led to, SI by name; `cost` is the weighted sum of squared residuals."""

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
        All parameters; a fixed one has standard deviation 0.
    bounds : mapping of str to (low, high)
    settings : Settings
        To simulate the result: friction whose width does not show has an exact sign.
    initial_states : tuple of mapping of str to float
        One per recording, by state name.
    train : mapping of str to OutputFit
        By output name, pooled over recordings.
    outcome : Outcome
    cost : float
        Sum of squared residuals, each divided by the noise of its output.
    evaluations : int
        Batches of simulations.
    starts : tuple of Start
        Best first, with their optima on all samples.
    correlation : mapping of (str, str) to float
        Correlation of the errors of two estimates, of their logarithms where parameters are positive. Parameters
        without an interval are left out.
    symptoms : tuple of Symptom
        Signs of effects that the structure lacks; none if nothing could be fitted.
    friction_width : FrictionWidth or None
        Width of friction's reversal; None if it was given, or if no friction reverses.
    second_opinion : tuple of TermOpinion
        Balance of torques without a simulation; empty where it says nothing.
    in_recordings : mapping of str to tuple of Estimate
        Parameters that may differ between the recordings, in each; `estimates` has their mean.
    deviations : mapping of str to float
        Nuisances behind them.
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
    friction_width: FrictionWidth | None = None
    second_opinion: tuple[TermOpinion, ...] = ()
    in_recordings: Mapping[str, tuple[Estimate, ...]] = field(default_factory=dict)
    deviations: Mapping[str, float] = field(default_factory=dict)

    def values_in(self, recording: int) -> dict[str, float]:
        """Values of all parameters in a recording, counted from 0, in SI."""
        mean = {name: estimate.value for name, estimate in self.estimates.items()}
        return mean | {name: each[recording].value for name, each in self.in_recordings.items()}


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
    per_recording: Collection[str] = (),
    options: FitOptions = FIT_DEFAULTS,
) -> Fit:
    """Estimate the parameters of `structure` by bounded least squares on the simulation error, or by pattern search.

    Samples that fill the bounds are simulated once. Descents at the ``fast`` level begin at the best of them, at the
    start value from the torque balance and at those of the user. Of long recordings all batches but the first go
    through every k-th sample, where the motion needs no more. The best optima are fitted again at `level`.

    Parameters
    ----------
    structure : Structure
    recordings : sequence of Recording
        Recordings of one drive, with the same outputs.
    bounds : mapping of str to (low, high), optional
        SI. Parameters that are not named take their range from the recordings.
    fixed : mapping of str to float, optional
        SI.
    f_tanh : float, optional
        Gain of the smoothed sign of friction, s/rad (s/m). By default its inverse, the width of friction's reversal,
        is estimated, too.
    start : mapping of str to float or sequence of them, optional
        Start values, SI; parameters that are not named take their declared ones. A ``friction_width`` of 0 stays 0.
    starts : int
        Descents per batch. Samples fill up what `start` and the torque balance leave of them.
    patience : int
        Further batches are tried until the residual is white and two independent starts agree, or until so many batches
        have not improved on the best optimum. With hard limits half as many again are tried, with a white residual
        a quarter as many. With 0 there is only the first batch.
    seed : int
        Seed of the samples.
    level : {'accurate', 'fast', 'euler'}
    initial : {'auto', 'rest', 'samples', 'estimated'}
        State before the first sample: at rest, moving as the first samples say, or estimated with the parameters
        within the noise of the sensor. ``auto`` is at rest unless the first samples clearly move, then estimated.
    estimator : {'least-squares', 'pattern-search'}
        Pattern search is the paper's; it takes hundreds of times as many simulations.
    per_recording : collection of str
        Parameters that may differ between recordings; the estimate is their mean.
    options : FitOptions

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
    width = friction_width_nuisance(known.speed) if f_tanh is None else None
    problem = SimulationErrorProblem.of(structure, recordings, initial, width, per_recording=per_recording)
    given = [] if start is None else [start] if isinstance(start, Mapping) else list(start)
    space = _with_friction_of(given, parameter_space(structure, known, bounds or {}, fixed or {}, problem.nuisances))
    final = replace(settings, level=level)
    on_recordings = recording_findings(recordings)
    uninformative = any(finding.kind == "not identifiable" for finding in on_recordings)
    if uninformative:
        descent = _Descent(unfitted(problem, space, final), 1, ())
    elif one_of("estimator", estimator, ESTIMATORS) == "pattern-search":
        descent = _by_pattern_search(problem, space, settings, final, given, starts, seed)
    else:
        descent = _by_multistart(problem, known, space, settings, final, given, starts, patience, seed, options)
    best, equivalent = resolve_lag_pole_exchange(problem, space, final, descent.best)
    reversal, space, best = estimated_width(problem, space, final, best)
    final = final if reversal is None or not reversal.value else replace(final, f_tanh=1.0 / reversal.value)
    estimates = estimates_of(problem, space, final, best, compare_recordings=True)
    each = estimates_in_recordings(problem, estimates)
    named = {name: with_spread(estimates.by_name[name], each.get(name, ())) for name in structure.parameters}
    context = FitContext(problem, space, final, best, estimates)
    chaotic = [] if uninformative else chaos_findings(problem, space, final, best)
    values = {name: space.by_name(best.values)[name] for name in structure.parameters}
    opinions = () if uninformative else second_opinion(structure, values, recordings, final.f_tanh)
    of_values = (*cautions(structure, named, recordings, known, final), *contradictions(opinions))
    unstable = instability_findings(problem, space.by_name(best.values), final)
    unstable += short_period_findings(problem, space.by_name(best.values), best.residual)
    beside = (*on_recordings, *equivalent, *of_values, *chaotic, *unstable)
    outcome = outcome_of(context, beside)
    return Fit(
        structure=structure,
        estimates=named,
        bounds=dict(zip(space.names, zip(space.low.tolist(), space.high.tolist(), strict=True), strict=True)),
        settings=_exact(final) if reversal is not None and reversal.is_sharp else final,
        initial_states=problem.states(space.by_name(best.values), final.f_tanh),
        train=_output_fits(problem, best.residual),
        outcome=outcome,
        cost=best.cost,
        evaluations=descent.evaluations,
        starts=descent.starts,
        correlation=estimates.correlation,
        symptoms=() if outcome.kind == "diverged" or uninformative else symptoms(context, known),
        friction_width=reversal,
        second_opinion=opinions,
        in_recordings=each,
        deviations={part.name: estimates.by_name[part.name].value for part in problem.deviations},
    )


def _begins(given: Sequence[Mapping[str, float]]) -> Sequence[Mapping[str, float]] | None:
    """Starts of the user, with the declared one beside them: theirs may be far off; None if there are none."""
    return [*given, {}] if given else None


def _with_friction_of(given: Sequence[Mapping[str, float]], space: ParameterSpace) -> ParameterSpace:
    """Space with exact friction if one of the given starts has it."""
    exact = any(values.get(FRICTION_WIDTH) == 0.0 for values in given)
    return space.fix(FRICTION_WIDTH, 0.0) if exact and FRICTION_WIDTH in space.names else space


class _Descent(NamedTuple):
    """Best optimum at the final level, batches of simulations, and all starts, best first."""

    best: OptimumWithJacobian
    evaluations: int
    starts: tuple[Start, ...]


def _by_pattern_search(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    final: Settings,
    given: Sequence[Mapping[str, float]],
    starts: int,
    seed: int,
) -> _Descent:
    """Best of several pattern searches, repeated at the final level."""
    points = first_starts(problem, space, settings, _begins(given), starts, np.random.default_rng(seed))
    ends = pattern_searches(problem, space, settings, points)
    order = sorted(range(len(ends)), key=lambda i: (ends[i].cost, i))
    values = [space.from_scaled(np.array(end.values)) for end in ends]
    best = fit_by_pattern_search(problem, space, final, values[order[0]])
    tried = tuple(
        Start(space.by_name(points[i]), space.by_name(values[i]), ends[i].cost, ends[i].reason == "mesh") for i in order
    )
    return _Descent(best, sum(end.evaluations for end in ends) + best.evaluations, tried)


def _by_multistart(
    problem: SimulationErrorProblem,
    known: Scales,
    space: ParameterSpace,
    settings: Settings,
    final: Settings,
    given: Sequence[Mapping[str, float]],
    starts: int,
    patience: int,
    seed: int,
    options: FitOptions,
) -> _Descent:
    """Best optima of a multistart search, fitted again at the final level, and so are given starts that are better.

    Descents begin on a short part of the recordings, which may lead away from what is known already. Of long recordings
    one batch goes through all samples. Where that leaves something, further ones go through every k-th sample, and
    their best optima go on with all: on every k-th, no residual would be white.
    """
    easier = problem
    if settings.level != "euler":  # it takes one step per sample, and needs short ones
        easier = replace(problem, recordings=decimated_together(problem.recordings, known.inertia))
    is_long, begins = easier.samples < problem.samples, _begins(given)
    at_first = 0 if is_long else patience
    found = multistart(problem, space, settings, begins, starts=starts, patience=at_first, seed=seed)
    optima, evaluations = list(zip(found.optima, found.starts.T, strict=True)), found.evaluations
    if is_long and patience and not _is_explained(problem, space, settings, found):
        rough = multistart(easier, space, settings, begins, starts=starts, patience=patience, seed=seed)
        best = best_different(space, list(zip(rough.optima, rough.starts.T, strict=True)), options)
        points = np.stack([optimum.values for optimum, _ in best], axis=1)
        ends = fit_many(problem, space, settings, points, cost_to_beat=np.inf)
        optima += [(end, start) for end, (_, start) in zip(ends, best, strict=True)]
        evaluations += rough.evaluations + max(end.evaluations for end in ends)
    optima.sort(key=lambda pair: pair[0].cost)
    chosen = finalists(space, [optimum for optimum, _ in optima], options)
    finished = [fit_to_convergence(problem, space, final, optimum.values) for optimum in chosen]
    least = min(fitted.cost for fitted in finished)
    better = [v for v in given_starts(space, given) if problem.costs(space.named(v[:, None]), final)[0] < least]
    finished += [fit_to_convergence(problem, space, final, values) for values in better]
    evaluations += sum(fitted.evaluations for fitted in finished)
    tried = tuple(
        Start(space.by_name(start), space.by_name(optimum.values), optimum.cost, optimum.converged)
        for optimum, start in optima
    )
    return _Descent(min(finished, key=lambda fitted: fitted.cost), evaluations, tried)


def _is_explained(
    problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings, found: MultistartResult
) -> bool:
    """True if independent starts agree on the best optimum of a multistart, and its residual is white."""
    best = min(found.optima, key=lambda optimum: optimum.cost).values
    residual = problem.residuals(space.named(best[:, None]), settings)[:, 0]
    return found.agreeing >= MULTISTART_DEFAULTS.agreeing and is_white(residual, problem.segment_lengths)


def settings_for(
    recordings: Sequence[Recording],
    known: Scales,
    f_tanh: float | None,
    level: Level = "fast",
) -> Settings:
    """Settings with which recordings are simulated: `f_tanh` in s/rad (s/m), by default nearly infinite."""
    sharpest = 1.0 / (FRICTION_WIDTH_RANGE.low * known.speed)
    return Settings(
        f_tanh=sharpest if f_tanh is None else f_tanh, speed_scale=known.speed, level=level, hold=recordings[0].hold
    )


def _exact(settings: Settings) -> Settings:
    """Settings with an exact sign of friction; the paper's method of integration cannot stop a mass."""
    return settings if settings.level == "euler" else replace(settings, f_tanh=math.inf)


def _output_fits(problem: SimulationErrorProblem, residual: Array) -> dict[str, OutputFit]:
    """Fit of each output, pooled over the recordings."""
    errors: dict[str, list[Array]] = {}
    variations: dict[str, list[Array]] = {}
    for rows, r, output in segments(problem.recordings):
        name, y = problem.recordings[0].outputs[output].name, r.y[output]
        errors.setdefault(name, []).append(residual[rows] / problem.weights[output])
        variations.setdefault(name, []).append(y - y.mean())
    result = {}
    for name in errors:
        error, variation = np.concatenate(errors[name]), np.concatenate(variations[name])
        rss = float(error @ error)
        percent = nrmse_fit_percent(rss, float(variation @ variation))
        result[name] = OutputFit(rss, float(np.sqrt(rss / len(error))), percent)
    return result
