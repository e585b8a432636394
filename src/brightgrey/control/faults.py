"""Fault detection: which physical change a new recording shows against the model.

The declarations say which parameters belong to one fault. The innovations of a filter with the model are white as
long as the drive is the model's; a fault makes them follow their derivative by the size of the fault. That size is
estimated from them (Gauss-Newton on the whitened innovations), with a covariance that allows for innovations which
are not quite white (Newey, West 1987, doi:10.2307/1913610), and a fault is reported when it is larger than what
matters, at the confidence asked for.
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
_FRACTIONS = (1.0, 0.3)
_TURNS = 5
_MOST_DOUBT = 0.5  # of a parameter: beyond it the prior says nothing, and steps would leave the model
_SINGULAR = 1e10
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
    doubts = {n: abs(s / values[n]) for n, s in (std or {}).items() if s > 0.0 and values[n] != 0.0}
    watched = {name for names in kinds.values() for name in names}
    doubtful = {n: min(s, _MOST_DOUBT) for n, s in doubts.items() if n not in watched}
    changes = (*kinds.values(), *((name,) for name in doubtful))
    prior = np.array([0.0] * len(kinds) + [s**-2 for s in doubtful.values()])
    trial = _Trial(structure, values, recording, settings, noise, changes, prior)
    found = _estimated(trial)
    spread = _spread(found, prior)
    return tuple(
        _finding(
            fault,
            names,
            float(found.size[i]),
            math.hypot(float(spread[i]), max(doubts.get(name, 0.0) for name in names)),
            matters,
            confidence,
        )
        for i, (fault, names) in enumerate(kinds.items())
    )


@dataclass(frozen=True)
class _Trial:
    """The recording filtered with changed models.

    What may change: the faults, of which nothing is known beforehand, then every other parameter on its own, as far
    as the model does not know it; `prior` is how well it does, 1 over the variance of its logarithm, 0 for the faults.
    """

    structure: Structure
    values: Mapping[str, float]
    recording: Recording
    settings: Settings
    noise: Noise
    changes: tuple[tuple[str, ...], ...]
    prior: Array

    def run(self, sizes: Array) -> Filtered:
        """Filter with the logarithms of all factors, shape (K, changes), side by side."""
        values = {name: np.full(len(sizes), value) for name, value in self.values.items()}
        for i, names in enumerate(self.changes):
            for name in names:
                values[name] = values[name] * np.exp(sizes[:, i])
        with np.errstate(all="ignore"):  # a model far off may diverge: it has no likelihood then
            return extended(see(self.structure, values, self.recording, self.settings).watched, self.noise)

    def posterior(self, found: Filtered, sizes: Array) -> Array:
        """Log-likelihood of each with the prior, -inf where the filter diverged."""
        likelihood = found.log_likelihood - 0.5 * np.square(sizes) @ self.prior
        return np.where(np.isfinite(likelihood), likelihood, -np.inf)

    def tried(self, sizes: Array) -> Array:
        """Posterior of each size, filtered side by side."""
        return self.posterior(self.run(sizes), sizes)

    def around(self, sizes: Array) -> list[_Point]:
        """Each of the sizes with the derivatives there, all filtered side by side."""
        K, m = sizes.shape
        steps = _DIFFERENCE * np.vstack([np.zeros((1, m)), np.eye(m), -np.eye(m)[self.prior == 0.0]])
        at = (sizes[:, None] + steps).reshape(-1, m)
        found = self.run(at)
        likelihood = self.posterior(found, at).reshape(K, -1)[:, 0]
        white = found.white.transpose(1, 0, 2).reshape(K, len(steps), -1)
        below = np.repeat(white[:, :1], m, axis=1)
        below[:, self.prior == 0.0] = white[:, m + 1 :]
        wide = np.where(self.prior == 0.0, 2.0, 1.0)[:, None] * _DIFFERENCE
        slopes = (white[:, 1 : m + 1] - below) / wide
        likelihood = np.where(np.isfinite(slopes).all(axis=(1, 2)), likelihood, -np.inf)
        return [_Point(sizes[i], float(likelihood[i]), slopes[i].T, white[i, 0]) for i in range(K)]


class _Point(NamedTuple):
    """Sizes of the faults, the likelihood there, the whitened innovations and their derivatives."""

    size: Array
    likelihood: float
    slopes: Array
    white: Array


def _estimated(trial: _Trial) -> _Point:
    """Sizes with the largest likelihood: a coarse look along each, then Gauss-Newton."""
    m = len(trial.changes)
    tries = [np.zeros(m)]
    for i in np.flatnonzero(trial.prior == 0.0):
        tries += [np.log(factor) * np.eye(m)[i] for factor in _FACTORS]
    found = trial.tried(np.array(tries))
    if not np.isfinite(found[0]):
        raise SettingsError("the filter diverges with the model as it is: it does not belong to this recording")
    (here,) = trial.around(tries[int(np.argmax(found))][None])
    for _ in range(_TURNS):
        if not np.isfinite(here.likelihood):
            break
        root = np.diag(np.sqrt(trial.prior))
        design, miss = np.vstack([here.slopes, root]), np.concatenate([here.white, root @ here.size])
        step = -np.linalg.lstsq(design, miss, rcond=None)[0]
        if np.abs(step * np.linalg.norm(design, axis=0)).max() < _SETTLED:
            break
        step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
        best = max(
            trial.around(np.array([here.size + fraction * step for fraction in _FRACTIONS])), key=lambda p: p.likelihood
        )
        if not best.likelihood > here.likelihood:
            break
        here = best
    return here


def _spread(found: _Point, prior: Array) -> Array:
    """Standard deviation of each estimated size, with autocorrelated innovations allowed for."""
    slopes, white = found.slopes, found.white
    information = slopes.T @ slopes + np.diag(prior) if np.isfinite(found.likelihood) else np.zeros((len(prior),) * 2)
    scale = np.sqrt(np.diag(information))
    if not np.all(scale > 0.0) or np.linalg.cond(information / scale[:, None] / scale) > _SINGULAR:
        return np.full(len(prior), np.inf)
    scores = slopes * white[:, None]
    total = scores.T @ scores + np.diag(prior)
    lags = max(1, int(len(white) ** (1.0 / 3.0)))
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (part + part.T)
    inverse = np.linalg.inv(information)
    robust = np.diag(inverse @ total @ inverse)
    plain = np.diag(inverse) * max(1.0, float(np.mean(white**2)))
    return np.asarray(np.sqrt(np.maximum(robust, plain)))


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
        text = (
            f"{fault.subject} {word}: {factor:.2f} times the model's ({low:.2f} to {high:.2f}), {100 * sure:.1f} % sure"
        )
        return Finding(fault.subject, tuple(names), "changed", factor, (low, high), sure, text)
    if not z * std < math.log1p(_TELLING) - up:
        text = f"{fault.subject}: not decidable from this recording"
        return Finding(fault.subject, tuple(names), "not decidable", factor, (low, high), sure, text)
    text = f"{fault.subject}: as before, {factor:.2f} times the model's ({low:.2f} to {high:.2f})"
    return Finding(fault.subject, tuple(names), "as before", factor, (low, high), sure, text)
