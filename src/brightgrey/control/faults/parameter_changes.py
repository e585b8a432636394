"""Parameter changes by the likelihood of a filter's innovations, for many recordings side by side.

A filter run for fifty recordings takes hardly longer than one for a single recording. Every search therefore yields the
factors that it wants evaluated, and one filter run answers all searches together.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.faults.simulated_changes import ParameterGroup
from brightgrey.control.filters.extended_kalman import Noise, extended_kalman_filter
from brightgrey.control.filters.setup import prepare
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["ChangeProblem", "FaultCase", "PosteriorPoint", "ScoringOptions", "maximise_posteriors"]


@dataclass(frozen=True)
class ScoringOptions:
    """Search for the largest posterior by Fisher's scoring."""

    #: Step of the central differences in the logarithm of a factor. Contacts make the likelihood rough below it.
    difference: float = 0.01
    #: Factors tried first for each free group, because contacts give the likelihood several maxima.
    start_factors: tuple[float, ...] = (0.6, 0.8, 1.25, 1.6, 2.2, 3.0)
    step_fractions: tuple[float, ...] = (1.0, 0.5, 0.2)  #: Parts of a scoring step that are tried side by side.
    max_steps: int = 8
    tolerance: float = 0.3  #: The search ends at a step below it, in standard deviations.
    max_sets: int = 600  #: Parameter sets in one filter run, limited by memory.


SCORING = ScoringOptions()


@dataclass(frozen=True)
class FaultCase:
    """A recording and the model that it is compared with."""

    values: Mapping[str, float]  #: The model's parameters, SI.
    recording: Recording
    noise: Noise  #: From a recording without fault, :func:`brightgrey.control.filters.setup.estimate_noise`.
    #: Standard deviations of the model's parameters, SI. A fault must exceed them, too.
    std: Mapping[str, float] = field(default_factory=dict)


class ChangeProblem(NamedTuple):
    """A case and the groups of parameters that may have changed."""

    case: FaultCase
    groups: tuple[ParameterGroup, ...]

    @property
    def prior_information(self) -> Array:
        """Inverse prior variances of the logarithms of the factors, 0 for a free group; shape (groups,)."""
        return np.array([group.prior_std**-2 for group in self.groups])


class PosteriorPoint(NamedTuple):
    """Logarithms of the factors, and the posterior with its derivatives there."""

    log_factors: Array  #: Shape (groups,).
    posterior: float  #: -inf where the filter diverges.
    scores: Array  #: Derivatives of each sample's log-likelihood, shape (samples, groups).
    information: Array  #: Fisher's information with that of the prior, shape (groups, groups).
    normalised_innovations: Array  #: Shape (samples x outputs,).


class _Evaluation(NamedTuple):
    """Posterior (K,), normalised innovations (K, samples, outputs) and log-determinants (K, samples) of K sets.

    The determinants are those of the covariances of the innovations.
    """

    posterior: Array
    normalised_innovations: Array
    log_determinants: Array


_Scoring = Generator[Array, _Evaluation, PosteriorPoint]


def maximise_posteriors(
    structure: Structure, settings: Settings, problems: Sequence[ChangeProblem], options: ScoringOptions = SCORING
) -> list[PosteriorPoint]:
    """Find the point of the largest posterior of each problem."""
    searches = [_fisher_scoring(problem, options) for problem in problems]
    requests = {i: next(search) for i, search in enumerate(searches)}
    found: dict[int, PosteriorPoint] = {}
    while requests:
        pairs = [(problems[i], log_factors) for i, log_factors in requests.items()]
        evaluations = _evaluate_in_batches(structure, settings, pairs, options.max_sets)
        for i, evaluation in zip(tuple(requests), evaluations, strict=True):
            try:
                requests[i] = searches[i].send(evaluation)
            except StopIteration as end:
                found[i] = end.value
                del requests[i]
    return [found[i] for i in range(len(problems))]


def _evaluate_in_batches(
    structure: Structure, settings: Settings, requests: Sequence[tuple[ChangeProblem, Array]], max_sets: int
) -> list[_Evaluation]:
    """Filter for all searches, in runs of about `max_sets` parameter sets."""
    out: list[_Evaluation] = []
    part: list[tuple[ChangeProblem, Array]] = []
    for i, one in enumerate(requests):
        part.append(one)
        if i == len(requests) - 1 or sum(len(sizes) for _, sizes in part) + len(requests[i + 1][1]) > max_sets:
            out += _evaluate(structure, settings, part)
            part = []
    return out


def _evaluate(
    structure: Structure, settings: Settings, part: Sequence[tuple[ChangeProblem, Array]]
) -> list[_Evaluation]:
    """Filter all parameter sets of several searches in one run."""
    values: dict[str, list[Array]] = {name: [] for name in structure.parameters}
    for problem, log_factors in part:
        factors = {name: np.ones(len(log_factors)) for name in values}
        for i, group in enumerate(problem.groups):
            for name in group.parameters:
                factors[name] = factors[name] * np.exp(log_factors[:, i])
        for name, sets in values.items():
            sets.append(problem.case.values[name] * factors[name])
    cases = [problem.case for problem, log_factors in part for _ in log_factors]
    noise = Noise(
        np.array([float(np.ravel(case.noise.torque)[0]) for case in cases]),
        np.array([np.ravel(case.noise.outputs) for case in cases]),
    )
    with np.errstate(all="ignore"):  # a distant model may diverge; its posterior is -inf then
        merged = {name: np.concatenate(sets) for name, sets in values.items()}
        prepared = prepare(structure, merged, [case.recording for case in cases], settings)
        found = extended_kalman_filter(prepared.filter_input, noise)
        white = found.normalised_innovations.transpose(1, 0, 2)
        log_determinants = np.linalg.slogdet(found.covariances)[1].T
    evaluations, first = [], 0
    for problem, log_factors in part:
        own = slice(first, first + len(log_factors))
        posterior = found.log_likelihood[own] - 0.5 * np.square(log_factors) @ problem.prior_information
        finite = np.where(np.isfinite(posterior), posterior, -np.inf)
        evaluations.append(_Evaluation(finite, white[own], log_determinants[own]))
        first += len(log_factors)
    return evaluations


def _differentiate(problem: ChangeProblem, log_factors: Array, difference: float) -> _Scoring:
    """Evaluate a point with its derivatives, by central differences."""
    m = len(log_factors)
    evaluation = yield log_factors + difference * np.vstack([np.zeros((1, m)), np.eye(m), -np.eye(m)])
    white, log_det = ((part[1 : m + 1] - part[m + 1 :]) / (2.0 * difference) for part in evaluation[1:])
    # Differences of the squares would have errors that, far from the best fit, exceed the prior information.
    scores = -((white * evaluation.normalised_innovations[0]).sum(axis=2) + 0.5 * log_det).T
    flat = white.reshape(m, -1)
    information = flat @ flat.T + 0.5 / white.shape[2] * log_det @ log_det.T + np.diag(problem.prior_information)
    usable = bool(np.isfinite(scores).all() and np.isfinite(information).all())
    posterior = float(evaluation.posterior[0]) if usable else -np.inf
    return PosteriorPoint(log_factors, posterior, scores, information, evaluation.normalised_innovations[0].ravel())


def _fisher_scoring(problem: ChangeProblem, options: ScoringOptions) -> _Scoring:
    """Maximise the posterior: a coarse grid along each free group, then Fisher's scoring."""
    m, prior = len(problem.groups), problem.prior_information
    starts = [np.zeros(m)]
    for i in np.flatnonzero(prior == 0.0):
        starts += [np.log(factor) * np.eye(m)[i] for factor in options.start_factors]
    evaluation = yield np.array(starts)
    point = yield from _differentiate(problem, starts[int(np.argmax(evaluation.posterior))], options.difference)
    for _ in range(options.max_steps):
        if not np.isfinite(point.posterior):
            break
        gradient = point.scores.sum(axis=0) - prior * point.log_factors
        step = np.linalg.lstsq(point.information, gradient, rcond=None)[0]
        if np.abs(step * np.sqrt(np.diag(point.information))).max() < options.tolerance:
            break
        step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
        candidates = np.array([point.log_factors + fraction * step for fraction in options.step_fractions])
        evaluation = yield candidates
        best = int(np.argmax(evaluation.posterior))
        if not evaluation.posterior[best] > point.posterior:
            break
        point = yield from _differentiate(problem, candidates[best], options.difference)
    return point
