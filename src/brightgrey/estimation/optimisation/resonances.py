"""Start points with other resonances: where the residual has power, in another order, or in a chain that has grown.

A mass chain has many optima, since one resonance may belong to any shaft, and one that is off in frequency is worse
than none. So some start points are made of an optimum: of the same chain, or of one with a mass less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.fft import rfft, rfftfreq
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.options import START_POINT_DEFAULTS, StartPointOptions
from brightgrey.estimation.optimisation.start_points import given_starts
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.segments import split_recordings
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.simulation import Settings

__all__ = ["grown_starts", "resonance_scan", "starts_at_residual_peaks"]


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


def grown_starts(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    smaller: Mapping[str, float],
    count: int,
    options: StartPointOptions = START_POINT_DEFAULTS,
) -> tuple[Array, int]:
    """Split each mass of a chain with one mass less, behind new shafts with frequencies all over the visible range.

    Of each mass and frequency the best inertia and damping is taken, and of these starts the best. A start is seldom
    better than the chain that it comes from, before it has descended.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    smaller : mapping of str to float
        Optimum with one mass less, SI.
    count : int
        Largest number of starts.
    options : StartPointOptions

    Returns
    -------
    ndarray, shape (P, K)
        SI, best first; no columns if no effect declares how to split.
    int
        Parameter sets that were simulated.
    """
    (parent,) = given_starts(space, [smaller])
    slowest = min(4.0 * np.pi / (r.samples * r.dt) for r in problem.recordings)  # two periods in the recording
    omega = np.geomspace(slowest, max(np.pi / r.dt for r in problem.recordings), options.grown_lines)
    found, costs, sets = [np.zeros((len(parent), 0))], [np.zeros(0)], 0
    for block in space.blocks:
        if block.hints.split is None:
            continue
        split = block.hints.split(smaller, omega)
        choices = split.shape[3]
        values = np.repeat(parent[:, None], split[0].size, axis=1)
        values[list(block.rows)] = split.reshape(len(split), -1)
        values = space.clip(values)
        cost = problem.costs(space.named(values), settings).reshape(-1, choices)
        best = cost.argmin(axis=1) + choices * np.arange(len(cost))
        found.append(values[:, best])
        costs.append(cost.ravel()[best])
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
