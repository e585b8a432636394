"""Response of assembled systems to a sampled input: the face of the kernel."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace
from brightgrey.simulation.kernel.buffers import address, aligned, block_for, work_for
from brightgrey.simulation.kernel.euler_step import euler
from brightgrey.simulation.kernel.event_location import locate_events
from brightgrey.simulation.kernel.exponentials import fill_propagator_tables
from brightgrey.simulation.kernel.initial_state import start
from brightgrey.simulation.kernel.input_knots import input_knot_weights
from brightgrey.simulation.kernel.loop import run_batch
from brightgrey.simulation.kernel.lowering import (
    Lowered,
    Rows,
    fastest_natural_frequency,
    fill,
    is_sound,
    lower,
    tabulate,
)
from brightgrey.simulation.kernel.memory_layout import Call, Shape
from brightgrey.simulation.kernel.simd import LANES
from brightgrey.simulation.kernel.step_control import accept_or_refine, refine_group, refine_lane
from brightgrey.simulation.settings import Settings, stepping_of, tolerances

__all__ = ["Response", "parts_per_sample", "response", "squares"]

_LOST = 1e9  # states this many times larger than input and speed are no motion any more


@dataclass(frozen=True)
class Response:
    """Outputs of K simulations.

    Attributes
    ----------
    y : ndarray, shape (outputs, samples, K)
        In SI units. From the sample on at which a simulation diverged it is not a number.
    diverged : int ndarray, shape (K,)
        First sample at which the state is not finite or beyond all measure, -1 if there is none. Sample 0 for all sets
        of a group if a number of one of its systems or starts is not finite.
    rejoined : int ndarray, shape (R, 2)
        Samples at which sets went on from the state of the set that leads their group, and which sets.
    """

    y: Array
    diverged: NDArray[np.int64]
    rejoined: NDArray[np.int64]


def response(
    system: StateSpace,
    u: ArrayLike,
    dt: float,
    x0: ArrayLike,
    settings: Settings,
    *,
    group: int = 1,
    threads: int = 1,
) -> Response:
    """Simulate K systems of one structure side by side.

    The result of a parameter set never depends on the others (unless `group` says so) nor on the number of
    threads. No step has to be chosen: see :class:`Settings`.

    Parameters
    ----------
    system : StateSpace
        One system, or K of them (:func:`brightgrey.kit.assemble` with arrays).
    u : array_like, shape (samples,)
        Input in SI units; before the first sample it was ``u[0]``.
    dt : float
        Sampling interval in s.
    x0 : array_like, shape (n,) or (n, K)
        Initial state.
    settings : Settings
    group : int
        Sets come in groups of this many. The first set of a group chooses the steps and the others take the same
        ones, so that differences between them are smooth: forward differences with a relative step of 1e-6 give
        derivatives. With 1, every set chooses its own. Where contacts have multiplied a difference until a limited
        state is further than a hundredth of its way from that of the first set, at two samples in succession, the
        differences are no derivatives any more: all sets of the group go on from the state of the first one.
    threads : int

    Returns
    -------
    Response

    Raises
    ------
    SettingsError
        If the sets do not make whole groups.
    """
    u = np.ascontiguousarray(u, float)
    lowered = lower(system, dt)
    sets = lowered.A.shape[-1]
    rows = tabulate(lowered, _starts(lowered, x0))
    if sets % group:
        raise SettingsError(f"{sets} parameter sets do not make groups of {group}")
    cuts = parts_per_sample(system, lowered, dt, settings)[::group]
    sound = is_sound(rows).reshape(-1, group).all(axis=1)
    parts = []
    for cut in np.unique(cuts[sound]):
        leaders = np.flatnonzero((cuts == cut) & sound)
        own = (leaders[:, None] * group + np.arange(group)).ravel()
        lanes = _lanes(len(leaders), group)
        parts.append((own, lanes, *_simulate(lowered, rows, u, dt, settings, own, lanes, threads, int(cut))))
    if len(parts) == 1 and sound.all():
        ((_, lanes, y, diverged, _),) = parts
        y, diverged = (y[:, :, :sets] if lanes.plain else y.take(lanes.place, axis=2)), diverged[lanes.place]
    else:
        y, diverged = np.empty((len(lowered.outputs), len(u), sets)), np.zeros(sets, np.int64)
        for own, lanes, columns, lost, _ in parts:
            y[:, :, own], diverged[own] = columns[:, :, lanes.place], lost[lanes.place]
    for k in np.flatnonzero(diverged >= 0):
        y[:, diverged[k] :, k] = np.nan
    return Response(y, diverged, np.concatenate([np.empty((0, 2), np.int64), *(part[-1] for part in parts)]))


class _Judge(NamedTuple):
    """What outputs should be, shape (outputs, samples), weights (outputs,), and per set squares so far, limit (K,)."""

    target: Array
    weights: Array
    spent: Array
    most: Array


def squares(
    system: StateSpace,
    u: ArrayLike,
    dt: float,
    x0: ArrayLike,
    settings: Settings,
    target: ArrayLike,
    weights: ArrayLike,
    *,
    spent: Array,
    most: Array,
    threads: int = 1,
) -> Array:
    """Sums of squares of what K simulations are off a target, each given up as soon as its sum reaches a limit.

    The squares are summed from sample to sample, so that a sum below its limit is the same whatever the limit.

    Parameters
    ----------
    system, u, dt, x0, settings, threads
        As for :func:`response`.
    target : array_like, shape (outputs, samples)
    weights : array_like, shape (outputs,)
        Of the squares.
    spent, most : ndarray, shape (K,)
        Where each sum begins, and its limit.

    Returns
    -------
    ndarray, shape (K,)
        Infinite where the limit was reached or the simulation diverged.
    """
    u, target = np.ascontiguousarray(u, float), np.ascontiguousarray(target, float)
    judge = _Judge(target, np.ascontiguousarray(weights, float), spent, most)
    lowered = lower(system, dt)
    rows = tabulate(lowered, _starts(lowered, x0))
    cuts = parts_per_sample(system, lowered, dt, settings)
    sound = is_sound(rows)
    total = np.full(len(cuts), np.inf)
    for cut in np.unique(cuts[sound]):
        own = np.flatnonzero((cuts == cut) & sound)
        lanes = _lanes(len(own), 1)
        sums, lost, _ = _simulate(lowered, rows, u, dt, settings, own, lanes, threads, int(cut), judge)
        total[own] = np.where(lost < 0, sums.ravel(), np.inf)[: len(own)]
    return total


def _starts(lowered: Lowered, x0: ArrayLike) -> Array:
    """Initial states, shape (n, K)."""
    start, shape = np.asarray(x0, float), (lowered.A.shape[0], lowered.A.shape[-1])
    return start if start.shape == shape else np.broadcast_to(start[:, None] if start.ndim == 1 else start, shape)


def parts_per_sample(system: StateSpace, lowered: Lowered, dt: float, settings: Settings) -> NDArray[np.int64]:
    """Parts of a sample, a power of two: with limits, a fast oscillation must not swing unseen in a part."""
    if settings.level == "euler":
        return np.full(lowered.A.shape[-1], settings.substeps, np.int64)
    if not lowered.limited:
        return np.ones(lowered.A.shape[-1], np.int64)
    turns = fastest_natural_frequency(system, lowered) * dt / tolerances(settings.level, limits=True).turn
    steps = 2 ** np.ceil(np.log2(np.maximum(np.nan_to_num(turns, nan=1.0, posinf=1.0), 1.0)))
    return np.asarray(np.minimum(steps, tolerances(settings.level).most).astype(np.int64))


def _simulate(
    lowered: Lowered,
    rows: Rows,
    u: Array,
    dt: float,
    settings: Settings,
    sets: NDArray[np.int64],
    lanes: _Lanes,
    threads: int,
    cut: int,
    judge: _Judge | None = None,
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Simulate parameter `sets` in `lanes`, for all of which a sample is cut in `cut` parts.

    Returns outputs, shape (outputs, samples, lanes), or the sums of squares, shape (rows, LANES), of a judge; where
    each diverged or was given up; and which sets rejoined their leaders where (`Response.rejoined`).
    """
    pick = sets[lanes.pick]
    level = tolerances(settings.level, bool(lowered.limited))
    stepping = stepping_of(level, cut)
    shape = Shape(
        n=lowered.A.shape[0],
        channels=lowered.G.shape[0],
        limits=len(lowered.limited),
        elements=len(lowered.smooth),
        outputs=len(lowered.outputs),
        ticks=stepping.ticks,
        base_steps=stepping.base_steps,
        jump=int(level.looks),
        points=stepping.points,
        newton=level.newton,
        hold=int(settings.hold == "linear"),
        group=lanes.width,
        samples=len(u),
        euler=int(settings.level == "euler"),
    )
    plants = fill(lowered, rows, pick)
    scale = settings.speed_scale
    limit = _LOST * max(scale, float(np.abs(u).max()))
    steps = shape.euler == 0
    numbers = np.array([dt, level.error * scale, level.change * scale, limit])
    y = aligned((shape.outputs, len(u), pick.size) if judge is None else pick.shape)
    most = aligned(pick.shape)
    if judge is not None:
        y[:] = judge.spent[pick]
        most[:] = judge.most[pick]
    diverged = np.empty(pick.shape, np.int64)
    led = lanes.width > 1 and shape.limits > 0
    rejoined = np.zeros((len(pick), len(u)) if led else (0, 0), np.int64)
    call = Call(
        numbers=address(numbers),
        u=address(u),
        y=address(y),
        stride=pick.size,
        diverged=address(diverged),
        rejoined=address(rejoined),
        idle=address(lanes.idle),
        target=0 if judge is None else address(judge.target),
        weights=0 if judge is None else address(judge.weights),
        spent=address(y),
        most=address(most),
        delayed=0,
        tables=fill_propagator_tables.address() if steps else 0,
        kinks=input_knot_weights.address() if steps and lowered.delay.any() else 0,
        start=start.address(),
        sort=accept_or_refine.address() if steps else 0,
        refine=refine_lane.address() if steps else 0,
        together=refine_group.address() if steps and lanes.width > 1 else 0,
        creep=locate_events.address() if steps else 0,
        euler=0 if steps else euler.address(),
    )

    def part(first: int, last: int) -> None:
        work, memory = work_for(shape)
        block = block_for(shape, plants, work, call)
        run_batch(address(block), int(first), int(last))
        del memory, block  # not before the simulation is done

    if threads == 1:
        part(0, len(pick))
    else:
        cuts = np.linspace(0, len(pick), min(threads, len(pick)) + 1).astype(int)
        with ThreadPoolExecutor(len(cuts) - 1) as pool:
            list(pool.map(part, cuts[:-1], cuts[1:]))
    row, sample = np.nonzero(rejoined)
    which, lane = np.nonzero(rejoined[row, sample, None] >> np.arange(LANES) & 1)
    return y, diverged.ravel(), np.stack([sample[which], pick[row[which], lane]], axis=1)


class _Lanes(NamedTuple):
    """How parameter sets fill rows of lanes.

    Attributes
    ----------
    pick : int ndarray, shape (rows, LANES)
        Which of the sets is in each lane.
    width : int
        The first lane of every so many leads.
    place : int ndarray, shape (sets,)
        Lane, counted through all rows, of each set in the order of the sets.
    idle : int ndarray, shape (rows,)
        Bits of the lanes that nobody asks for.
    plain : bool
        Whether the first set is in the first lane and so on.
    """

    pick: NDArray[np.int64]
    width: int
    place: NDArray[np.int64]
    idle: NDArray[np.int64]
    plain: bool


@lru_cache(maxsize=256)
def _lanes(count: int, group: int) -> _Lanes:
    """Lanes of `count` groups.

    A group takes the next power of two, or several rows that all begin with its leader. What is left of a group
    and of the last row repeats a set and is idle.
    """
    width = min(1 << (group - 1).bit_length(), LANES)
    rows = max(1, -(-(group - 1) // (LANES - 1))) if width == LANES else 1
    inside = np.zeros((rows, width), np.int64)
    inside[:, 1:] = np.arange(1, rows * (width - 1) + 1).reshape(rows, width - 1)
    others = np.arange(group - 1)
    places = np.append(0, others // max(width - 1, 1) * width + 1 + others % max(width - 1, 1))
    missing = -count % (LANES // width)
    spare = np.append(np.zeros(count, bool), np.ones(missing, bool))[:, None, None] | (inside >= group)
    numbers = np.minimum(np.arange(count + missing), count - 1)
    pick = (numbers[:, None, None] * group + np.minimum(inside, group - 1)).reshape(-1, LANES)
    place = (np.arange(count)[:, None] * (rows * width) + places).ravel()
    idle = spare.reshape(-1, LANES) @ (1 << np.arange(LANES))
    return _Lanes(pick, width, place, idle, bool(place[-1] == len(place) - 1))
