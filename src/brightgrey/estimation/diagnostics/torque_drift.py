"""Torque that grows with the time, fitted together with the parameters.

Parameters that move hide most of a drift from the residual, so that a test of the residual alone may miss it. The fit
goes on from its optimum with the drift of each recording as a further unknown.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS, DiagnosticOptions
from brightgrey.estimation.diagnostics.outcome import FitContext
from brightgrey.estimation.optimisation.least_squares import fit_to_convergence
from brightgrey.estimation.problem.drift import DriftOptions, drifts_of
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.uncertainty.estimates import estimates_of
from brightgrey.numerics.distributions import norm

__all__ = ["fitted_drift"]

_ANY_DRIFT = DriftOptions(shortest=0.0, largest=0.5)


def fitted_drift(context: FitContext, options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS) -> tuple[float, float] | None:
    """Drift of the torque over a recording and its standard deviation, SI; None if no fit needs one.

    Of several recordings it is the clearest drift. It has to differ from zero beyond chance.
    """
    problem, before = context.problem, context.best.cost
    if not 0.0 < before < np.inf or problem.drifts:
        return None
    drifts = drifts_of(problem.recordings, [state.tag for state in problem.initial_states], _ANY_DRIFT)
    if not drifts:
        return None
    width = problem.friction_width  # it may be fixed since: beside a drift it is open again
    free = (*drifts, width) if width and width.name in context.space.fixed else drifts
    beside, space = replace(problem, drifts=drifts), _space_beside(context.space, free)
    start = np.append(context.best.values, [nuisance.start for nuisance in free])
    best = fit_to_convergence(beside, space, context.settings, start)
    if not best.cost < before:
        return None
    found = estimates_of(beside, space, context.settings, best).by_name
    known = [(found[drift.name].value, found[drift.name].std or np.inf) for drift in drifts]
    value, std = max(known, key=lambda pair: abs(pair[0]) / pair[1])
    limit = float(norm.isf(0.5 * options.drift_level / len(drifts)))
    return (2.0 * value, 2.0 * std) if abs(value) > limit * std else None


def _space_beside(space: ParameterSpace, nuisances: tuple[Nuisance, ...]) -> ParameterSpace:
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
