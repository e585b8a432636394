"""Which change of a model makes a filter's innovations white again: Gauss-Newton, many recordings side by side.

Filtering one recording or fifty costs nearly the same, so every search asks for the models it wants to have tried, all
searches wait for each other, and one run of the filter answers them all.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.control.kalman import Noise, extended
from brightgrey.control.watching import see
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["Point", "Trial", "estimated"]

Array = NDArray[np.float64]
_DIFFERENCE = 0.01  # of the logarithm: contacts make smaller ones rough
_FACTORS = (0.6, 0.8, 1.25, 1.6, 2.2, 3.0)  # sizes tried first: contacts make the likelihood many-humped
_FRACTIONS = (1.0, 0.5, 0.2)
_TURNS = 5
_SETTLED = 0.3  # standard deviations that a step still moves
_LANES = 600  # models in one run of the filter; a matter of memory


@dataclass(frozen=True)
class Trial:
    """A recording, the model it is held against, and what of it may have changed.

    Attributes
    ----------
    values : mapping of str to float
        The model's parameters, SI.
    recording : Recording
    noise : Noise
    changes : tuple of tuple of str
        Parameters that are multiplied by a common factor.
    prior : ndarray, shape (changes,)
        What is known of the logarithms of the factors: 1 over their variance, 0 for nothing.
    """

    values: Mapping[str, float]
    recording: Recording
    noise: Noise
    changes: tuple[tuple[str, ...], ...]
    prior: Array


class Point(NamedTuple):
    """Logarithms of the factors, the posterior there (-inf: diverged), the white innovations and their derivatives."""

    size: Array
    posterior: float
    slopes: Array
    white: Array


class _Answer(NamedTuple):
    """Posterior (K,) and whitened innovations (K, samples x outputs) of the models that were asked for."""

    posterior: Array
    white: Array


_Search = Generator[Array, _Answer, Point]


def estimated(structure: Structure, settings: Settings, trials: Sequence[Trial]) -> list[Point]:
    """Find the largest posterior of each trial."""
    searches = [_search(trial) for trial in trials]
    asked = {i: next(search) for i, search in enumerate(searches)}
    found: dict[int, Point] = {}
    while asked:
        answers = _answers(structure, settings, [(trials[i], sizes) for i, sizes in asked.items()])
        for i, answer in zip(tuple(asked), answers, strict=True):
            try:
                asked[i] = searches[i].send(answer)
            except StopIteration as end:
                found[i] = end.value
                del asked[i]
    return [found[i] for i in range(len(trials))]


def _answers(structure: Structure, settings: Settings, asked: Sequence[tuple[Trial, Array]]) -> list[_Answer]:
    """Filter for all searches, in runs of about _LANES models."""
    out: list[_Answer] = []
    part: list[tuple[Trial, Array]] = []
    for i, one in enumerate(asked):
        part.append(one)
        if i == len(asked) - 1 or sum(len(sizes) for _, sizes in part) + len(asked[i + 1][1]) > _LANES:
            out += _filtered(structure, settings, part)
            part = []
    return out


def _filtered(structure: Structure, settings: Settings, part: Sequence[tuple[Trial, Array]]) -> list[_Answer]:
    values: dict[str, list[Array]] = {name: [] for name in structure.parameters}
    for trial, sizes in part:
        factors = {name: np.ones(len(sizes)) for name in values}
        for i, names in enumerate(trial.changes):
            for name in names:
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
        found = extended(see(structure, merged, each, settings).watched, noise)
        white = found.white.transpose(1, 0, 2).reshape(len(each), -1)
        likelihood = found.log_likelihood
    answers, first = [], 0
    for trial, sizes in part:
        own = slice(first, first + len(sizes))
        posterior = likelihood[own] - 0.5 * np.square(sizes) @ trial.prior
        answers.append(_Answer(np.where(np.isfinite(posterior), posterior, -np.inf), white[own]))
        first += len(sizes)
    return answers


def _around(trial: Trial, sizes: Array) -> Generator[Array, _Answer, list[Point]]:
    """Each of the sizes with the derivatives there."""
    K, m = sizes.shape
    free = trial.prior == 0.0
    steps = _DIFFERENCE * np.vstack([np.zeros((1, m)), np.eye(m), -np.eye(m)[free]])
    answer = yield (sizes[:, None] + steps).reshape(-1, m)
    white = answer.white.reshape(K, len(steps), -1)
    below = np.repeat(white[:, :1], m, axis=1)
    below[:, free] = white[:, m + 1 :]
    slopes = (white[:, 1 : m + 1] - below) / (np.where(free, 2.0, 1.0)[:, None] * _DIFFERENCE)
    usable = np.isfinite(slopes).all(axis=(1, 2))
    posterior = np.where(usable, answer.posterior.reshape(K, -1)[:, 0], -np.inf)
    return [Point(sizes[i], float(posterior[i]), slopes[i].T, white[i, 0]) for i in range(K)]


def _search(trial: Trial) -> _Search:
    """Sizes with the largest posterior: a coarse look along each, then Gauss-Newton."""
    m = len(trial.changes)
    tries = [np.zeros(m)]
    for i in np.flatnonzero(trial.prior == 0.0):
        tries += [np.log(factor) * np.eye(m)[i] for factor in _FACTORS]
    answer = yield np.array(tries)
    (here,) = yield from _around(trial, tries[int(np.argmax(answer.posterior))][None])
    root = np.diag(np.sqrt(trial.prior))
    for _ in range(_TURNS):
        if not np.isfinite(here.posterior):
            break
        design, miss = np.vstack([here.slopes, root]), np.concatenate([here.white, root @ here.size])
        step = -np.linalg.lstsq(design, miss, rcond=None)[0]
        if np.abs(step * np.linalg.norm(design, axis=0)).max() < _SETTLED:
            break
        step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
        sizes = np.array([here.size + share * step for share in _FRACTIONS])
        answer = yield sizes
        best = int(np.argmax(answer.posterior))
        if not answer.posterior[best] > here.posterior:
            break
        (point,) = yield from _around(trial, sizes[best : best + 1])
        if not point.posterior > here.posterior:
            break
        here = point
    return here
