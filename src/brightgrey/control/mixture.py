"""Sum of Gaussians: an extended Kalman filter that does not have to know whether a gap is closed.

Several extended filters run side by side (Alspach, Sorenson 1972, doi:10.1109/TAC.1972.1100034). Where one of them
cannot tell within its spread whether a contact is made, and it matters, it is split in two along the quantity that
decides, with mean and covariance of the pair as before; the recording decides by their likelihoods which are right.
Components that have come to agree are merged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.control.course import Course, Watched
from brightgrey.control.kalman import Filtered, Noise, Record, begin, predicted, updated

__all__ = ["mixture"]

Array = NDArray[np.float64]
_COMPONENTS = 20
_APART = 0.866  # standard deviations between the halves of a split and their common mean
_REACH = 3.0  # standard deviations within which a contact is in doubt
_MATTERS = 0.1  # of a speed's standard deviation: what a doubtful contact may change in a sample
_IDLE = 1e-4  # weight of a component that may be given up for a split
_AGREED = 0.2  # squared distance of components that are merged, in their common variance
_PASSES = 3
_MISSED = 0.0
_SPLITS = 4  # in one sample


@dataclass(frozen=True)
class _Bank:
    """Components of K recordings: weights (K, M), states (K M, m), covariances (K M, m, m)."""

    weights: Array
    x: Array
    P: Array


def mixture(watched: Watched, noise: Noise, components: int = _COMPONENTS) -> Filtered:
    """Run the sum of Gaussians over the recordings.

    Parameters
    ----------
    watched : Watched
    noise : Noise
    components : int
        Extended filters for each recording.

    Returns
    -------
    Filtered
        Mean and covariance of the sum. The likelihood is the sum's own.
    """
    samples, K = watched.u.shape
    M = components
    course = Course.of(watched, M)
    R, torque = noise.sensors(K), noise.torques(K)
    many_R, many_torque = np.repeat(R, M, axis=0), np.repeat(torque, M)
    bank = _first(watched, course, torque, M)
    out = Record.empty(samples, K, course.states, len(watched.differenced))
    chance = np.zeros(K)
    for k in range(samples):
        if k:
            bank = _merged(bank, course)
            for _ in range(int(_PASSES)):
                bank = _split(bank, course, k - 1)
            extra = _allowed(bank, course, k - 1)
            x, P = predicted(course, k - 1, bank.x, bank.P, many_torque)
            bank = _Bank(bank.weights, x, P + extra)
        y = np.repeat(watched.y[k], M, axis=0)
        after = updated(course, k, bank.x, bank.P, y, many_R)
        expected, S = _moments(bank.weights, y - after.innovation, after.S)
        likelihood = _log_normal(after.innovation, after.S).reshape(K, M) + np.log(np.maximum(bank.weights, 1e-300))
        best = likelihood.max(axis=1, keepdims=True)
        weights = np.exp(likelihood - best)
        total = weights.sum(axis=1, keepdims=True)
        chance += (best + np.log(total))[:, 0]
        bank = _Bank(weights / total, after.x, after.P)
        mean, P = _moments(bank.weights, bank.x, bank.P)
        out.keep(k, mean, P, watched.y[k] - expected, S)
    return Filtered(out.z, out.std, out.innovations, out.covariances, chance)


def _log_normal(e: Array, S: Array) -> Array:
    """Logarithm of the density, shape (lanes,)."""
    _, size = np.linalg.slogdet(2.0 * np.pi * S)
    return np.asarray(-0.5 * (size + np.einsum("ki,ki->k", e, np.linalg.solve(S, e[..., None])[..., 0])))


def _moments(weights: Array, x: Array, P: Array) -> tuple[Array, Array]:
    """Mean (K, m) and covariance (K, m, m) of the sums."""
    K, M = weights.shape
    each, inner = x.reshape(K, M, -1), P.reshape(K, M, *P.shape[1:])
    mean = np.einsum("kj,kji->ki", weights, each)
    apart = each - mean[:, None]
    cov = np.einsum("kj,kjab->kab", weights, inner) + np.einsum("kj,kja,kjb->kab", weights, apart, apart)
    return mean, cov


def _first(watched: Watched, course: Course, torque: Array, M: int) -> _Bank:
    """Components evenly over every gap, its shaft relaxed."""
    K = watched.u.shape[1]
    x, P = begin(watched, course.picked(np.arange(K) * M), torque)
    x, P = np.repeat(x, M, axis=0), np.repeat(P, M, axis=0)
    filled = max(1, M // 3) if any(e.limited for e in course.lanes.elements) else 1
    share = np.tile((np.arange(M) % filled + 0.5) / filled - 0.5, K)
    for e in course.lanes.elements:
        if e.limited:
            spread = P[:, e.state, e.state]
            along = P[:, :, e.state] / np.where(spread > 0.0, spread, 1.0)[:, None]
            x += (share * (e.high - e.low))[:, None] * along
            P -= ((1.0 - filled**-2) * spread)[:, None, None] * along[:, :, None] * along[:, None, :]
    return _Bank(np.tile((np.arange(M) < filled) / filled, (K, 1)), x, P)


class _Doubt(NamedTuple):
    """Contacts in doubt: how much it matters (K M,), along what to split (K M, m), and what linearisation misses."""

    score: Array
    along: Array
    missed: Array


def _doubts(bank: _Bank, course: Course, k: int) -> _Doubt:
    n = course.states
    z, P = bank.x[:, :n], bank.P
    std = np.sqrt(np.maximum(np.einsum("kii->ki", P)[:, :n], 0.0))
    room = np.maximum(std, course.tolerance[:, None])[:, course.lanes.speeds]
    rate = course.rate(k, bank.x)
    score, along, missed = np.zeros(len(z)), np.zeros(bank.x.shape), np.zeros(bank.x.shape)
    for e in course.lanes.elements:
        if not e.limited:
            continue
        row, pull = e.deciding()
        unit = np.zeros_like(row)
        unit[:, e.state] = 1.0
        for h in (row, unit):
            middle, drift = np.einsum("ki,ki->k", h, z), np.einsum("ki,ki->k", h, rate) * course.dt
            reach = np.einsum("kij,kj->ki", P[:, :, :n], h)
            s = np.sqrt(np.maximum(np.einsum("ki,ki->k", h, reach[:, :n]), 1e-300))
            low, high = np.minimum(middle, middle + drift), np.maximum(middle, middle + drift)
            far = np.minimum(_outside(e.low, low, high), _outside(e.high, low, high)) / s
            jump = (pull * s * course.dt)[:, None] * e.G
            matter = (np.abs(jump[:, course.lanes.speeds]) / room).max(axis=1)
            new = np.where((far < _REACH) & (matter > _MATTERS), np.minimum(matter, 10.0), 0.0)
            better = new > score
            score = np.where(better, new, score)
            along[better] = (reach / s[:, None])[better]
            part = _MISSED * np.exp(-0.5 * np.square(np.minimum(far,50.)))[:, None] * jump
            missed[better, :n] = part[better]
    return _Doubt(score, along, missed)


def _outside(limit: Array, low: Array, high: Array) -> Array:
    """Distance of a limit from [low, high]."""
    return np.maximum(np.maximum(limit - high, low - limit), 0.0)


def _split(bank: _Bank, course: Course, k: int) -> _Bank:
    """Split the components whose contact is most in doubt, in place of those that have no weight."""
    K, M = bank.weights.shape
    doubt = _doubts(bank, course, k)
    alive = bank.weights > _IDLE * bank.weights.max(axis=1, keepdims=True)
    score = np.where(alive, doubt.score.reshape(K, M) * bank.weights, 0.0)
    weights, x, P = bank.weights.copy(), bank.x.copy(), bank.P.copy()
    wanting, idle = np.argsort(-score, axis=1), np.argsort(weights, axis=1)
    rows = np.arange(K)
    for i in range(min(_SPLITS, M // 2)):
        one, other = wanting[:, i], idle[:, i]
        do = (score[rows, one] > 0.0) & ~alive[rows, other]
        r = rows[do]
        a, b = r * M + one[do], r * M + other[do]
        shift = _APART * doubt.along[a]
        P[a] -= shift[:, :, None] * shift[:, None, :]
        P[b] = P[a]
        x[b] = x[a] + shift
        x[a] = x[a] - shift
        weights[r, one[do]] *= 0.5
        weights[r, other[do]] = weights[r, one[do]]
    return _Bank(weights / weights.sum(axis=1, keepdims=True), course.clipped(x), P)


def _allowed(bank: _Bank, course: Course, k: int) -> Array:
    missed = _doubts(bank, course, k).missed
    return missed[:, :, None] * missed[:, None, :]


def _merged(bank: _Bank, course: Course) -> _Bank:
    """Merge in each recording the two components that are nearest to each other, if they agree."""
    K, M = bank.weights.shape
    n = course.states
    rows = np.arange(K)
    weights, x, P = bank.weights.copy(), bank.x.copy(), bank.P.copy()
    each, var = x.reshape(K, M, -1)[:, :, :n], np.einsum("kii->ki", P).reshape(K, M, -1)[:, :, :n]
    floor = np.square(course.least()).reshape(K, M, n)[:, :1]
    d = np.square(each[:, :, None] - each[:, None, :]) / (var[:, :, None] + var[:, None, :] + floor[:, None])
    share = weights[:, :, None] * weights[:, None, :] / (weights[:, :, None] + weights[:, None, :] + 1e-300)
    cost = d.max(axis=3) * np.minimum(20.0 * share, 1.0)
    used = weights > _IDLE * weights.max(axis=1, keepdims=True)
    cost = np.where(used[:, :, None] & used[:, None, :] & ~np.eye(M, dtype=bool), cost, np.inf)
    flat = cost.reshape(K, -1).argmin(axis=1)
    i, j = flat // M, flat % M
    do = cost.reshape(K, -1)[rows, flat] < _AGREED
    r = rows[do]
    a, b = r * M + i[do], r * M + j[do]
    wa, wb = weights[r, i[do]], weights[r, j[do]]
    total = wa + wb
    fa, fb = (wa / total)[:, None], (wb / total)[:, None]
    apart = x[a] - x[b]
    P[a] = fa[:, :, None] * P[a] + fb[:, :, None] * P[b] + (fa * fb)[:, :, None] * apart[:, :, None] * apart[:, None, :]
    x[a] = fa * x[a] + fb * x[b]
    weights[r, i[do]], weights[r, j[do]] = total, 0.0
    return _Bank(weights, x, P)
