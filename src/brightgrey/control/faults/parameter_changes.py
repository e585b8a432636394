"""Which change of a model makes a filter's innovations likely again: many recordings side by side.

Filtering one recording or fifty costs nearly the same, so every search asks for the models it wants to have tried, all
searches wait for each other, and one run of the filter answers them all.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.faults.simulated_changes import ParameterGroup
from brightgrey.control.filters.extended_kalman import Noise, extended_kalman_filter
from brightgrey.control.filters.setup import prepare
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["ChangeProblem", "PosteriorPoint", "maximise_posteriors"]

_DIFFERENCE = 0.01  # of the logarithm: contacts make smaller ones rough
_FACTORS = (0.6, 0.8, 1.25, 1.6, 2.2, 3.0)  # sizes tried first: contacts make the likelihood many-humped
_FRACTIONS = (1.0, 0.5, 0.2)
_TURNS = 8
_SETTLED = 0.3  # standard deviations that a step still moves
_LANES = 600  # models in one run of the filter; a matter of memory


@dataclass(frozen=True)
class ChangeProblem:
    """A recording, the model it is held against, and what of it may have changed.

    Attributes
    ----------
    values : mapping of str to float
        The model's parameters, SI.
    recording : Recording
    noise : Noise
    changes : tuple of ParameterGroup
    """

    values: Mapping[str, float]
    recording: Recording
    noise: Noise
    changes: tuple[ParameterGroup, ...]

    @property
    def prior_information(self) -> Array:
        """What is known of the logarithms of the factors: 1 over their variance, 0 for nothing; shape (changes,)."""
        return np.array([change.prior_std**-2 for change in self.changes])


class PosteriorPoint(NamedTuple):
    """Logarithms of the factors and what the innovations say there.

    Attributes
    ----------
    size : ndarray, shape (changes,)
    posterior : float
        -inf where the filter diverges.
    scores : ndarray, shape (samples, changes)
        Derivatives of the samples' logarithms of likelihood.
    information : ndarray, shape (changes, changes)
        Fisher's, with the prior.
    white : ndarray, shape (samples x outputs,)
        Whitened innovations.
    """

    log_factors: Array
    posterior: float
    scores: Array
    information: Array
    normalised_innovations: Array


class _Evaluation(NamedTuple):
    """Of the models that were asked for: posterior (K,), whitened innovations and their expected sizes.

    `white` has shape (K, samples, outputs), `volume` (the logarithm of the covariance's determinant) (K, samples).
    """

    posterior: Array
    normalised_innovations: Array
    log_determinants: Array


_Search = Generator[Array, _Evaluation, PosteriorPoint]


def maximise_posteriors(
    structure: Structure, settings: Settings, trials: Sequence[ChangeProblem]
) -> list[PosteriorPoint]:
    """Find the largest posterior of each trial."""
    searches = [_fisher_scoring(trial) for trial in trials]
    asked = {i: next(search) for i, search in enumerate(searches)}
    found: dict[int, PosteriorPoint] = {}
    while asked:
        answers = _evaluate_in_batches(structure, settings, [(trials[i], sizes) for i, sizes in asked.items()])
        for i, answer in zip(tuple(asked), answers, strict=True):
            try:
                asked[i] = searches[i].send(answer)
            except StopIteration as end:
                found[i] = end.value
                del asked[i]
    return [found[i] for i in range(len(trials))]


def _evaluate_in_batches(
    structure: Structure, settings: Settings, asked: Sequence[tuple[ChangeProblem, Array]]
) -> list[_Evaluation]:
    """Filter for all searches, in runs of about _LANES models."""
    out: list[_Evaluation] = []
    part: list[tuple[ChangeProblem, Array]] = []
    for i, one in enumerate(asked):
        part.append(one)
        if i == len(asked) - 1 or sum(len(sizes) for _, sizes in part) + len(asked[i + 1][1]) > _LANES:
            out += _evaluate(structure, settings, part)
            part = []
    return out


def _evaluate(
    structure: Structure, settings: Settings, part: Sequence[tuple[ChangeProblem, Array]]
) -> list[_Evaluation]:
    values: dict[str, list[Array]] = {name: [] for name in structure.parameters}
    for trial, sizes in part:
        factors = {name: np.ones(len(sizes)) for name in values}
        for i, change in enumerate(trial.changes):
            for name in change.parameters:
                factors[name] = factors[name] * np.exp(sizes[:, i])
        for name, course in values.items():
            course.append(trial.values[name] * factors[name])
    each = [trial.recording for trial, sizes in part for _ in sizes]
    noise = Noise(
        np.array([float(np.ravel(trial.noise.torque)[0]) for trial, sizes in part for _ in sizes]),
        np.array([np.ravel(trial.noise.outputs) for trial, sizes in part for _ in sizes]),
    )
    with np.errstate(all="ignore"):  # a model far off may diverge: it has no likelihood then
        merged = {name: np.concatenate(course) for name, course in values.items()}
        found = extended_kalman_filter(prepare(structure, merged, each, settings).filter_input, noise)
        white = found.normalised_innovations.transpose(1, 0, 2)
        volume = np.linalg.slogdet(found.covariances)[1].T
        likelihood = found.log_likelihood
    answers, first = [], 0
    for trial, sizes in part:
        own = slice(first, first + len(sizes))
        posterior = likelihood[own] - 0.5 * np.square(sizes) @ trial.prior_information
        answers.append(_Evaluation(np.where(np.isfinite(posterior), posterior, -np.inf), white[own], volume[own]))
        first += len(sizes)
    return answers


def _differentiate(trial: ChangeProblem, size: Array) -> Generator[Array, _Evaluation, PosteriorPoint]:
    """A point with the derivatives there."""
    m = len(size)
    answer = yield size + _DIFFERENCE * np.vstack([np.zeros((1, m)), np.eye(m), -np.eye(m)])
    white, volume = ((part[1 : m + 1] - part[m + 1 :]) / (2.0 * _DIFFERENCE) for part in answer[1:])
    # Not the difference of their squares: far from the best fit its error would hide what is known beforehand.
    scores = -((white * answer.normalised_innovations[0]).sum(axis=2) + 0.5 * volume).T
    flat = white.reshape(m, -1)
    information = flat @ flat.T + 0.5 / white.shape[2] * volume @ volume.T + np.diag(trial.prior_information)
    usable = bool(np.isfinite(scores).all() and np.isfinite(information).all())
    posterior = float(answer.posterior[0]) if usable else -np.inf
    return PosteriorPoint(size, posterior, scores, information, answer.normalised_innovations[0].ravel())


def _fisher_scoring(trial: ChangeProblem) -> _Search:
    """Sizes with the largest posterior: a coarse look along each, then Fisher's scoring."""
    m = len(trial.changes)
    tries = [np.zeros(m)]
    for i in np.flatnonzero(trial.prior_information == 0.0):
        tries += [np.log(factor) * np.eye(m)[i] for factor in _FACTORS]
    answer = yield np.array(tries)
    here = yield from _differentiate(trial, tries[int(np.argmax(answer.posterior))])
    for _ in range(_TURNS):
        if not np.isfinite(here.posterior):
            break
        uphill = here.scores.sum(axis=0) - trial.prior_information * here.log_factors
        step = np.linalg.lstsq(here.information, uphill, rcond=None)[0]
        if np.abs(step * np.sqrt(np.diag(here.information))).max() < _SETTLED:
            break
        step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
        sizes = np.array([here.log_factors + share * step for share in _FRACTIONS])
        answer = yield sizes
        best = int(np.argmax(answer.posterior))
        if not answer.posterior[best] > here.posterior:
            break
        here = yield from _differentiate(trial, sizes[best])
    return here
