"""Faults of a recording that a fit shows: a late output, a drift of the torque, a jump, an input of the other sign.

Parameters that move hide most of a fault from the residual, so that a test of the residual alone misses it. The fit
goes on from its optimum with delays and drifts as further unknowns. From there one step of generalised least squares
gives the size of each fault, and a Wald test asks whether it differs from zero. No fit goes on from a jump, as nobody
knows its time. One step is made for every time, and the jump that explains most is tested. A fit that misses the motion
is made once more, and again with the sign of the input turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from brightgrey.arrays import Array, positive
from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS, FAULT_DEFAULTS, DiagnosticOptions
from brightgrey.estimation.diagnostics.outcome import FitContext
from brightgrey.estimation.diagnostics.residual_tests import noise_degrees
from brightgrey.estimation.noise.autoregression import Autoregression
from brightgrey.estimation.noise.error_floor import error_variances
from brightgrey.estimation.noise.orthonormal_basis import beyond, orthonormal_basis
from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import fit_many, fit_to_convergence
from brightgrey.estimation.optimisation.multistart import first_starts
from brightgrey.estimation.problem.clock_skew import skews_of
from brightgrey.estimation.problem.drift import DriftOptions, drifts_of
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.segments import Segment, segments
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.numerics.digital_filter import lfilter
from brightgrey.numerics.distributions import norm
from brightgrey.numerics.distributions import t as student
from brightgrey.recordings.units.signals import KINDS

__all__ = ["RecordingFault", "recording_faults"]

_ANY_DRIFT = DriftOptions(shortest=0.0, largest=FAULT_DEFAULTS.largest_drift)


@dataclass(frozen=True)
class RecordingFault:
    """Fault of a recording whose size differs from zero beyond chance, SI."""

    kind: Literal["drift", "skew", "jump", "sign"]
    #: Change of the torque over a recording, time by which an output comes late, jump of a position, or part of the
    #: cost that a turned sign leaves.
    size: float
    std: float
    output: int = 0  #: Number of the output that comes late or jumps.
    recording: int = 0  #: Number of the recording in which it jumps.
    time: float = 0.0  #: Time of the jump.

    @property
    def clearness(self) -> float:
        """Size in standard deviations."""
        return abs(self.size) / self.std


def recording_faults(
    context: FitContext, options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS
) -> tuple[RecordingFault, ...]:
    """Faults of the recordings; of drifts and jumps only the clearest one, and none beside a turned sign.

    Parameters
    ----------
    context : FitContext
    options : DiagnosticOptions

    Notes
    -----
    The noise is an autoregression whose parameters are estimated, too. So the statistic has Student's distribution with
    the degrees of freedom of the noise's spectrum where the fault is. The level holds for all drifts and delays
    together, and for all times of a jump together (Bonferroni). Samples that are lost move the position beside the
    model at once, which a drift may stand for. So drifts and delays are tested beside a jump, if there is one.
    """
    if not (0.0 < context.best.cost < np.inf and context.space.names):
        return ()
    turned = _turned_sign(context)
    if turned is not None:
        return (turned,)
    problem = context.problem
    tags = [state.tag for state in problem.initial_states]
    drifts = () if problem.drifts else drifts_of(problem.recordings, tags, _ANY_DRIFT)
    skews = skews_of(problem.recordings)
    fitted = _fit_beside(context, drifts, skews) if drifts or skews else context
    jump, white = _clearest_jump(fitted, options.symptom_level)
    tests = _wald_tests(fitted, white, (*drifts, *skews))
    found: list[RecordingFault] = []
    usual = float(np.sqrt(np.mean(np.square(np.concatenate([r.u for r in problem.recordings])))))
    for nuisance, (value, std, degrees) in tests.items():
        if nuisance in drifts and 2.0 * abs(value) < FAULT_DEFAULTS.least_drift * usual:
            continue
        if abs(value) > std * float(student.ppf(1.0 - 0.5 * options.symptom_level / len(tests), degrees)):
            drift = nuisance in drifts  # it goes from minus its value to its value
            found.append(
                RecordingFault("drift", 2.0 * value, 2.0 * std)
                if drift
                else RecordingFault("skew", value, std, 1 + skews.index(nuisance))
            )
    clearest = max((f for f in found if f.kind == "drift"), key=lambda fault: fault.clearness, default=None)
    return tuple(f for f in (*found, *jump) if f.kind != "drift" or f is clearest)


def _turned_sign(context: FitContext) -> RecordingFault | None:
    """Fault of the sign if the fit misses an output, and misses none with the sign of the input turned.

    A fit may have stayed at a wrong optimum. So both signs get the same descents, each in its own ranges: those of the
    fit come from a balance of torques with the sign as it is.
    """
    problem, best = context.problem, context.best
    if not _misses(problem, best.residual):
        return None
    again = _best_residual(context, problem)
    if not _misses(problem, again):
        return None
    turned = replace(problem, recordings=tuple(replace(r, u=-r.u) for r in problem.recordings))
    residual = _best_residual(context, turned)
    left = float(residual @ residual) / min(best.cost, float(again @ again))
    named = not _misses(turned, residual) and left < FAULT_DEFAULTS.turned_share
    return RecordingFault("sign", left, 0.0) if named else None


def _misses(problem: SimulationErrorProblem, residual: Array) -> bool:
    """True if a residual has a notable part of the variation of an output, over all recordings."""
    missed, moved = np.zeros((2, len(problem.weights)))
    for rows, r, output in segments(problem.recordings):
        missed[output] += np.square(residual[rows]).sum()
        moved[output] += np.square(problem.weights[output] * (r.y[output] - r.y[output].mean())).sum()
    return bool(((missed > FAULT_DEFAULTS.missed_share * moved) & (moved > 0.0)).any())


def _best_residual(context: FitContext, problem: SimulationErrorProblem) -> Array:
    """Residual of the best of a few descents in a problem, whose ranges follow from its recordings."""
    structure, settings = problem.structure, replace(context.settings, level="fast")
    fixed = {name: value for name, value in context.space.fixed.items() if name in structure.parameters}
    space = parameter_space(structure, scales(problem.recordings), {}, fixed, problem.nuisances)
    starts = first_starts(problem, space, settings, None, FAULT_DEFAULTS.sign_starts, np.random.default_rng(0))
    optima = fit_many(problem, space, settings, np.column_stack(starts), cost_to_beat=np.inf)
    best = min(optima, key=lambda optimum: optimum.cost)
    return problem.residuals(space.named(best.values[:, None]), settings)[:, 0]


def _fit_beside(context: FitContext, drifts: tuple[Nuisance, ...], skews: tuple[Nuisance, ...]) -> FitContext:
    """Fit from the optimum with the faults; friction stays exact where no width showed."""
    problem, free = context.problem, (*drifts, *skews)
    faulty, space = replace(problem, drifts=problem.drifts + drifts, skews=skews), _space_beside(context.space, free)
    start = np.append(context.best.values, [fault.start for fault in free])
    tolerance = FAULT_DEFAULTS.negligible_decrease / problem.samples
    best = fit_to_convergence(faulty, space, context.settings, start, tolerance=tolerance)
    return context._replace(problem=faulty, space=space, best=best)


def _space_beside(space: ParameterSpace, nuisances: Sequence[Nuisance]) -> ParameterSpace:
    """A parameter space with further nuisances."""
    return replace(
        space,
        names=(*space.names, *(n.name for n in nuisances)),
        low=np.append(space.low, [n.low for n in nuisances]),
        high=np.append(space.high, [n.high for n in nuisances]),
        start=np.append(space.start, [n.start for n in nuisances]),
        log=np.append(space.log, [n.log for n in nuisances]),
        not_sampled=np.append(space.not_sampled, [not n.sampled for n in nuisances]),
    )


@dataclass(frozen=True)
class _Whitened:
    """Residual and derivatives of a fit, by which the noise is white with variance 1."""

    whitening: Whitening
    residual: Array
    jacobian: Array

    @classmethod
    def of(cls, fitted: FitContext, beside: Array) -> _Whitened:
        """Whiten by the noise that is left beside further unknowns, whose responses have shape (residuals, k)."""
        problem, best = fitted.problem, fitted.best
        floor = error_variances(problem.recordings, problem.weights).ravel().tolist()
        jacobian = np.column_stack([best.jacobian, beside])
        whitening = Whitening.of(best.residual, jacobian, problem.segment_lengths, floor)
        return cls(whitening, whitening.whiten(best.residual), whitening.whiten(jacobian))

    def left_over(self, unknowns: int) -> int:
        """Independent residuals beyond so many unknowns, 1 at least; those that whitening cannot tell are zero."""
        return max(len(self.residual) - sum(model.order for model in self.whitening.models) - unknowns, 1)

    def degrees(self, own: Array) -> float:
        """Degrees of freedom of the noise's spectrum where a whitened response is, shape (residuals,)."""
        return noise_degrees(own[:, None], self.whitening.models, self.whitening.lengths)


def _wald_tests(
    fitted: FitContext, white: _Whitened, nuisances: Sequence[Nuisance]
) -> dict[Nuisance, tuple[float, float, float]]:
    """Value, standard deviation and degrees of freedom of each nuisance that the recordings tell from the others."""
    space, best = fitted.space, fitted.best
    found = {}
    for nuisance in nuisances:
        i = space.names.index(nuisance.name)
        others = orthonormal_basis(np.delete(white.jacobian, i, axis=1))
        own, left = beyond(others, white.jacobian[:, i]), beyond(others, white.residual)
        size = float(own @ own)
        if not size > (FAULT_DEFAULTS.min_own * np.linalg.norm(white.jacobian[:, i])) ** 2:
            continue
        step = -float(own @ left) / size
        variance = float(np.square(left + step * own).sum()) / white.left_over(others.shape[1] + 1)
        unit = float(space.width[i])
        std = float(np.sqrt(positive(variance / size))) * unit
        found[nuisance] = float(best.values[i]) + step * unit, std, white.degrees(own)
    return found


@dataclass(frozen=True)
class _Step:
    """Step of a position from one sample on, the one of so many that explains most."""

    segment: Segment
    number: int  #: Number of the segment.
    sample: int
    explained: float  #: Whitened sum of squares.
    count: int  #: Steps that were looked at.
    residuals: int

    def response(self, samples: int = 0) -> Array:
        """One from the sample on, for so many samples or to the end of the segment, shape (residuals, 1)."""
        first = self.segment.rows.start + self.sample
        column = np.zeros((self.residuals, 1))
        column[first : min(first + samples, self.segment.rows.stop) if samples else self.segment.rows.stop] = 1.0
        return column


def _clearest_jump(fitted: FitContext, level: float) -> tuple[tuple[RecordingFault, ...], _Whitened]:
    """Jump of a position that explains most, if that is no chance and matters, and the fit whitened beside it.

    The noise that counts is what is left beside the jump. So the time of one that may be clear is looked for twice.
    """
    without = _Whitened.of(fitted, np.zeros((fitted.best.residual.size, 0)))
    first = _clearest_step(fitted.problem, without, 0)
    if first is None or first.explained < 0.5 * float(norm.isf(0.5 * level / first.count)) ** 2:
        return (), without
    second = _clearest_step(fitted.problem, _Whitened.of(fitted, first.response()), 1) or first
    white = _Whitened.of(fitted, second.response())
    jump = _jump_beyond_chance(fitted, white, second, level)
    return ((jump,), white) if jump else ((), without)


def _clearest_step(problem: SimulationErrorProblem, white: _Whitened, known: int) -> _Step | None:
    """The step that explains most; the last `known` columns of the Jacobian are steps that were found before."""
    basis = orthonormal_basis(white.jacobian[:, : white.jacobian.shape[1] - known])
    left = beyond(basis, white.residual)
    found = []
    for number, segment in enumerate(segments(problem.recordings)):
        if KINDS[segment.recording.outputs[segment.output].kind] == 0:
            explained = _explained_by_steps(white.whitening.models[number], left[segment.rows], basis[segment.rows])
            sample, count = int(np.argmax(explained)), int(np.count_nonzero(explained))
            found.append(_Step(segment, number, sample, float(explained[sample]), count, left.size))
    best = max(found, key=lambda step: step.explained, default=None)
    return replace(best, count=sum(step.count for step in found)) if best and best.explained > 0.0 else None


def _jump_beyond_chance(fitted: FitContext, white: _Whitened, step: _Step, level: float) -> RecordingFault | None:
    """The jump with its size, None if it is chance, an outlier, or too small; the step is the last known column."""
    pulse = white.whitening.whiten(step.response(1))
    basis = orthonormal_basis(np.column_stack([white.jacobian[:, :-1], pulse]))
    own, left = beyond(basis, white.jacobian[:, -1]), beyond(basis, white.residual)
    size = positive(float(own @ own))
    coefficient = float(own @ left) / size
    variance = float(np.square(left - coefficient * own).sum()) / white.left_over(basis.shape[1] + 1)
    std = float(np.sqrt(positive(variance / size)))
    clear = abs(coefficient) > std * float(student.ppf(1.0 - 0.5 * level / step.count, white.degrees(own)))
    moved = coefficient * beyond(orthonormal_basis(fitted.best.jacobian), step.response())
    matters = float(np.square(moved).sum()) > FAULT_DEFAULTS.min_share * fitted.best.cost
    r, output = step.segment.recording, step.segment.output
    weight = float(fitted.problem.weights[output])
    if not (clear and matters and abs(coefficient) / weight > r.resolution[output]):
        return None
    recording, time = step.number // len(r.outputs), float(r.t[step.sample])
    return RecordingFault("jump", -coefficient / weight, std / weight, output, recording, time)


def _explained_by_steps(model: Autoregression, left: Array, basis: Array) -> Array:
    """Sum of squares that a step from each sample on explains of a whitened segment, shape (samples,).

    Zero where a basis makes the step, and near the ends: the position at the start makes it there, or nothing tells it
    from the noise of the last samples.

    Parameters
    ----------
    model : Autoregression
        Noise of the segment.
    left : ndarray, shape (samples,)
        What is left beyond the basis.
    basis : ndarray, shape (samples, rank)
    """
    std, samples = np.sqrt(positive(model.variance)), len(left)
    backwards = np.column_stack([left, basis])[::-1]
    products = np.cumsum(lfilter(model.a, [1.0], backwards, axis=0), axis=0)[::-1] / std
    course = lfilter(model.a, [1.0], np.ones(samples)) / std
    whole = np.cumsum(np.square(course))[::-1]
    own = whole - np.square(products[:, 1:]).sum(axis=1)
    at = np.arange(samples)
    first = max(model.order, FAULT_DEFAULTS.jump_from_ends)
    told = (at >= first) & (at < samples - FAULT_DEFAULTS.jump_from_ends) & (own > FAULT_DEFAULTS.min_jump * whole)
    return np.where(told, np.square(products[:, 0]) / positive(own), 0.0)
