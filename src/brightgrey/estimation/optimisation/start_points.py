"""Where descents begin: given starts, the torque balance, and candidates that are good and unlike each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq

from brightgrey.arrays import Array
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = ["best_diverse", "given_starts", "perturbed_starts", "resonance_scan", "starts_at_residual_peaks"]

_APART = 0.5  # of the median distance between candidates: starts that are unlike each other
_SHIFTS = (0.0, 0.05, 0.3)  # standard deviations by which offspring differ from their parent
_REDRAWN = (1, 2, 3)  # numbers of parameters that offspring have drawn anew, beside half of them
_REGROUPED = 0.3  # of the offspring: parts have changed roles
_LANES = 1024  # simulations that look for a resonance
_VALLEY = 2  # half lines either way, among which a resonance has to be the best one


def given_starts(search: ParameterSpace, given: Sequence[Mapping[str, float]]) -> list[Array]:
    """Given starts in SI, each of shape (P,); parameters that are not named take their declared start."""
    declared = list(zip(search.names, search.start.tolist(), strict=True))
    return [np.clip([g.get(n, v) for n, v in declared], search.low, search.high) for g in given]


def best_diverse(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, candidates: Array, count: int
) -> list[Array]:
    """Best `count` of the candidates, shape (P, K) in SI, each some way from all better ones."""
    cost = problem.costs(search.named(candidates), settings)
    return [candidates[:, i] for i in _diverse(search.to_scaled(candidates), cost, count)]


def starts_at_residual_peaks(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    parent: Array,
    count: int,
    rng: np.random.Generator,
) -> Array:
    """Values `parent`, shape (P,), with parts in other roles, so that they ring where the residual does.

    Frequencies are drawn as the residual's power is distributed: a resonance that is missing leaves its own.

    Returns
    -------
    ndarray, shape (P, count)
        SI; no columns if no effect has parts that can change roles, or nothing is left of the residual.
    """
    residual = problem.residuals(search.named(parent[:, None]), settings)[:, 0]
    power, turning, begin = [], [], 0
    for r in problem.recordings:
        for piece in residual[begin : begin + r.y.size].reshape(r.y.shape):
            power.append(np.square(np.abs(rfft((piece - piece.mean()) * np.hanning(len(piece)))))[1:])
            turning.append(2.0 * np.pi * rfftfreq(len(piece), r.dt)[1:])
        begin += r.y.size
    weight = np.concatenate(power)
    blocks = [(list(block.rows), block.hints.perturb) for block in search.blocks if block.hints.perturb is not None]
    if not blocks or not weight.sum() > 0.0:
        return np.zeros((len(parent), 0))
    wanted = rng.choice(np.concatenate(turning), count, p=weight / weight.sum())
    values = np.repeat(parent[:, None], count, axis=1)
    for rows, regroup in blocks:
        values[rows] = regroup(values[rows], rng.random((len(rows), count)), wanted)
    return np.clip(values, search.low[:, None], search.high[:, None])


def resonance_scan(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, parent: Array, count: int
) -> tuple[Array, int]:
    """Values `parent`, shape (P,), with parts in other roles, so that they ring where they explain most.

    A resonance that is missing leaves its power in the residual, but one without damping has to be met to within a
    fraction of a period in the whole recording. So lines as close as the recording resolves are gone through where the
    residual has most power, with all ways that parts can change roles, as many as about a thousand simulations allow
    (102 lines for two masses, 25 for three, 11 for four); a valley is where a line is better than those beside it.

    Returns
    -------
    ndarray, shape (P, K)
        SI, best first, at most `count`; no columns if no effect has parts that can change roles, or nothing is left
        of the residual.
    int
        Parameter sets that were simulated.
    """
    turning, power = _spectrum(problem, problem.residuals(search.named(parent[:, None]), settings)[:, 0])
    found, costs, sets = [np.zeros((len(parent), 0))], [np.zeros(0)], 1
    if not power.any():
        return found[0], sets
    for rows, ways in (
        (list(block.rows), block.hints.enumerate) for block in search.blocks if block.hints.enumerate is not None
    ):
        each = ways(parent[rows], turning[:1]).shape[2]
        lines = np.sort(np.argsort(-power, kind="stable")[: max(_LANES // each, 1)])
        values = np.repeat(parent[:, None], len(lines) * each, axis=1)
        values[rows] = ways(parent[rows], turning[lines]).reshape(len(rows), -1)
        values = np.clip(values, search.low[:, None], search.high[:, None])
        cost = problem.costs(search.named(values), settings, np.full(values.shape[1], np.inf))  # keeps no output
        valley = _valleys(lines, cost.reshape(len(lines), each)).ravel() & np.isfinite(cost)
        found.append(values[:, valley])
        costs.append(cost[valley])
        sets += cost.size
    order = np.argsort(np.concatenate(costs), kind="stable")[:count]
    return np.hstack(found)[:, order], sets


def _spectrum(problem: SimulationErrorProblem, residual: Array) -> tuple[Array, Array]:
    """Angular frequencies half a line apart, from one line of the longest recording on, and power of a residual."""
    longest = max(problem.recordings, key=lambda r: r.samples * r.dt)
    turning = 2.0 * np.pi * rfftfreq(2 * longest.samples, longest.dt)[2:]
    power, begin = np.zeros(len(turning)), 0
    for r in problem.recordings:
        for piece in residual[begin : begin + r.y.size].reshape(r.y.shape):
            size = np.square(np.abs(rfft((piece - piece.mean()) * np.hanning(len(piece)), 2 * len(piece))))
            power += np.interp(turning, 2.0 * np.pi * rfftfreq(2 * len(piece), r.dt), size, right=0.0)
        begin += r.y.size
    return turning, power


def _valleys(lines: NDArray[np.int64], cost: Array) -> NDArray[np.bool_]:
    """Where `cost`, shape (lines, ways), is the least of its way among the lines beside it."""
    near = np.abs(lines[:, None] - lines) <= _VALLEY
    return np.stack([way <= np.where(near, way, np.inf).min(axis=1) for way in cost.T], axis=1)


def perturbed_starts(search: ParameterSpace, parents: Sequence[Array], fresh: Array, rng: np.random.Generator) -> Array:
    """Parents with some parameters drawn anew, or parts in other roles, and all others shifted a little.

    Parameters
    ----------
    search : ParameterSpace
    parents : sequence of ndarray, shape (P,)
        SI, best first; the first of two is taken twice as often.
    fresh : ndarray, shape (P, K)
        Where anew drawn parameters come from.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (P, K)
        SI.
    """
    count = fresh.shape[1]
    low, high = (bound[:, None] for bound in search.box)
    share = 0.5 ** np.arange(len(parents))
    chosen = rng.choice(len(parents), count, p=share / share.sum())
    parent = np.stack(parents, axis=1)[:, chosen]
    regrouped: NDArray[np.bool_] = np.zeros(count, np.bool_)
    for block in search.blocks:
        if block.hints.perturb is not None:
            regrouped = np.less(rng.random(count), _REGROUPED)
            rows = np.array(block.rows)[:, None]
            share, anything = rng.random((len(rows), regrouped.sum())), np.full(regrouped.sum(), np.nan)
            parent[rows, regrouped] = block.hints.perturb(parent[rows, regrouped], share, anything)
    theta = np.clip(search.to_scaled(np.clip(parent, search.low[:, None], search.high[:, None])), low, high)
    shift = rng.choice(_SHIFTS, count) * rng.standard_normal(theta.shape)
    near = np.clip(theta + np.where(search.log[:, None], shift, 0.2 * shift), low, high)
    rank = rng.random(theta.shape).argsort(axis=0)
    redrawn = rank < np.where(regrouped, 0, rng.choice([*_REDRAWN, len(theta) // 2], count))
    return search.from_scaled(np.where(redrawn, search.to_scaled(fresh), near))


def _diverse(theta: Array, cost: Array, count: int) -> list[int]:
    """Numbers of `count` candidates, best first, each some way from all chosen before; `theta` of shape (P, K)."""
    spread = theta.std(axis=1)
    place = (theta / np.where(spread > 0.0, spread, 1.0)[:, None]).T
    order = np.argsort(cost, kind="stable")
    place = place[order]
    apart = np.sqrt(np.maximum(np.square(place[:, None] - place[None]).sum(axis=2), 0.0))
    reach = _APART * float(np.median(apart))
    chosen: list[int] = []
    nearest = np.full(len(order), np.inf)
    while len(chosen) < min(count, len(order)):
        for i in range(len(order)):
            if nearest[i] > reach and len(chosen) < count:
                chosen.append(i)
                nearest = np.minimum(nearest, apart[i])
                nearest[i] = -np.inf
        reach = 0.5 * reach if reach > 1e-9 else -1.0
    return [int(order[i]) for i in chosen]
