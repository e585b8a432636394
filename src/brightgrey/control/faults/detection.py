"""Fault detection: physical changes of a drive that a new recording shows against its model.

Effects declare the parameters that belong to one fault. Without a gap the changes are found from the innovations of an
extended Kalman filter by Fisher's scoring (:mod:`brightgrey.control.faults.parameter_changes`). Their covariance allows
for correlated innovations (Newey and West 1987, doi:10.2307/1913610). With a gap the model is simulated instead
(:mod:`brightgrey.control.faults.simulated_changes`), because no filter with one state follows the contacts. A fault is
reported if it exceeds the smallest change of interest with the confidence asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from brightgrey.arrays import Array
from brightgrey.control.faults.parameter_changes import (
    ChangeProblem,
    FaultCase,
    PosteriorPoint,
    ScoringOptions,
    maximise_posteriors,
)
from brightgrey.control.faults.simulated_changes import (
    ChangeEstimate,
    ParameterGroup,
    SimulatedChangeOptions,
    estimate_changes,
)
from brightgrey.effects import Fault
from brightgrey.errors import SettingsError
from brightgrey.kit import Structure
from brightgrey.simulation import Settings

__all__ = ["FaultCase", "FaultDetectionOptions", "FaultFinding", "detect_faults", "fault_groups"]


@dataclass(frozen=True)
class FaultDetectionOptions:
    """Limits of the decision, and options of the two estimators."""

    max_prior_std: float = 0.5  #: Largest relative standard deviation of a parameter that is used as prior knowledge.
    #: Condition of the scaled information above which a recording says nothing about the changes.
    max_condition: float = 1e10
    decidable_change: float = 0.5  #: Relative change that a recording must be able to show, or it does not decide.
    scoring: ScoringOptions = field(default_factory=ScoringOptions)  #: Without a gap.
    simulation: SimulatedChangeOptions = field(default_factory=SimulatedChangeOptions)  #: With a gap.


FAULT_DETECTION = FaultDetectionOptions()


@dataclass(frozen=True)
class FaultFinding:
    """Result of fault detection for one kind of fault."""

    subject: str  #: E.g. ``friction``.
    parameters: tuple[str, ...]  #: Changed by a common factor.
    verdict: Literal["changed", "as before", "not decidable"]  #: one of 'changed', 'as before', 'not decidable'.
    factor: float  #: Estimated value now over the value in the model.
    ci95: tuple[float, float]  #: Confidence interval of the factor.
    probability: float  #: That the change exceeds the smallest one of interest, from 0 to 1.
    text: str  #: The finding in words, values in the recording's units.


def fault_groups(structure: Structure) -> Mapping[Fault, tuple[str, ...]]:
    """Parameters of `structure` by the fault that a change of them means."""
    found: dict[Fault, list[str]] = {}
    for name, parameter in structure.parameters.items():
        if parameter.fault is not None:
            found.setdefault(parameter.fault, []).append(name)
    return {fault: tuple(names) for fault, names in found.items()}


class _Level(NamedTuple):
    """Smallest relative change of interest, confidence of a report, and the change that has to be detectable."""

    min_change: float
    confidence: float
    decidable_change: float


def detect_faults(
    structure: Structure,
    settings: Settings,
    cases: Sequence[FaultCase],
    *,
    min_change: float = 0.1,
    confidence: float = 0.99,
    options: FaultDetectionOptions = FAULT_DETECTION,
) -> list[tuple[FaultFinding, ...]]:
    """Look for faults in new recordings.

    Several cases are filtered side by side; with a gap they are simulated one after the other.

    Parameters
    ----------
    structure, settings
        Of the model, SI.
    cases : sequence of FaultCase
        Recordings of the same length, signals and sampling time.
    min_change : float
        Smallest relative change of interest; a ratio.
    confidence : float
        Probability at which a change is reported, 0.5 to 1.
    options : FaultDetectionOptions

    Returns
    -------
    list of tuple of FaultFinding
        For each case one finding per fault of the structure; *not decidable* where the filter diverges.

    Raises
    ------
    SettingsError
        If `min_change` or `confidence` is out of range.
    """
    if not (0.0 <= min_change < options.decidable_change and 0.5 < confidence < 1.0):
        raise SettingsError(
            f"the smallest change is {min_change:g} and the confidence {confidence:g}; allowed are changes from 0 to "
            f"{options.decidable_change:g} and confidences from 0.5 to 1"
        )
    faults = fault_groups(structure)
    problems = [ChangeProblem(case, _parameter_groups(case, faults, options.max_prior_std)) for case in cases]
    if structure.has_hard_limit:
        threshold = math.log1p(min_change)
        found = [
            estimate_changes(
                structure,
                p.case.values,
                p.groups,
                p.case.recording,
                settings,
                min_change=threshold,
                options=options.simulation,
            )
            for p in problems
        ]
    else:
        points = maximise_posteriors(structure, settings, problems, options.scoring)
        found = [
            ChangeEstimate(point.log_factors, _newey_west_std(point, p.prior_information, options.max_condition))
            for point, p in zip(points, problems, strict=True)
        ]
    level = _Level(min_change, confidence, options.decidable_change)
    return [_findings(structure, case, faults, one, level) for case, one in zip(cases, found, strict=True)]


def _relative_std(case: FaultCase) -> dict[str, float]:
    """Relative standard deviations of the model's parameters."""
    return {n: abs(s / case.values[n]) for n, s in case.std.items() if s > 0.0 and case.values[n] != 0.0}


def _parameter_groups(
    case: FaultCase, faults: Mapping[Fault, tuple[str, ...]], max_prior_std: float
) -> tuple[ParameterGroup, ...]:
    """Free groups of the faults, and every other parameter with the model's standard deviation as its prior.

    The first parameter of a fault represents it; its own standard deviation is added to the result. The fault's other
    parameters may deviate from it.
    """
    std = _relative_std(case)
    first = {name: names[0] for names in faults.values() for name in names}
    prior = {
        n: min(math.hypot(s, std.get(first[n], 0.0) if n in first else 0.0), max_prior_std)
        for n, s in std.items()
        if first.get(n) != n
    }
    free = (ParameterGroup(names, math.inf) for names in faults.values())
    return (*free, *(ParameterGroup((name,), s) for name, s in prior.items()))


def _newey_west_std(found: PosteriorPoint, prior: Array, max_condition: float) -> Array:
    """Standard deviation of each log factor, with correlated innovations allowed for; inf where nothing is known."""
    information = found.information
    scale = np.sqrt(np.diag(information)) if np.isfinite(found.posterior) else np.zeros(len(prior))
    if not np.all(scale > 0.0) or np.linalg.cond(information / scale[:, None] / scale) > max_condition:
        return np.full(len(prior), np.inf)
    scores = found.scores - found.scores.mean(axis=0)
    total = scores.T @ scores + np.diag(prior)
    lags = max(1, int(len(scores) ** (1.0 / 3.0)))
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (part + part.T)
    inverse = np.linalg.inv(information)
    robust = np.diag(inverse @ total @ inverse)
    plain = np.diag(inverse) * max(1.0, float(np.mean(found.normalised_innovations**2)))
    return np.asarray(np.sqrt(np.maximum(robust, plain)))


def _findings(
    structure: Structure,
    case: FaultCase,
    faults: Mapping[Fault, tuple[str, ...]],
    found: ChangeEstimate,
    level: _Level,
) -> tuple[FaultFinding, ...]:
    std = _relative_std(case)
    findings = []
    for i, (fault, names) in enumerate(faults.items()):
        own_std = math.hypot(found.std[i], std.get(names[0], 0.0))
        values = ", ".join(_value_text(structure, case, name, math.exp(found.log_factors[i])) for name in names)
        findings.append(_finding(fault, names, float(found.log_factors[i]), own_std, level, values))
    return tuple(findings)


def _value_text(structure: Structure, case: FaultCase, name: str, factor: float) -> str:
    """Value of a parameter now and in the model, in the recording's units."""
    unit, scale = case.recording.units.of(structure.parameters[name].dimension)
    before = case.values[name] * scale
    return f"{name} {factor * before:.3g} instead of {before:.3g} {unit}".rstrip()


def _finding(
    fault: Fault, names: Sequence[str], log_factor: float, std: float, level: _Level, values: str
) -> FaultFinding:
    """Decide on one fault by the normal distribution of its log factor."""
    limit = math.log1p(level.min_change)
    above = float(ndtr((log_factor - limit) / std)) if std > 0.0 else float(log_factor > limit)
    below = float(ndtr((-limit - log_factor) / std)) if std > 0.0 else float(log_factor < -limit)
    probability = above if fault.grows else max(above, below)
    low, high = (math.exp(min(max(log_factor + s * 1.96 * std, -50.0), 50.0)) for s in (-1.0, 1.0))
    factor, furthest = math.exp(log_factor), high if fault.grows else max(high, 1.0 / low)
    estimate = f"{factor:.2f} times the model's value (95 % interval {low:.2f} to {high:.2f})"
    verdict: Literal["changed", "as before", "not decidable"]
    if probability >= level.confidence:
        verdict, word = "changed", "has grown" if fault.grows else "has changed"
        text = (
            f"{fault.subject} {word} to {estimate}: {values}. The change exceeds {100 * level.min_change:g} % with a "
            f"probability of {100 * probability:.1f} %."
        )
    elif not float(ndtri(level.confidence)) * std < math.log1p(level.decidable_change) - limit:
        verdict = "not decidable"
        text = (
            f"{fault.subject} is not decidable: this recording would not show a change by "
            f"{100 * level.decidable_change:g} %. Record a motion with more acceleration, reversals and low speeds."
        )
    elif furthest > 1.0 + level.decidable_change:
        verdict = "not decidable"
        text = (
            f"{fault.subject} is not decidable: {estimate}. A change by {100 * level.decidable_change:g} % is neither"
            " shown nor excluded. Record a longer motion, or one with more acceleration, reversals and low speeds."
        )
    elif low > 1.0 or (high < 1.0 and not fault.grows):
        verdict, done = "as before", "grown" if fault.grows else "changed"
        text = (
            f"{fault.subject} is not shown to have {done} by {100 * level.min_change:g} % or more, and has not {done}"
            f" by {100 * level.decidable_change:g} %: {estimate}."
        )
    elif high < 1.0:
        verdict, text = "as before", f"{fault.subject} has not grown: {estimate}."
    else:
        verdict, text = "as before", f"{fault.subject} is as before: {estimate}."
    text = text[0].upper() + text[1:]
    return FaultFinding(fault.subject, tuple(names), verdict, factor, (low, high), probability, text)
