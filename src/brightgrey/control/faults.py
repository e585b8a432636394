"""Fault detection: has friction grown, backlash grown, the load changed since the model was identified?

The declarations say which parameters belong to one fault. The innovations of a filter with the model are white as long as the
drive is the model's; a fault makes them follow their derivative by the size of the fault. That size is estimated from
them (Gauss-Newton on the whitened innovations), with a covariance that allows for innovations which are not quite
white (Newey, West 1987, doi:10.2307/1913610), and a fault is reported when it is larger than what matters, at the
confidence asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from brightgrey.control.kalman import Filtered, Noise, extended
from brightgrey.control.watching import see
from brightgrey.effects import Fault
from brightgrey.errors import SettingsError
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["Finding", "faults", "groups"]

Array = NDArray[np.float64]
_DIFFERENCE = 0.01  # of the logarithm: contacts make smaller ones rough
_FACTORS = (0.6, 0.8, 1.25, 1.6, 2.2, 3.0)  # sizes tried first: contacts make the likelihood many-humped
_FRACTIONS = (1.0, 0.3, 0.05)
_TURNS = 5
_SETTLED = 0.3  # standard deviations that a step still moves
_TELLING = 0.5  # a change by half has to be detectable, or the recording does not decide


@dataclass(frozen=True)
class Finding:
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
    confidence: float
    text: str


def groups(structure: Structure) -> Mapping[Fault, tuple[str, ...]]:
    """Parameters of `structure` by the fault that their change is called."""
    found: dict[Fault, list[str]] = {}
    for name, parameter in structure.parameters.items():
        if parameter.fault is not None:
            found.setdefault(parameter.fault, []).append(name)
    return {fault: tuple(names) for fault, names in found.items()}


def faults(
    structure: Structure,
    values: Mapping[str, float],
    recording: Recording,
    settings: Settings,
    noise: Noise,
    *,
    std: Mapping[str, float] | None = None,
    matters: float = 0.1,
    confidence: float = 0.99,
) -> tuple[Finding, ...]:
    """Look for faults in a new recording.

    Parameters
    ----------
    structure, values, settings
        The model, SI.
    recording : Recording
    noise : Noise
        From a recording without fault, :func:`brightgrey.control.watching.noise_levels`.
    std : mapping of str to float, optional
        Standard deviations of the model's parameters, SI: a fault must stand out from them, too.
    matters : float
        Relative change that is not yet worth reporting.
    confidence : float
        At which a change is reported.

    Returns
    -------
    tuple of Finding
        One per kind of fault that the structure knows.

    Raises
    ------
    SettingsError
        If `matters` or `confidence` is out of range, or the filter diverges with the model as it is.
    """
    if not (0.0 <= matters < _TELLING and 0.5 < confidence < 1.0):
        raise SettingsError(f"matters is {matters:g} (0 to {_TELLING:g}) and confidence {confidence:g} (0.5 to 1)")
    kinds = groups(structure)
    trial = _Trial(structure, values, recording, settings, noise, tuple(kinds.values()))
    size, likelihood, slopes, white = _estimated(trial)
    covariance = _covariance(slopes, white) if np.isfinite(likelihood) else np.full((len(size),) * 2, np.inf)
    findings = []
    for i, (fault, names) in enumerate(kinds.items()):
        own = max(((std or {}).get(name, 0.0) / abs(values[name]) for name in names), default=0.0)
        spread = math.hypot(math.sqrt(max(covariance[i, i], 0.0)), own)
        findings.append(_finding(fault, names, float(size[i]), spread, matters, confidence))
    return tuple(findings)


@dataclass(frozen=True)
class _Trial:
    """The recording filtered with changed models."""

    structure: Structure
    values: Mapping[str, float]
    recording: Recording
    settings: Settings
    noise: Noise
    groups: tuple[tuple[str, ...], ...]

    def run(self, sizes: Array) -> Filtered:
        """Filter with the logarithms of all factors, shape (K, groups), side by side."""
        values = {name: np.full(len(sizes), value) for name, value in self.values.items()}
        for i, names in enumerate(self.groups):
            for name in names:
                values[name] = values[name] * np.exp(sizes[:, i])
        with np.errstate(all="ignore"):  # a model far off may diverge: it has no likelihood then
            return extended(see(self.structure, values, self.recording, self.settings).watched, self.noise)

    def likelihoods(self, sizes: Array) -> Array:
        """Log-likelihood of each, -inf where the filter diverged."""
        return _finite(self.run(sizes).log_likelihood)

    def around(self, sizes: Array) -> list[_Point]:
        """Each of the sizes with the derivatives there, all filtered side by side."""
        K, m = sizes.shape
        steps = _DIFFERENCE * np.vstack([np.zeros((1, m)), np.eye(m), -np.eye(m)])
        found = self.run((sizes[:, None] + steps).reshape(-1, m))
        white = found.white.transpose(1, 0, 2).reshape(K, 2 * m + 1, -1)
        slopes = (white[:, 1 : m + 1] - white[:, m + 1 :]) / (2.0 * _DIFFERENCE)
        likelihood = _finite(found.log_likelihood).reshape(K, -1)[:, 0]
        usable = np.isfinite(slopes).all(axis=(1, 2))
        likelihood = np.where(usable, likelihood, -np.inf)
        return [_Point(sizes[i], float(likelihood[i]), slopes[i].T, white[i, 0]) for i in range(K)]


class _Point(NamedTuple):
    """Sizes of the faults, the likelihood there, the whitened innovations and their derivatives."""

    size: Array
    likelihood: float
    slopes: Array
    white: Array


def _finite(likelihood: Array) -> Array:
    return np.where(np.isfinite(likelihood), likelihood, -np.inf)


def _estimated(trial: _Trial) -> _Point:
    """Sizes with the largest likelihood: a coarse look along each, then Gauss-Newton with several step lengths at once."""
    m = len(trial.groups)
    tries = [np.zeros(m)]
    for i in range(m):
        tries += [np.log(factor) * np.eye(m)[i] for factor in _FACTORS]
    found = trial.likelihoods(np.array(tries))
    if not np.isfinite(found[0]):
        raise SettingsError("the filter diverges with the model as it is: it does not belong to this recording")
    (here,) = trial.around(tries[int(np.argmax(found))][None])
    for _ in range(_TURNS):
        if not np.isfinite(here.likelihood):
            break
        step = -np.linalg.lstsq(here.slopes, here.white, rcond=None)[0]
        if np.abs(step * np.linalg.norm(here.slopes, axis=0)).max() < _SETTLED:
            break
        step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
        best = max(
            trial.around(np.array([here.size + fraction * step for fraction in _FRACTIONS])), key=lambda p: p.likelihood
        )
        if not best.likelihood > here.likelihood:
            break
        here = best
    return here


def _covariance(slopes: Array, white: Array) -> Array:
    """Covariance of the estimate, with autocorrelated innovations allowed for."""
    information = slopes.T @ slopes
    if np.linalg.matrix_rank(information) < len(information):
        return np.full_like(information, np.inf)
    scores = slopes * white[:, None]
    total = scores.T @ scores
    lags = max(1, int(len(white) ** (1.0 / 3.0)))
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (part + part.T)
    inverse = np.linalg.inv(information)
    robust = inverse @ total @ inverse
    plain = np.diag(inverse) * max(1.0, float(np.mean(white**2)))
    grown = np.maximum(np.diag(robust), plain)
    return np.asarray(np.diag(grown))


def _finding(fault: Fault, names: Sequence[str], size: float, std: float, matters: float, confidence: float) -> Finding:
    up, down = math.log1p(matters), -math.log1p(matters)
    z = float(ndtri(confidence))
    above = float(ndtr((size - up) / std)) if std > 0.0 else float(size > up)
    below = 0.0 if fault.grows else float(ndtr((down - size) / std)) if std > 0.0 else float(size < down)
    sure = max(above, below)
    low, high = (math.exp(min(max(size + s * 1.96 * std, -50.0), 50.0)) for s in (-1.0, 1.0))
    factor = math.exp(size)
    if sure >= confidence:
        word = "has grown" if fault.grows else "has changed"
        text = f"{fault.subject} {word}: {factor:.2f} times the model's ({low:.2f} to {high:.2f}), {100 * sure:.1f} % sure"
        return Finding(fault.subject, tuple(names), "changed", factor, (low, high), sure, text)
    if not z * std < math.log1p(_TELLING) - up:
        text = f"{fault.subject}: not decidable from this recording"
        return Finding(fault.subject, tuple(names), "not decidable", factor, (low, high), sure, text)
    text = f"{fault.subject}: as before, {factor:.2f} times the model's ({low:.2f} to {high:.2f})"
    return Finding(fault.subject, tuple(names), "as before", factor, (low, high), sure, text)
