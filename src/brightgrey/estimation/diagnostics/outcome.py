"""Outcome of a fit: its gravest finding, and all others beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from brightgrey.estimation.diagnostics.finding import Finding, Kind
from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS, DiagnosticOptions
from brightgrey.estimation.noise.autoregression import noise_models
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.segments import split_recordings
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.estimation.uncertainty.estimates import Estimates
from brightgrey.estimation.uncertainty.identifiability import describe
from brightgrey.numerics.distributions import chi2
from brightgrey.simulation import Settings

__all__ = ["FitContext", "Outcome", "outcome_of", "unfitted"]

_SEVERITY: tuple[str, ...] = get_args(Kind)
_CONVERGED = _SEVERITY.index("converged")


@dataclass(frozen=True)
class Outcome:
    """Outcome of a fit; numerical failure is a value, with its text as the message."""

    #: The gravest of all findings; ``converged`` if there is none that may be the outcome.
    kind: Kind
    text: str
    findings: tuple[Finding, ...] = ()  #: All others, the gravest first.

    @classmethod
    def of(cls, findings: Sequence[Finding]) -> Outcome:
        """Order findings by severity; equally grave ones keep their order."""
        ordered = sorted(findings, key=lambda f: _SEVERITY.index(f.kind))
        if not ordered or _SEVERITY.index(ordered[0].kind) > _CONVERGED:
            ordered = [Finding("converged", "the cost has a minimum here, inside all bounds"), *ordered]
        first, *rest = ordered
        return cls(first.kind, first.text, tuple(rest))


class FitContext(NamedTuple):
    """A fit with its problem, parameter space, settings, optimum and estimates, as findings need them."""

    problem: SimulationErrorProblem
    space: ParameterSpace
    settings: Settings
    best: OptimumWithJacobian
    estimates: Estimates


def outcome_of(
    context: FitContext, others: Sequence[Finding] = (), options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS
) -> Outcome:
    """Outcome of a fit.

    Parameters
    ----------
    context : FitContext
    others : sequence of Finding
        Findings on the recordings, and cautions.
    options : DiagnosticOptions
    """
    uninformative = [finding for finding in others if finding.kind == "not identifiable"]
    if uninformative:
        return Outcome.of(uninformative)
    diverged = _divergence(context)
    if diverged:
        return Outcome.of([diverged, *others])
    own = [
        *_unidentifiable(context),
        *_unexplained(context, options),
        *_differing(context),
        *_bounds_and_limits(context, options),
    ]
    return Outcome.of([*own, *others])


def unfitted(problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings) -> OptimumWithJacobian:
    """Result that stays at the start values, for recordings from which nothing can be estimated."""
    residual = problem.residuals(space.named(space.start[:, None]), settings)[:, 0]
    jacobian = np.zeros((residual.size, len(space.names)))
    return OptimumWithJacobian(space.start, float(residual @ residual), False, 1, 1, residual, jacobian)


def _divergence(context: FitContext) -> Finding | None:
    """Finding if the best simulation diverges."""
    problem, values = context.problem, context.space.named(context.best.values[:, None])
    parts = split_recordings(context.best.residual, problem.recordings)
    for (r, errors), state in zip(parts, problem.initial_states, strict=True):
        if np.all(errors[:, -2] != errors[:, -1]):
            continue  # a diverged residual has one value to the end
        y = predict_many(problem.structure, values, r, context.settings, initial_state=state)[:, :, 0]
        lost = np.flatnonzero(~np.isfinite(y).all(axis=0))
        if lost.size:
            time = float(r.t[lost[0]])
            return Finding("diverged", f"the best simulation of {r.name} diverges at {time:.4g} s")
    if not np.isfinite(context.best.cost):
        return Finding("diverged", "no parameter set gives a finite simulation: check bounds and units")
    return None


def _unidentifiable(context: FitContext) -> list[Finding]:
    """Findings on directions that are not identified; those of initial states alone do not matter."""
    space, known = context.space, context.problem.structure.parameters
    declared = [known.get(name) for name in space.names]
    return [
        Finding(
            "not identifiable",
            describe(direction, space, context.best.values, declared),
            tuple(space.names[i] for i in direction.indices),
        )
        for direction in context.estimates.unidentifiable
        if any(space.names[i] in known for i in direction.indices)
    ]


def _unexplained(context: FitContext, options: DiagnosticOptions) -> list[Finding]:
    """Finding if the model is no better than constant outputs, by a likelihood ratio with effective samples."""
    problem, residual = context.problem, context.best.residual
    lengths = problem.segment_lengths
    if not context.space.names or not context.best.cost > 0.0:
        return []
    constant = [
        weight * (row - row.mean())
        for r in problem.recordings
        for weight, row in zip(problem.weights, r.y, strict=True)
    ]
    cost_of_constant = float(sum(row @ row for row in constant))
    models = noise_models(np.concatenate(constant), np.zeros((residual.size, 0)), lengths)
    effective = sum(m.effective_samples_mean(n) for m, n in zip(models, lengths, strict=True))
    statistic = effective * (cost_of_constant / context.best.cost - 1.0)
    if statistic > chi2.isf(options.explained_level, len(context.space.names)):
        return []
    text = "the model explains nothing of the outputs: constants fit them as well; check the signals and the structure"
    return [Finding("not identifiable", text)]


def _differing(context: FitContext) -> list[Finding]:
    names = tuple(name for name in context.estimates.differing if name in context.problem.structure.parameters)
    if not names:
        return []
    text = (
        f"the recordings disagree on {', '.join(names)}: the values of single recordings differ by more than their"
        f" intervals allow; '--per-recording {','.join(names)}' lets them differ"
    )
    return [Finding("recordings disagree", text, names)]


def _bounds_and_limits(context: FitContext, options: DiagnosticOptions) -> list[Finding]:
    at = {name: e.at_bound for name, e in context.estimates.by_name.items() if e.at_bound}
    found = []
    if at:
        text = ", ".join(
            f"{name} at its {'lower' if side == 'low' else 'upper'} bound{_possible_substitute(context, name, options)}"
            for name, side in at.items()
        )
        found.append(Finding("at bound", text, tuple(at)))
    if not context.best.converged:
        text = f"no optimum was reached within the limit ({context.best.evaluations} evaluations)"
        found.append(Finding("evaluation limit", text))
    return found


def _possible_substitute(context: FitContext, name: str, options: DiagnosticOptions) -> str:
    """Words on the parameter that may take the place of one at its low bound."""
    limit = context.estimates.upper_limits.get(name)
    if limit is None or abs(limit.correlation) < options.exchangeable_correlation:
        return ""
    return (
        f" (its errors correlate by {limit.correlation:+.2f} with those of {limit.partner}: either may stand for both)"
    )
