"""Faults of a recording that a fit shows: an output that comes late against the others, a torque that drifts.

Parameters that move hide most of a fault from the residual, so that a test of the residual alone misses it. The fit
goes on from its optimum with the faults as further unknowns. From there one step of generalised least squares gives
the size of each fault, and a Wald test asks whether it differs from zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import positive
from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS, FAULT_DEFAULTS, DiagnosticOptions
from brightgrey.estimation.diagnostics.outcome import FitContext
from brightgrey.estimation.diagnostics.residual_tests import noise_degrees
from brightgrey.estimation.noise.error_floor import error_variances
from brightgrey.estimation.noise.orthonormal_basis import beyond, orthonormal_basis
from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import fit_to_convergence
from brightgrey.estimation.problem.clock_skew import skews_of
from brightgrey.estimation.problem.drift import DriftOptions, drifts_of
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.numerics.distributions import t as student

__all__ = ["RecordingFault", "recording_faults"]

_ANY_DRIFT = DriftOptions(shortest=0.0, largest=FAULT_DEFAULTS.largest_drift)


@dataclass(frozen=True)
class RecordingFault:
    """Size of a fault that differs from zero beyond chance, and its standard deviation, SI."""

    size: float  #: Time by which an output comes late, or change of the torque over a recording.
    std: float
    output: int | None = None  #: Number of the output that comes late; None for a torque.

    @property
    def clearness(self) -> float:
        """Size in standard deviations."""
        return abs(self.size) / self.std


def recording_faults(
    context: FitContext, options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS
) -> tuple[RecordingFault, ...]:
    """Faults of the recordings; of drifts only the clearest one.

    Parameters
    ----------
    context : FitContext
    options : DiagnosticOptions

    Notes
    -----
    The noise is an autoregression whose parameters are estimated, too. So the statistic has Student's distribution with
    the degrees of freedom of the noise's spectrum where the fault is. The level holds for all faults together
    (Bonferroni).
    """
    if not 0.0 < context.best.cost < np.inf:
        return ()
    problem = context.problem
    tags = [state.tag for state in problem.initial_states]
    drifts = () if problem.drifts else drifts_of(problem.recordings, tags, _ANY_DRIFT)
    skews = skews_of(problem.recordings)
    if not (drifts or skews):
        return ()
    tests = _wald_tests(_fit_beside(context, drifts, skews), (*drifts, *skews))
    found: list[RecordingFault] = []
    for nuisance, (value, std, degrees) in tests.items():
        if abs(value) > std * float(student.ppf(1.0 - 0.5 * options.symptom_level / len(tests), degrees)):
            drift = nuisance in drifts  # it goes from minus its value to its value
            output = None if drift else 1 + skews.index(nuisance)
            found.append(RecordingFault(2.0 * value, 2.0 * std) if drift else RecordingFault(value, std, output))
    drifting = [fault for fault in found if fault.output is None]
    clearest = max(drifting, key=lambda fault: fault.clearness, default=None)
    return tuple(fault for fault in found if fault.output is not None or fault is clearest)


def _fit_beside(context: FitContext, drifts: tuple[Nuisance, ...], skews: tuple[Nuisance, ...]) -> FitContext:
    """Fit from the optimum with the faults, and with friction's width open."""
    problem, fixed = context.problem, context.space.fixed
    width = problem.friction_width  # it may be fixed since: beside a fault it is open again
    widths = (width,) if width and width.name in fixed else ()
    free = (*drifts, *skews, *widths)
    faulty, space = replace(problem, drifts=problem.drifts + drifts, skews=skews), _space_beside(context.space, free)
    start = np.append(context.best.values, [fixed.get(nuisance.name, nuisance.start) for nuisance in free])
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
        fixed={name: value for name, value in space.fixed.items() if name not in {n.name for n in nuisances}},
        not_sampled=np.append(space.not_sampled, [not n.sampled for n in nuisances]),
    )


def _wald_tests(fitted: FitContext, nuisances: Sequence[Nuisance]) -> dict[Nuisance, tuple[float, float, float]]:
    """Value, standard deviation and degrees of freedom of each nuisance that the recordings tell from the others."""
    problem, space, best = fitted.problem, fitted.space, fitted.best
    lengths = problem.segment_lengths
    floor = error_variances(problem.recordings, problem.weights).ravel().tolist()
    whitening = Whitening.of(best.residual, best.jacobian, lengths, floor)
    residual, jacobian = whitening.whiten(best.residual), whitening.whiten(best.jacobian)
    found = {}
    for nuisance in nuisances:
        i = space.names.index(nuisance.name)
        others = orthonormal_basis(np.delete(jacobian, i, axis=1))
        own, left = beyond(others, jacobian[:, i]), beyond(others, residual)
        size = float(own @ own)
        if not size > (FAULT_DEFAULTS.min_own * np.linalg.norm(jacobian[:, i])) ** 2:
            continue
        step = -float(own @ left) / size
        variance = float(np.square(left + step * own).sum()) / (len(left) - others.shape[1] - 1)
        degrees = noise_degrees(own[:, None], whitening.models, lengths)
        unit = float(space.width[i])
        found[nuisance] = float(best.values[i]) + step * unit, float(np.sqrt(positive(variance / size))) * unit, degrees
    return found
