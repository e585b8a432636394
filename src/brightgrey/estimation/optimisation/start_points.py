"""Start points of fits: given ones, diverse candidates, perturbed optima, and resonances that the residual shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.fft import rfft, rfftfreq
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.options import START_POINT_DEFAULTS, StartPointOptions
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.segments import split_recordings
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import Structure
from brightgrey.simulation import Settings

__all__ = [
    "best_diverse",
    "given_starts",
    "perturbed_starts",
    "resonance_scan",
    "starts_at_residual_peaks",
    "torque_rows",
]


def given_starts(space: ParameterSpace, given: Sequence[Mapping[str, float]]) -> list[Array]:
    """Given starts in SI, each of shape (P,); parameters that are not named take their declared start value."""
    declared = list(zip(space.names, space.start.tolist(), strict=True))
    return [space.clip(np.array([start.get(name, value) for name, value in declared])) for start in given]


def best_diverse(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    candidates: Array,
    count: int,
    options: StartPointOptions = START_POINT_DEFAULTS,
) -> list[Array]:
    """Choose the best `count` of the candidates, shape (P, K) in SI, each at some distance from all better ones."""
    cost = problem.costs(space.named(candidates), settings)
    chosen = _diverse(space.to_scaled(candidates), cost, count, options.min_distance)
    return [candidates[:, i] for i in chosen]


def starts_at_residual_peaks(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    parent: Array,
    count: int,
    rng: np.random.Generator,
) -> Array:
    """Move a resonance of `parent` to where the residual has power, by exchanging the roles of its parts.

    A resonance that the model lacks leaves its power in the residual. Frequencies are drawn with the distribution of
    the residual's power.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    parent : ndarray, shape (P,)
        SI.
    count : int
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (P, count)
        SI; no columns if no effect declares an exchange of parts, or the residual is zero.
    """
    residual = problem.residuals(space.named(parent[:, None]), settings)[:, 0]
    power, frequencies = [], []
    for r, errors in split_recordings(residual, problem.recordings):
        for error in errors:
            power.append(_power(error, len(error))[1:])
            frequencies.append(2.0 * np.pi * rfftfreq(len(error), r.dt)[1:])
    weight = np.concatenate(power)
    blocks = [(list(block.rows), block.hints.perturb) for block in space.blocks if block.hints.perturb is not None]
    if not blocks or not weight.sum() > 0.0:
        return np.zeros((len(parent), 0))
    drawn = rng.choice(np.concatenate(frequencies), count, p=weight / weight.sum())
    values = np.repeat(parent[:, None], count, axis=1)
    for rows, perturb in blocks:
        values[rows] = perturb(values[rows], rng.random((len(rows), count)), drawn)
    return space.clip(values)


def resonance_scan(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    parent: Array,
    count: int,
    options: StartPointOptions = START_POINT_DEFAULTS,
) -> tuple[Array, int]:
    """Scan the frequencies of a resonance of `parent` for those that explain most of the residual.

    A resonance that the model lacks leaves its power in the residual. But one without damping has to be met to within a
    fraction of a period in the whole recording. So frequency lines as close as the recording resolves are tried where
    the residual has most power, with all ways in which parts can exchange their roles. About a thousand simulations
    allow 102 lines for two masses, 25 for three and 11 for four. Local minima over the lines are returned.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    parent : ndarray, shape (P,)
        SI.
    count : int
        Largest number of starts.
    options : StartPointOptions

    Returns
    -------
    ndarray, shape (P, K)
        SI, best first; no columns if no effect declares an exchange of parts, or the residual is zero.
    int
        Parameter sets that were simulated.
    """
    frequencies, power = _spectrum(problem, problem.residuals(space.named(parent[:, None]), settings)[:, 0])
    found, costs, sets = [np.zeros((len(parent), 0))], [np.zeros(0)], 1
    if not power.any():
        return found[0], sets
    blocks = [(list(block.rows), block.hints.enumerate) for block in space.blocks if block.hints.enumerate is not None]
    for rows, enumerate_ways in blocks:
        values, lines = _scan_values(space, parent, rows, enumerate_ways, frequencies, power, options)
        no_limits = np.full(values.shape[1], np.inf)  # with limits, no output is stored
        cost = problem.costs(space.named(values), settings, no_limits)
        minima = _local_minima(lines, cost.reshape(len(lines), -1), options.scan_neighbours).ravel() & np.isfinite(cost)
        found.append(values[:, minima])
        costs.append(cost[minima])
        sets += cost.size
    order = np.argsort(np.concatenate(costs), kind="stable")[:count]
    return np.hstack(found)[:, order], sets


def _scan_values(
    space: ParameterSpace,
    parent: Array,
    rows: list[int],
    enumerate_ways: Callable[[Array, Array], Array],
    frequencies: Array,
    power: Array,
    options: StartPointOptions,
) -> tuple[Array, NDArray[np.int64]]:
    """Parameter sets of a scan, shape (P, lines * ways), and the indices of its frequency lines."""
    ways = enumerate_ways(parent[rows], frequencies[:1]).shape[2]
    lines = np.sort(np.argsort(-power, kind="stable")[: max(options.scan_simulations // ways, 1)])
    values = np.repeat(parent[:, None], len(lines) * ways, axis=1)
    values[rows] = enumerate_ways(parent[rows], frequencies[lines]).reshape(len(rows), -1)
    return space.clip(values), lines


def _power(error: Array, length: int) -> Array:
    """Power spectrum of a residual with a Hann window, padded to `length`."""
    return np.asarray(np.square(np.abs(rfft((error - error.mean()) * np.hanning(len(error)), length))))


def _spectrum(problem: SimulationErrorProblem, residual: Array) -> tuple[Array, Array]:
    """Angular frequencies, half a line apart in the longest recording, and the power of a residual at them."""
    longest = max(problem.recordings, key=lambda r: r.samples * r.dt)
    frequencies = 2.0 * np.pi * rfftfreq(2 * longest.samples, longest.dt)[2:]
    power = np.zeros(len(frequencies))
    for r, errors in split_recordings(residual, problem.recordings):
        for error in errors:
            own = 2.0 * np.pi * rfftfreq(2 * len(error), r.dt)
            power += np.interp(frequencies, own, _power(error, 2 * len(error)), right=0.0)
    return np.asarray(frequencies), power


def _local_minima(lines: NDArray[np.int64], cost: Array, neighbours: int) -> NDArray[np.bool_]:
    """Mask of the local minima over the lines of `cost`, shape (lines, ways), for each way."""
    near = np.abs(lines[:, None] - lines) <= neighbours
    return np.stack([way <= np.where(near, way, np.inf).min(axis=1) for way in cost.T], axis=1)


def perturbed_starts(
    space: ParameterSpace,
    parents: Sequence[Array],
    fresh: Array,
    rng: np.random.Generator,
    torques: Sequence[int] = (),
    options: StartPointOptions = START_POINT_DEFAULTS,
) -> Array:
    """Perturb optima: sample some parameters anew, or exchange the roles of parts, and shift all others a little.

    The torques at the masses share what they explain. So all of them are sampled anew together in a part of the copies.

    Parameters
    ----------
    space : ParameterSpace
    parents : sequence of ndarray, shape (P,)
        SI, best first; each is taken twice as often as the next one.
    fresh : ndarray, shape (P, K)
        Samples from which the parameters that are sampled anew are taken.
    rng : numpy.random.Generator
    torques : sequence of int
        Rows of the torques at the masses, see `torque_rows`.
    options : StartPointOptions

    Returns
    -------
    ndarray, shape (P, K)
        SI.
    """
    count = fresh.shape[1]
    low, high = (bound[:, None] for bound in space.box)
    share = 0.5 ** np.arange(len(parents))
    chosen = rng.choice(len(parents), count, p=share / share.sum())
    parent = np.stack(parents, axis=1)[:, chosen]
    exchanged: NDArray[np.bool_] = np.zeros(count, np.bool_)
    for block in space.blocks:
        if block.hints.perturb is not None:
            exchanged = np.less(rng.random(count), options.exchanged_share)
            rows = np.array(block.rows)[:, None]
            share, any_frequency = rng.random((len(rows), exchanged.sum())), np.full(exchanged.sum(), np.nan)
            parent[rows, exchanged] = block.hints.perturb(parent[rows, exchanged], share, any_frequency)
    theta = np.clip(space.to_scaled(space.clip(parent)), low, high)
    shift = rng.choice(options.shifts, count) * rng.standard_normal(theta.shape)
    near = np.clip(theta + np.where(space.log[:, None], shift, options.linear_shift * shift), low, high)
    rank = rng.random(theta.shape).argsort(axis=0)
    redrawn = rank < np.where(exchanged, 0, rng.choice([*options.redrawn, len(theta) // 2], count))
    if torques:
        together: NDArray[np.bool_] = np.zeros(theta.shape, np.bool_)
        together[list(torques)] = True
        redrawn = np.where(np.less(rng.random(count), options.redrawn_torques), together, redrawn)
    return space.from_scaled(np.where(redrawn, space.to_scaled(fresh), near))


def torque_rows(structure: Structure, space: ParameterSpace) -> list[int]:
    """Rows of the parameters of all torques at the masses, and of the width in which friction reverses."""
    placed = (p for p in structure.beside if p.effect.where == "mass")
    names = {FRICTION_WIDTH, *(p.parameter(q.symbol) for p in placed for q in p.effect.parameters)}
    return [i for i, name in enumerate(space.names) if name in names]


def _diverse(theta: Array, cost: Array, count: int, min_distance: float) -> list[int]:
    """Indices of `count` candidates, best first, each at some distance from those before; `theta` of shape (P, K)."""
    spread = theta.std(axis=1)
    place = (theta / np.where(spread > 0.0, spread, 1.0)[:, None]).T
    order = np.argsort(cost, kind="stable")
    place = place[order]
    distance = np.sqrt(np.maximum(np.square(place[:, None] - place[None]).sum(axis=2), 0.0))
    required = min_distance * float(np.median(distance))
    chosen: list[int] = []
    nearest = np.full(len(order), np.inf)
    while len(chosen) < min(count, len(order)):
        for i in range(len(order)):
            if nearest[i] > required and len(chosen) < count:
                chosen.append(i)
                nearest = np.minimum(nearest, distance[i])
                nearest[i] = -np.inf
        required = 0.5 * required if required > 1e-9 else -1.0  # equal candidates are apart by rounding only
    return [int(order[i]) for i in chosen]
