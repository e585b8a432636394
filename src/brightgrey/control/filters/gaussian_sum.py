"""Sum of Gaussians: an extended Kalman filter that does not have to know whether a gap is closed.

Several extended filters run side by side (Alspach, Sorenson 1972, doi:10.1109/TAC.1972.1100034). Where one of them
cannot tell within its spread whether a contact is made, and it matters, it is split in two along the quantity that
decides, with mean and covariance of the pair as before; the recording decides by their likelihoods which are right.
Components that have come to agree are merged.
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
    predict,
    update,
)
from brightgrey.control.filters.state_transition import FilterInput, ProcessModel

__all__ = ["gaussian_sum_filter"]

_COMPONENTS = 40
_FILLED = 3  # of the components one in so many is in use at the start, each with its share of the gap
_APART = 0.7  # standard deviations from the middle to a half; halves of more lose the tails when split again
_REACH = 3.0  # standard deviations within which a contact is in doubt
_MATTERS = 0.1  # of a speed's standard deviation: what a doubtful contact may change in a sample
_MOST = 10.0  # beyond it, weight alone decides which component is split
_IDLE = 1e-4  # of the largest weight: a component that may be given up for a split
_AGREED = 0.2  # squared distance of components that are merged, in their common variance
_SLIGHT = 20.0  # a component of less than a twentieth of the weight is merged from farther off
_PASSES = 3  # in one sample
_SPLITS = 8  # in one pass


@dataclass(frozen=True)
class _Mixture:
    """Components of K recordings: weights (K, M), states (K M, m), covariances (K M, m, m)."""

    weights: Array
    x: Array
    P: Array

    @property
    def relevant(self) -> NDArray[np.bool_]:
        """Which components have weight, shape (K, M)."""
        return np.asarray(self.weights > _IDLE * self.weights.max(axis=1, keepdims=True))


def gaussian_sum_filter(filter_input: FilterInput, noise: Noise, components: int = _COMPONENTS) -> FilterResult:
    """Run the sum of Gaussians over the recordings; without a gap it is the extended filter.

    Parameters
    ----------
    watched : FilterInput
    noise : Noise
    components : int
        Extended filters for each recording.

    Returns
    -------
    Filtered
        Mean and covariance of the sum; likelihood and white innovations are the sum's own.
    """
    if not any(e.limits is not None for e in filter_input.system.elements):
        return extended_kalman_filter(filter_input, noise)
    samples, K = filter_input.u.shape
    course = ProcessModel.of(filter_input, components)
    R, torque = (
        np.repeat(part, components, axis=0) for part in (noise.measurement_covariance(K), noise.disturbance_std(K))
    )
    bank = _initial_mixture(filter_input, course, noise.disturbance_std(K), components)
    out = FilterRecord.empty(samples, K, course.n_states, len(filter_input.differenced))
    chance, white = np.zeros(K), np.empty(out.innovations.shape)
    for k in range(samples):
        if k:
            bank = _merge_components(bank, course)
            for _ in range(_PASSES):
                bank = _split_components(bank, course, k - 1)
            bank = _Mixture(bank.weights, *predict(course, k - 1, bank.x, bank.P, torque))
        after = update(course, k, bank.x, bank.P, np.repeat(filter_input.y[k], components, axis=0), R)
        less, S = _moments(bank.weights, after.innovation, after.S)
        weights, likelihood, white[k] = _update_weights(bank.weights, after.innovation, after.S)
        bank = _Mixture(weights, after.x, after.P)
        chance += likelihood
        mean, P = _moments(bank.weights, bank.x, bank.P)
        heaviest = np.arange(K) * components + bank.weights.argmax(axis=1)
        out.store(k, mean, P, less, S, bank.x[heaviest])
    return out.result(white, chance)


def _update_weights(weights: Array, innovation: Array, S: Array) -> tuple[Array, Array, Array]:
    """Weights after a sample, the logarithm of its likelihood (K,), and its outputs as normal quantiles (K, outputs).

    A sum of Gaussians is not normal, and its innovations over their standard deviation are not either. What the sum
    calls the chance of a smaller output is even, whatever its form (Rosenblatt 1952, doi:10.1214/aoms/1177729394), and
    so its normal quantile is normal.
    """
    K, M = weights.shape
    roots = np.linalg.cholesky(S)
    own = np.linalg.solve(roots, innovation[..., None])[..., 0].reshape(K, M, -1)
    sizes = np.log(np.einsum("kii->ki", roots)).reshape(K, M, -1)
    each = np.log(np.maximum(weights, 1e-300))
    quantiles = np.empty((K, own.shape[2]))
    for output in range(own.shape[2]):
        rest = logsumexp(each, axis=1)
        below, above = (logsumexp(each + log_ndtr(side * own[:, :, output]), axis=1) - rest for side in (1.0, -1.0))
        quantiles[:, output] = np.where(below < above, ndtri_exp(below), -ndtri_exp(above))
        each = each - 0.5 * np.square(own[:, :, output]) - sizes[:, :, output] - 0.5 * np.log(2.0 * np.pi)
    likelihood = logsumexp(each, axis=1)
    return np.exp(each - likelihood[:, None]), likelihood, quantiles


def _moments(weights: Array, x: Array, P: Array) -> tuple[Array, Array]:
    """Mean (K, m) and covariance (K, m, m) of the sums."""
    K, M = weights.shape
    each, inner = x.reshape(K, M, -1), P.reshape(K, M, *P.shape[1:])
    mean = np.einsum("kj,kji->ki", weights, each)
    apart = each - mean[:, None]
    cov = np.einsum("kj,kjab->kab", weights, inner) + np.einsum("kj,kja,kjb->kab", weights, apart, apart)
    return mean, cov


def _initial_mixture(watched: FilterInput, course: ProcessModel, torque: Array, M: int) -> _Mixture:
    """Components evenly over every gap; the others are kept for splits."""
    K = watched.u.shape[1]
    x, P = initial_estimate(watched, course.select(np.arange(K) * M), torque)
    x, P = np.repeat(x, M, axis=0), np.repeat(P, M, axis=0)
    filled = max(1, M // _FILLED)
    share = np.tile((np.arange(M) % filled + 0.5) / filled - 0.5, K)
    for e in course.batch.elements:
        if e.has_limits:
            spread = P[:, e.state, e.state]
            along = P[:, :, e.state] / np.where(spread > 0.0, spread, 1.0)[:, None]
            x += (share * (e.high - e.low))[:, None] * along
            P -= ((1.0 - filled**-2) * spread)[:, None, None] * along[:, :, None] * along[:, None, :]
    return _Mixture(np.tile((np.arange(M) < filled) / filled, (K, 1)), x, P)


def _contact_ambiguity(bank: _Mixture, course: ProcessModel, k: int) -> tuple[Array, Array]:
    """How much a doubtful contact matters to each component, shape (K M,), and along what to split it (K M, m).

    What decides is where the limited state is, or where its shaft would pull it. It matters by the speed that the
    contact's torque gives while it is in doubt: in passing that is shorter than a sample.
    """
    n, speeds = course.n_states, course.batch.speeds
    z, P = bank.x[:, :n], bank.P
    room = np.sqrt(np.maximum(np.einsum("kii->ki", P)[:, speeds], np.square(course.tolerance)[:, None]))
    drift = course.derivative(k, bank.x) * course.dt
    score, along = np.zeros(len(z)), np.zeros(bank.x.shape)
    for e in (e for e in course.batch.elements if e.has_limits):
        pulled, pull = e.contact_condition()
        own = np.zeros_like(pulled)
        own[:, e.state] = 1.0
        for row in (pulled, own):
            here, way = (np.einsum("ki,ki->k", row, part) for part in (z, drift))
            reach = np.einsum("kij,kj->ki", P[:, :, :n], row)
            std = np.sqrt(np.maximum(np.einsum("ki,ki->k", row, reach[:, :n]), 1e-300))
            low, high = np.minimum(here, here + way), np.maximum(here, here + way)
            far = np.min([np.maximum(np.maximum(limit - high, low - limit), 0.0) for limit in (e.low, e.high)], axis=0)
            lasting = course.dt * np.minimum(1.0, std / np.maximum(2.0 * np.abs(way), 1e-300))
            matter = np.max(np.abs(e.G[:, speeds]) * (pull * std * lasting)[:, None] / room, axis=1)
            found = np.where((far < _REACH * std) & (matter > _MATTERS), np.minimum(matter, _MOST), 0.0)
            more = found > score
            score[more], along[more] = found[more], reach[more] / std[more, None]
    return score, along


def _split_components(bank: _Mixture, course: ProcessModel, k: int) -> _Mixture:
    """Split the components whose contact is most in doubt, in place of those that have no weight."""
    K, M = bank.weights.shape
    score, along = _contact_ambiguity(bank, course, k)
    alive = bank.relevant
    wish = np.where(alive, score.reshape(K, M) * bank.weights, 0.0)
    weights, x, P = np.where(alive, bank.weights, 0.0), bank.x.copy(), bank.P.copy()
    wanting, idle = np.argsort(-wish, axis=1), np.argsort(bank.weights, axis=1)
    rows = np.arange(K)
    for i in range(min(_SPLITS, M)):
        one, other = wanting[:, i], idle[:, i]
        r = rows[(wish[rows, one] > 0.0) & ~alive[rows, other]]
        a, b = r * M + one[r], r * M + other[r]
        shift = _APART * along[a]
        P[a] -= shift[:, :, None] * shift[:, None, :]
        x[b], P[b] = x[a] + shift, P[a]
        x[a] -= shift
        weights[r, one[r]] *= 0.5
        weights[r, other[r]] = weights[r, one[r]]
    return _Mixture(weights / weights.sum(axis=1, keepdims=True), course.clip_to_limits(x), P)


def _merge_components(bank: _Mixture, course: ProcessModel) -> _Mixture:
    """Merge in each recording the two components that are nearest to each other, if they agree."""
    M = bank.weights.shape[1]
    i, j, near = _nearest_pair(bank, course)
    r = np.flatnonzero(near)
    weights, x, P = bank.weights.copy(), bank.x.copy(), bank.P.copy()
    a, b = r * M + i[r], r * M + j[r]
    total = weights[r, i[r]] + weights[r, j[r]]
    share, rest = weights[r, i[r]] / total, weights[r, j[r]] / total
    apart = x[a] - x[b]
    between = (share * rest)[:, None, None] * apart[:, :, None] * apart[:, None, :]
    P[a] = share[:, None, None] * P[a] + rest[:, None, None] * P[b] + between
    x[a] = share[:, None] * x[a] + rest[:, None] * x[b]
    weights[r, i[r]], weights[r, j[r]] = total, 0.0
    return _Mixture(weights, x, P)


def _nearest_pair(
    bank: _Mixture, course: ProcessModel
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Numbers of the two components that are nearest to each other, shape (K,), and whether they agree."""
    K, M = bank.weights.shape
    n, weights, alive = course.n_states, bank.weights, bank.relevant
    x = bank.x.reshape(K, M, -1)[:, :, :n]
    var = np.einsum("kii->ki", bank.P).reshape(K, M, -1)[:, :, :n]
    least = np.square(course.negligible_differences()).reshape(K, M, n)[:, :1, None]
    apart = np.square(x[:, :, None] - x[:, None]) / (var[:, :, None] + var[:, None] + least)
    both = weights[:, :, None] * weights[:, None] / (weights[:, :, None] + weights[:, None] + 1e-300)
    cost = apart.max(axis=3) * np.minimum(_SLIGHT * both, 1.0)
    cost = np.where(alive[:, :, None] & alive[:, None] & ~np.eye(M, dtype=bool), cost, np.inf).reshape(K, -1)
    best = cost.argmin(axis=1)
    return best // M, best % M, np.asarray(cost.min(axis=1) < _AGREED)
