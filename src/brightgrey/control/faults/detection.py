"""Fault detection: which physical change a new recording shows against the model.

The declarations say which parameters belong to one fault. The innovations of a filter with the model are white as
long as the drive is the model's; a fault makes them follow their derivative by the size of the fault. That size is
estimated from them (Fisher's scoring), with a covariance that allows for innovations which are not quite white (Newey,
West 1987, doi:10.2307/1913610). Through a gap no filter with one state follows the contacts; there the model is
simulated instead (:mod:`brightgrey.control.faults.simulated_changes`). A fault is reported when it is larger than what
matters, at the confidence asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from brightgrey.arrays import Array
from brightgrey.control.faults.parameter_changes import ChangeProblem, PosteriorPoint, maximise_posteriors
from brightgrey.control.faults.simulated_changes import ChangeEstimate, ParameterGroup, estimate_changes
from brightgrey.control.filters.extended_kalman import Noise
from brightgrey.effects import Fault
from brightgrey.errors import SettingsError
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["FaultCase", "FaultFinding", "detect_faults", "fault_groups"]

_MOST_DOUBT = 0.5  # of a parameter: beyond it the prior says nothing, and steps would leave the model
_SINGULAR = 1e10
_TELLING = 0.5  # a change by half has to be detectable, or the recording does not decide


@dataclass(frozen=True)
class FaultFinding:
    """What a recording says about one kind of fault.

    Attributes
    ----------
    subject : str
        E.g. ``friction``.
    parameters : tuple of str
        That were changed together.
    verdict : {'changed', 'as before', 'not decidable'}
    factor : float
        Estimated size now over size in the model.
    ci95 : (low, high)
    confidence : float
        Probability that the change is larger than what matters.
    text : str
        One sentence.
    """

    subject: str
    parameters: tuple[str, ...]
    verdict: Literal["changed", "as before", "not decidable"]
    factor: float
    ci95: tuple[float, float]
    probability: float
    text: str


def fault_groups(structure: Structure) -> Mapping[Fault, tuple[str, ...]]:
    """Parameters of `structure` by the fault that their change is called."""
    found: dict[Fault, list[str]] = {}
    for name, parameter in structure.parameters.items():
        if parameter.fault is not None:
            found.setdefault(parameter.fault, []).append(name)
    return {fault: tuple(names) for fault, names in found.items()}


@dataclass(frozen=True)
class FaultCase:
    """A recording and the model it is held against.

    Attributes
    ----------
    values : mapping of str to float
        The model's parameters, SI.
    recording : Recording
    noise : Noise
        From a recording without fault, :func:`brightgrey.control.filters.setup.noise_levels`.
    std : mapping of str to float
        Standard deviations of the model's parameters, SI: a fault must stand out from them, too.
    """

    values: Mapping[str, float]
    recording: Recording
    noise: Noise
    std: Mapping[str, float] = field(default_factory=dict)


def detect_faults(
    structure: Structure,
    settings: Settings,
    cases: Sequence[FaultCase],
    *,
    min_change: float = 0.1,
    confidence: float = 0.99,
) -> list[tuple[FaultFinding, ...]]:
    """Look for faults in new recordings; several are filtered side by side, or simulated one by one through a gap.

    Parameters
    ----------
    structure, settings
        Of the model, SI.
    cases : sequence of Case
        Recordings of the same length, signals and sampling time.
    matters : float
        Relative change that is not yet worth reporting.
    confidence : float
        At which a change is reported.

    Returns
    -------
    list of tuple of Finding
        For each case one finding per kind of fault that the structure knows; *not decidable* where the filter diverges.

    Raises
    ------
    SettingsError
        If `matters` or `confidence` is out of range.
    """
    if not (0.0 <= min_change < _TELLING and 0.5 < confidence < 1.0):
        raise SettingsError(f"matters is {min_change:g} (0 to {_TELLING:g}) and confidence {confidence:g} (0.5 to 1)")
    kinds = fault_groups(structure)
    trials = [ChangeProblem(case.values, case.recording, case.noise, _parameter_groups(case, kinds)) for case in cases]
    if structure.has_hard_limit:
        least = math.log1p(min_change)
        found = [
            estimate_changes(structure, t.values, t.changes, t.recording, settings, min_change=least) for t in trials
        ]
    else:
        points = maximise_posteriors(structure, settings, trials)
        found = [
            ChangeEstimate(p.log_factors, _robust_std(p, t.prior_information))
            for p, t in zip(points, trials, strict=True)
        ]
    return [_judge_changes(case, kinds, one, min_change, confidence) for case, one in zip(cases, found, strict=True)]


def _relative_std(case: FaultCase) -> dict[str, float]:
    """Relative standard deviations of the model's parameters."""
    return {n: abs(s / case.values[n]) for n, s in case.std.items() if s > 0.0 and case.values[n] != 0.0}


def _parameter_groups(case: FaultCase, kinds: Mapping[Fault, tuple[str, ...]]) -> tuple[ParameterGroup, ...]:
    """What may have changed: the faults freely, every other parameter as far as the model does not know it.

    The first parameter of a fault stands for it, and the doubt about it is added in the end; the fault's other
    parameters may be off against it.
    """
    doubts = _relative_std(case)
    first = {name: names[0] for names in kinds.values() for name in names}
    doubtful = {
        n: min(math.hypot(s, doubts.get(first[n], 0.0) if n in first else 0.0), _MOST_DOUBT)
        for n, s in doubts.items()
        if first.get(n) != n
    }
    free = (ParameterGroup(names, math.inf) for names in kinds.values())
    return (*free, *(ParameterGroup((name,), doubt) for name, doubt in doubtful.items()))


def _judge_changes(
    case: FaultCase, kinds: Mapping[Fault, tuple[str, ...]], found: ChangeEstimate, matters: float, confidence: float
) -> tuple[FaultFinding, ...]:
    doubts = _relative_std(case)
    own = [doubts.get(names[0], 0.0) for names in kinds.values()]
    return tuple(
        _judge_change(fault, names, float(found.log_factors[i]), math.hypot(found.std[i], own[i]), matters, confidence)
        for i, (fault, names) in enumerate(kinds.items())
    )


def _robust_std(found: PosteriorPoint, prior: Array) -> Array:
    """Standard deviation of each estimated size, with autocorrelated innovations allowed for."""
    information = found.information
    scale = np.sqrt(np.diag(information)) if np.isfinite(found.posterior) else np.zeros(len(prior))
    if not np.all(scale > 0.0) or np.linalg.cond(information / scale[:, None] / scale) > _SINGULAR:
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


def _judge_change(
    fault: Fault, names: Sequence[str], size: float, std: float, matters: float, confidence: float
) -> FaultFinding:
    up, down = math.log1p(matters), -math.log1p(matters)
    z = float(ndtri(confidence))
    above = float(ndtr((size - up) / std)) if std > 0.0 else float(size > up)
    below = 0.0 if fault.grows else float(ndtr((down - size) / std)) if std > 0.0 else float(size < down)
    sure = max(above, below)
    low, high = (math.exp(min(max(size + s * 1.96 * std, -50.0), 50.0)) for s in (-1.0, 1.0))
    factor = math.exp(size)
    if sure >= confidence:
        word = "has grown" if fault.grows else "has changed"
        text = (
            f"{fault.subject} {word}: {factor:.2f} times the model's ({low:.2f} to {high:.2f}), {100 * sure:.1f} % sure"
        )
        return FaultFinding(fault.subject, tuple(names), "changed", factor, (low, high), sure, text)
    if not z * std < math.log1p(_TELLING) - up:
        text = f"{fault.subject}: not decidable from this recording"
        return FaultFinding(fault.subject, tuple(names), "not decidable", factor, (low, high), sure, text)
    text = f"{fault.subject}: as before, {factor:.2f} times the model's ({low:.2f} to {high:.2f})"
    return FaultFinding(fault.subject, tuple(names), "as before", factor, (low, high), sure, text)
