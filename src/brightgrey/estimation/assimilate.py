"""Starts from an ensemble Kalman filter: parameters and states are learned together along the recording.

The cost of a drive with a gap is rugged: a slightly wrong parameter shifts a contact, and all that follows is another
motion. A filter does not let it come to that. An ensemble of parameter sets is simulated over a few samples at a time;
what the measurement says then corrects the states (by all it is worth) and the parameters (by a part of it), so that
every member stays on the measured motion. Passes over the recording with more and more of its worth lead the
ensemble to where descents find the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.problem import Problem, system_for
from brightgrey.estimation.spent import Spent
from brightgrey.kit import StateSpace
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response

__all__ = ["assimilated"]

Array = NDArray[np.float64]
_MEMBERS = 256
_SHORTEST, _STRETCHES = 10, 180  # samples between two corrections, at least; stretches of a recording, at most
_WORTH = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)  # of the measurement, for the parameters, in one pass after the other
_SPREAD, _SPREAD_LINEAR = 0.3, 0.05  # standard deviations about the parents: in the logarithm, in the range's width
_PERTURBED = 1e-2  # in the searched scale, to see which parameters are dead times


def assimilated(
    problem: Problem, search: Search, settings: Settings, parents: Sequence[Array], rng: np.random.Generator
) -> tuple[Array, Spent]:
    """Ensemble about `parents` after its passes over the recordings, and its mean.

    Parameters
    ----------
    problem : Problem
    search : Search
    settings : Settings
    parents : sequence of ndarray, shape (P,)
        SI, the best first: the filter takes its dead time, which the parameters of the ensemble keep.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (P, members + 1)
        SI.
    Spent
        A pass of a member over the recordings, in pieces, counts as one parameter set.

    Notes
    -----
    The ensemble Kalman filter with perturbed measurements (Burgers, van Leeuwen, Evensen 1998,
    doi:10.1175/1520-0493(1998)126<1719:ASITEK>2.0.CO;2) of the state augmented by the parameters; that a measurement is
    taken in by parts, in several passes, is multiple data assimilation (Emerick, Reynolds 2013,
    doi:10.1016/j.cageo.2012.03.011). States between limits are cut to them after each correction.
    """
    low, high = (search.inward(v)[:, None] for v in (search.low, search.high))
    spread = np.where(search.log[:, None], _SPREAD, _SPREAD_LINEAR * (high - low))
    center = np.stack([search.inward(np.clip(p, search.low, search.high)) for p in parents], axis=1)
    theta = center[:, rng.integers(len(parents), size=_MEMBERS)]
    theta = np.clip(theta + spread * rng.standard_normal(theta.shape), low, high)
    late, dead_time = _dead_time(problem, search, settings, center[:, 0])
    theta[late] = center[late, :1]
    samples = 0
    for worth in _WORTH:
        for number in range(len(problem.recordings)):
            theta, taken = _passed(problem, number, search, settings, theta, late, dead_time, worth, rng)
            samples += taken
    return search.outward(np.column_stack([theta.mean(axis=1), theta])), Spent(_MEMBERS * len(_WORTH), samples)


def _dead_time(problem: Problem, search: Search, settings: Settings, theta: Array) -> tuple[NDArray[np.bool_], float]:
    """Which parameters change the dead time, and the dead time in s."""
    sets = np.column_stack([theta, theta[:, None] + _PERTURBED * np.eye(len(theta))])
    low, high = (search.inward(v)[:, None] for v in (search.low, search.high))
    sets[:, 1:] = np.where(sets[:, 1:] > high, 2.0 * theta[:, None] - sets[:, 1:], sets[:, 1:])
    values = search.named(search.outward(np.clip(sets, low, high)))
    system = system_for(problem.structure, values, problem.recordings[0], settings)
    times = np.broadcast_to(system.dead_time, sets.shape[1])
    return times[1:] != times[0], float(times[0])


def _watched(system: StateSpace, members: int) -> StateSpace:
    """The same without dead time, all states before its outputs."""
    n = len(system.states)
    eye = np.repeat(np.eye(n)[:, :, None], members, axis=2)
    C = np.broadcast_to(system.C if system.C.ndim == 3 else system.C[:, :, None], (len(system.C), n, members))
    D = np.broadcast_to(system.D if system.D.ndim == 3 else system.D[:, :, None], (len(system.D), 1, members))
    return replace(
        system,
        C=np.concatenate([eye, C]),
        D=np.concatenate([np.zeros((n, 1, members)), D]),
        dead_time=0.0 * np.asarray(system.dead_time),
        outputs=(*system.state_names, *system.outputs),
        derivative_rows=(*(-1,) * n, *system.derivative_rows),
    )


def _passed(
    problem: Problem,
    number: int,
    search: Search,
    settings: Settings,
    theta: Array,
    late: NDArray[np.bool_],
    dead_time: float,
    worth: float,
    rng: np.random.Generator,
) -> tuple[Array, int]:
    """The ensemble after one pass over a recording, and the samples that were simulated."""
    r = problem.recordings[number]
    steps = np.arange(r.samples)
    u = np.interp(steps - dead_time / r.dt, steps, r.u)
    low, high = (search.inward(v)[:, None] for v in (search.low, search.high))
    free = ~late[:, None]
    x: Array | None = None
    samples = 0
    length = max(_SHORTEST, -(-(r.samples - 1) // _STRETCHES))
    for begin in range(0, r.samples - 1, length):
        end = min(begin + length, r.samples - 1)
        values = search.named(search.outward(theta))
        system = system_for(problem.structure, values, r, settings)
        if x is None:
            first = problem.onsets[number].state(system, float(u[0]), values)
            x = np.broadcast_to(first, (len(system.states), theta.shape[1]))
        x, y, alive = _stretch(system, r, u, x, begin, end, settings)
        samples += (end - begin + 1) * len(alive)
        if not alive.any():
            return theta, samples
        heirs = np.where(alive, np.arange(len(alive)), rng.choice(np.flatnonzero(alive), len(alive)))
        x, y, theta = x[:, heirs], y[:, heirs], theta[:, heirs]
        y *= np.repeat(problem.weights, end - begin)[:, None]
        wanted = (r.y[:, begin + 1 : end + 1] * problem.weights[:, None]).ravel()
        noise = rng.standard_normal(y.shape)
        noise -= noise.mean(axis=1, keepdims=True)
        x = _within(x + _gain(x, y, 1.0) @ (wanted[:, None] + noise - y), system, heirs)
        change = _gain(theta, y, 1.0 / worth) @ (wanted[:, None] + noise / np.sqrt(worth) - y)
        theta = np.clip(theta + free * change, low, high)
    return theta, samples


def _stretch(
    system: StateSpace, r: Recording, u: Array, x: Array, begin: int, end: int, settings: Settings
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """States at the sample `end`, outputs since the sample `begin`, and which members have not diverged."""
    n, members = x.shape
    both = response(_watched(system, members), u[begin : end + 1], r.dt, x, settings).y
    alive = np.asarray(np.isfinite(both).all(axis=(0, 1)))
    y = both[n:, 1:]
    for out, signal in enumerate(r.outputs):
        if signal.kind == "velocity-differenced":
            y[out] = np.diff(both[n + out], axis=0) / r.dt
    return both[:n, -1], y.reshape(-1, members), alive


def _gain(z: Array, y: Array, noise: float) -> Array:
    """Kalman gain, shape (rows of z, rows of y), from an ensemble; `noise` is the variance of each of `y`."""
    z, y = z - z.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)
    count = y.shape[1] - 1
    spread = y @ y.T / count + noise * np.eye(len(y))
    return np.asarray(np.linalg.solve(spread, y @ z.T / count).T)


def _within(x: Array, system: StateSpace, heirs: NDArray[np.int64]) -> Array:
    """States cut to their limits."""
    for element in system.elements:
        if element.limits is not None:
            low, high = (np.broadcast_to(v, x.shape[1])[heirs] for v in (element.limits.lower, element.limits.upper))
            x[element.limits.state] = np.clip(x[element.limits.state], low, high)
    return x
