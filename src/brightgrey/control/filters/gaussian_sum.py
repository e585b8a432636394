"""Gaussian-sum filter: extended Kalman filters side by side for a gap that may be open or closed.

The predictive distribution is a sum of Gaussians (Alspach and Sorenson 1972, doi:10.1109/TAC.1972.1100034). A component
is split in two where a contact is uncertain within its standard deviation and matters for the speeds. The split is
along the quantity that decides the contact and keeps mean and covariance of the pair. The likelihood of the recording
then weighs the components. Components that have come together are merged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from brightgrey.arrays import Array
from brightgrey.control.filters.extended_kalman import (
    FilterRecord,
    FilterResult,
    Noise,
    extended_kalman_filter,
    initial_estimate,
    predict_state,
    update_state,
)
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel

__all__ = ["GaussianSumOptions", "gaussian_sum_filter"]


@dataclass(frozen=True)
class GaussianSumOptions:
    """Number of components, and when they are split and merged."""

    components: int = 40  #: Extended filters for each recording.
    components_per_initial: int = 3  #: One component in so many is used at the start; the others are kept for splits.
    #: From the mean to each half, in standard deviations. Larger ones lose the tails when a half is split again.
    split_distance: float = 0.7
    ambiguity_std: float = 3.0  #: Standard deviations within which a contact counts as uncertain.
    #: Effect of an uncertain contact on a speed within a sample, over the speed's standard deviation. Below the first
    #: a component is not split; above the second its weight alone decides.
    min_influence: float = 0.1
    max_influence: float = 10.0
    negligible_weight: float = 1e-4  #: Part of the largest weight below which a component may be given up for a split.
    #: Squared distance of two components over their common variance below which they are merged.
    merge_distance: float = 0.2
    #: A component of less than one part in so many of the weight is merged from a larger distance.
    light_component: float = 20.0
    passes: int = 3  #: Rounds of splits within a sample.
    splits_per_pass: int = 8  #: Largest number of splits in a round.


GAUSSIAN_SUM = GaussianSumOptions()


@dataclass(frozen=True)
class _Mixture:
    """Components of K recordings: weights (K, M), states (K M, m), covariances (K M, m, m)."""

    weights: Array
    x: Array
    P: Array

    def relevant(self, options: GaussianSumOptions) -> NDArray[np.bool_]:
        """Mask of the components with a relevant weight, shape (K, M)."""
        return np.asarray(self.weights > options.negligible_weight * self.weights.max(axis=1, keepdims=True))


def gaussian_sum_filter(
    filter_input: FilterInput, noise: Noise, options: GaussianSumOptions = GAUSSIAN_SUM
) -> FilterResult:
    """Run the Gaussian-sum filter over the recordings; without a gap it is the extended Kalman filter.

    Parameters
    ----------
    filter_input : FilterInput
        From :func:`brightgrey.control.filters.setup.prepare`.
    noise : Noise
    options : GaussianSumOptions

    Returns
    -------
    FilterResult
        Mean and covariance of the sum. Likelihood and normalised innovations are those of the sum, too.
    """
    if not any(e.limits is not None for e in filter_input.system.elements):
        return extended_kalman_filter(filter_input, noise)
    samples, K = filter_input.u.shape
    M = options.components
    process = ProcessModel.of(filter_input, M)
    R, torque = np.repeat(noise.measurement_covariance(K), M, axis=0), np.repeat(noise.disturbance_std(K), M, axis=0)
    mixture = _initial_mixture(filter_input, process, noise.disturbance_std(K), options)
    record = FilterRecord.empty(samples, K, process.n_states, len(filter_input.differenced))
    log_likelihood, white = np.zeros(K), np.empty(record.innovations.shape)
    for k in range(samples):
        if k:
            mixture = _merge_components(mixture, process, options)
            for _ in range(options.passes):
                mixture = _split_components(mixture, process, k - 1, options)
            mixture = _Mixture(mixture.weights, *predict_state(process, k - 1, mixture.x, mixture.P, torque))
        updated = update_state(process, k, mixture.x, mixture.P, np.repeat(filter_input.y[k], M, axis=0), R)
        innovation, S = _moments(mixture.weights, updated.innovation, updated.S)
        weights, likelihood, white[k] = _update_weights(mixture.weights, updated.innovation, updated.S)
        mixture = _Mixture(weights, updated.x, updated.P)
        log_likelihood += likelihood
        mean, P = _moments(mixture.weights, mixture.x, mixture.P)
        heaviest = np.arange(K) * M + mixture.weights.argmax(axis=1)
        record.store(k, mean, P, innovation, S, mixture.x[heaviest])
    return record.result(white, log_likelihood)


def _update_weights(weights: Array, innovation: Array, S: Array) -> tuple[Array, Array, Array]:
    """Weights after a sample, the logarithm of its likelihood (K,), and its outputs as normal quantiles (K, outputs).

    The innovations of a Gaussian sum are not normal. Their probability integral transform is uniform, whatever the
    distribution (Rosenblatt 1952, doi:10.1214/aoms/1177729394), so that its normal quantile is standard normal.
    """
    K, M = weights.shape
    roots = np.linalg.cholesky(S)
    own = np.linalg.solve(roots, innovation[..., None])[..., 0].reshape(K, M, -1)
    log_stds = np.log(np.einsum("kii->ki", roots)).reshape(K, M, -1)
    each = np.log(np.maximum(weights, 1e-300))
    quantiles = np.empty((K, own.shape[2]))
    for output in range(own.shape[2]):
        rest = logsumexp(each, axis=1)
        below, above = (logsumexp(each + log_ndtr(side * own[:, :, output]), axis=1) - rest for side in (1.0, -1.0))
        quantiles[:, output] = np.where(below < above, ndtri_exp(below), -ndtri_exp(above))
        each = each - 0.5 * np.square(own[:, :, output]) - log_stds[:, :, output] - 0.5 * np.log(2.0 * np.pi)
    likelihood = logsumexp(each, axis=1)
    return np.exp(each - likelihood[:, None]), likelihood, quantiles


def _moments(weights: Array, x: Array, P: Array) -> tuple[Array, Array]:
    """Mean (K, m) and covariance (K, m, m) of the sums."""
    K, M = weights.shape
    each, inner = x.reshape(K, M, -1), P.reshape(K, M, *P.shape[1:])
    mean = np.einsum("kj,kji->ki", weights, each)
    deviation = each - mean[:, None]
    cov = np.einsum("kj,kjab->kab", weights, inner) + np.einsum("kj,kja,kjb->kab", weights, deviation, deviation)
    return mean, cov


def _initial_mixture(
    filter_input: FilterInput, process: ProcessModel, torque: Array, options: GaussianSumOptions
) -> _Mixture:
    """Components evenly over every gap; the others have no weight."""
    K, M = filter_input.u.shape[1], options.components
    x, P = initial_estimate(filter_input, process.select(np.arange(K) * M), torque)
    x, P = np.repeat(x, M, axis=0), np.repeat(P, M, axis=0)
    used = max(1, M // options.components_per_initial)
    position = np.tile((np.arange(M) % used + 0.5) / used - 0.5, K)
    for e in process.batch.elements:
        if e.has_limits:
            variance = P[:, e.state, e.state]
            direction = P[:, :, e.state] / np.where(variance > 0.0, variance, 1.0)[:, None]
            x += (position * (e.high - e.low))[:, None] * direction
            P -= ((1.0 - used**-2) * variance)[:, None, None] * direction[:, :, None] * direction[:, None, :]
    return _Mixture(np.tile((np.arange(M) < used) / used, (K, 1)), x, P)


def _contact_ambiguity(
    mixture: _Mixture, process: ProcessModel, k: int, options: GaussianSumOptions
) -> tuple[Array, Array]:
    """Influence of an uncertain contact on each component, shape (K M,), and the direction of a split (K M, m).

    A contact is decided by the limited state, or by the position to which its shaft pulls it. Its influence is the
    speed that the contact's torque gives while the contact is uncertain, which in passing is less than a sample.
    """
    n, speeds = process.n_states, process.batch.speeds
    z, P = mixture.x[:, :n], mixture.P
    speed_std = np.sqrt(np.maximum(np.einsum("kii->ki", P)[:, speeds], np.square(process.tolerance)[:, None]))
    change = process.derivative(k, mixture.x) * process.dt
    score, direction = np.zeros(len(z)), np.zeros(mixture.x.shape)
    for e in (e for e in process.batch.elements if e.has_limits):
        pulled, pull_rate = e.contact_condition()
        own = np.zeros_like(pulled)
        own[:, e.state] = 1.0
        for row in (pulled, own):
            here, way = (np.einsum("ki,ki->k", row, part) for part in (z, change))
            cov = np.einsum("kij,kj->ki", P[:, :, :n], row)
            std = np.sqrt(np.maximum(np.einsum("ki,ki->k", row, cov[:, :n]), 1e-300))
            low, high = np.minimum(here, here + way), np.maximum(here, here + way)
            far = np.min([np.maximum(np.maximum(limit - high, low - limit), 0.0) for limit in (e.low, e.high)], axis=0)
            duration = process.dt * np.minimum(1.0, std / np.maximum(2.0 * np.abs(way), 1e-300))
            speed = np.abs(e.G[:, speeds]) * (pull_rate * std * duration)[:, None]
            influence = np.max(speed / speed_std, axis=1)
            uncertain = (far < options.ambiguity_std * std) & (influence > options.min_influence)
            found = np.where(uncertain, np.minimum(influence, options.max_influence), 0.0)
            more = found > score
            score[more], direction[more] = found[more], cov[more] / std[more, None]
    return score, direction


def _split_components(mixture: _Mixture, process: ProcessModel, k: int, options: GaussianSumOptions) -> _Mixture:
    """Split the components with the most influential uncertain contacts, in place of those without weight."""
    K, M = mixture.weights.shape
    score, direction = _contact_ambiguity(mixture, process, k, options)
    relevant = mixture.relevant(options)
    priority = np.where(relevant, score.reshape(K, M) * mixture.weights, 0.0)
    weights, x, P = np.where(relevant, mixture.weights, 0.0), mixture.x.copy(), mixture.P.copy()
    candidates, replaceable = np.argsort(-priority, axis=1), np.argsort(mixture.weights, axis=1)
    rows = np.arange(K)
    for i in range(min(options.splits_per_pass, M)):
        one, other = candidates[:, i], replaceable[:, i]
        r = rows[(priority[rows, one] > 0.0) & ~relevant[rows, other]]
        a, b = r * M + one[r], r * M + other[r]
        shift = options.split_distance * direction[a]
        P[a] -= shift[:, :, None] * shift[:, None, :]
        x[b], P[b] = x[a] + shift, P[a]
        x[a] -= shift
        weights[r, one[r]] *= 0.5
        weights[r, other[r]] = weights[r, one[r]]
    return _Mixture(weights / weights.sum(axis=1, keepdims=True), process.clip_to_limits(x), P)


def _merge_components(mixture: _Mixture, process: ProcessModel, options: GaussianSumOptions) -> _Mixture:
    """Merge the nearest pair of components of each recording if it is close enough."""
    M = mixture.weights.shape[1]
    i, j, near = _nearest_pair(mixture, process, options)
    r = np.flatnonzero(near)
    weights, x, P = mixture.weights.copy(), mixture.x.copy(), mixture.P.copy()
    a, b = r * M + i[r], r * M + j[r]
    total = weights[r, i[r]] + weights[r, j[r]]
    share, rest = weights[r, i[r]] / total, weights[r, j[r]] / total
    distance = x[a] - x[b]
    between = (share * rest)[:, None, None] * distance[:, :, None] * distance[:, None, :]
    P[a] = share[:, None, None] * P[a] + rest[:, None, None] * P[b] + between
    x[a] = share[:, None] * x[a] + rest[:, None] * x[b]
    weights[r, i[r]], weights[r, j[r]] = total, 0.0
    return _Mixture(weights, x, P)


def _nearest_pair(
    mixture: _Mixture, process: ProcessModel, options: GaussianSumOptions
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Indices of the nearest pair of components, shape (K,) each, and whether it is close enough to be merged."""
    K, M = mixture.weights.shape
    n, weights, relevant = process.n_states, mixture.weights, mixture.relevant(options)
    x = mixture.x.reshape(K, M, -1)[:, :, :n]
    var = np.einsum("kii->ki", mixture.P).reshape(K, M, -1)[:, :, :n]
    floor = np.square(process.negligible_differences()).reshape(K, M, n)[:, :1, None]
    distance = np.square(x[:, :, None] - x[:, None]) / (var[:, :, None] + var[:, None] + floor)
    both = weights[:, :, None] * weights[:, None] / (weights[:, :, None] + weights[:, None] + 1e-300)
    cost = distance.max(axis=3) * np.minimum(options.light_component * both, 1.0)
    allowed = relevant[:, :, None] & relevant[:, None] & ~np.eye(M, dtype=bool)
    cost = np.where(allowed, cost, np.inf).reshape(K, -1)
    best = cost.argmin(axis=1)
    return best // M, best % M, np.asarray(cost.min(axis=1) < options.merge_distance)
