"""How a fit ended, as a value: the gravest finding, and all others beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding, Kind
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.estimation.uncertainty.covariance import noise_models
from brightgrey.estimation.uncertainty.estimates import Estimates
from brightgrey.estimation.uncertainty.identifiability import describe
from brightgrey.numerics.distributions import chi2
from brightgrey.simulation import Settings

__all__ = ["FitContext", "Outcome", "outcome_of", "unfitted"]

_CHANCE = 1e-3  # of taking what fits by chance for motion that the model explains
_EXCHANGED = 0.9  # correlation from which two parameters can hardly be told apart
_ORDER: tuple[str, ...] = get_args(Kind)
_BESIDE = _ORDER.index("converged")  # what comes after it is never the outcome


@dataclass(frozen=True)
class Outcome:
    """How a fit ended: numerical failure is a value, with its text as the message.

    Attributes
    ----------
    kind, text : str
        The gravest of all findings; ``converged`` if none speaks against it.
    findings : tuple of Finding
        What else there is to say, the gravest first.
    """

    kind: Kind
    text: str
    findings: tuple[Finding, ...] = ()

    @classmethod
    def of(cls, findings: Sequence[Finding]) -> Outcome:
        """Put the gravest first; among equals the order stays."""
        ordered = sorted(findings, key=lambda f: _ORDER.index(f.kind))
        if not ordered or _ORDER.index(ordered[0].kind) > _BESIDE:
            ordered = [Finding("converged", "the cost has a minimum here, inside all bounds"), *ordered]
        first, *rest = ordered
        return cls(first.kind, first.text, tuple(rest))


class FitContext(NamedTuple):
    """A descent that has ended, and all that it was made of."""

    problem: SimulationErrorProblem
    search: ParameterSpace
    settings: Settings
    best: OptimumWithJacobian
    estimates: Estimates


def outcome_of(ended: FitContext, others: Sequence[Finding] = ()) -> Outcome:
    """Outcome of a fit; `others` are findings on the recordings and cautions."""
    blind = [finding for finding in others if finding.kind == "not identifiable"]
    if blind:
        return Outcome.of(blind)
    lost = _diverged(ended)
    if lost:
        return Outcome.of([lost, *others])
    return Outcome.of([*_hidden(ended), *_unexplained(ended), *_apart(ended), *_limits(ended), *others])


def unfitted(problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings) -> OptimumWithJacobian:
    """Descent that stays at its start, for recordings that no fit can learn from."""
    values = dict(zip(search.names, search.start.tolist(), strict=True)) | dict(search.fixed)
    residual = problem.residuals({name: np.array([value]) for name, value in values.items()}, settings)[:, 0]
    blind = np.zeros((residual.size, len(search.names)))
    return OptimumWithJacobian(search.start, float(residual @ residual), False, 1, 1, residual, blind)


def _named(ended: FitContext) -> dict[str, Array]:
    values = dict(zip(ended.search.names, ended.best.values.tolist(), strict=True)) | dict(ended.search.fixed)
    return {name: np.array([value]) for name, value in values.items()}


def _diverged(ended: FitContext) -> Finding | None:
    """Where the simulation of the best values is no number any more."""
    begin = 0
    for r, onset in zip(ended.problem.recordings, ended.problem.initial_states, strict=True):
        ends = ended.best.residual[begin : begin + r.y.size].reshape(r.y.shape)[:, -2:]
        begin += r.y.size
        if np.all(ends[:, 0] != ends[:, 1]):
            continue  # a residual that is lost has one value to the end
        y = predict_many(ended.problem.structure, _named(ended), r, ended.settings, initial_state=onset)[:, :, 0]
        lost = np.flatnonzero(~np.isfinite(y).all(axis=0))
        if lost.size:
            when = float(r.t[lost[0]])
            return Finding("diverged", f"the best simulation found of {r.name} diverges at {when:.4g} s")
    if not np.isfinite(ended.best.cost):
        return Finding("diverged", "no parameter set gave a finite simulation")
    return None


def _hidden(ended: FitContext) -> list[Finding]:
    search, known = ended.search, ended.problem.structure.parameters
    declared = [known.get(name) for name in search.names]
    return [
        Finding(
            "not identifiable",
            describe(hidden, search, ended.best.values, declared),
            tuple(search.names[i] for i in hidden.indices),
        )
        for hidden in ended.estimates.hidden
        if any(search.names[i] in known for i in hidden.indices)  # how it began alone is no loss
    ]


def _unexplained(ended: FitContext) -> list[Finding]:
    """Whether the model beats no motion at all by more than its parameters would by chance (F test).

    Residuals that hang together count as so many independent ones as they are worth.
    """
    problem, residual = ended.problem, ended.best.residual
    lengths = [r.samples for r in problem.recordings for _ in r.outputs]
    if not ended.search.names or not ended.best.cost > 0.0:
        return []
    flat = [
        weight * (row - row.mean())
        for r in problem.recordings
        for weight, row in zip(problem.weights, r.y, strict=True)
    ]
    without = float(sum(row @ row for row in flat))
    models = noise_models(np.concatenate(flat), np.zeros((residual.size, 0)), lengths)
    independent = sum(m.effective_samples_mean(n) for m, n in zip(models, lengths, strict=True))
    gain = independent * (without / ended.best.cost - 1.0)
    if gain > chi2.isf(_CHANCE, len(ended.search.names)):
        return []
    return [Finding("not identifiable", "the model explains nothing of the outputs: a constant fits them as well")]


def _apart(ended: FitContext) -> list[Finding]:
    apart = ended.estimates.apart
    if not apart:
        return []
    text = f"the recordings disagree on {', '.join(apart)}: the spread between them is beyond the interval"
    return [Finding("recordings disagree", text, apart)]


def _instead(ended: FitContext, name: str) -> str:
    """What may take the place of a parameter that has faded away."""
    reach = ended.estimates.reach.get(name)
    if reach is None or abs(reach.correlation) < _EXCHANGED:
        return ""
    return (
        f" (its errors correlate by {reach.correlation:+.2f} with those of {reach.partner}: either may stand for both)"
    )


def _limits(ended: FitContext) -> list[Finding]:
    at = {name: e.at_bound for name, e in ended.estimates.by_name.items() if e.at_bound}
    found = []
    if at:
        text = ", ".join(f"{name} at its {side} bound{_instead(ended, name)}" for name, side in at.items())
        found.append(Finding("at bound", text, tuple(at)))
    if not ended.best.converged:
        text = f"no optimum within the limit ({ended.best.evaluations} evaluations)"
        found.append(Finding("evaluation limit", text))
    return found
