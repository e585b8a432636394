"""Response of assembled systems to a sampled input: the interface of the kernel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace
from brightgrey.simulation.kernel.euler_step import euler_step
from brightgrey.simulation.kernel.event_location import locate_events
from brightgrey.simulation.kernel.exponentials import fill_propagator_tables
from brightgrey.simulation.kernel.initial_state import set_initial_state
from brightgrey.simulation.kernel.input_knots import input_knot_weights
from brightgrey.simulation.kernel.loop import run_batch
from brightgrey.simulation.kernel.lowering import (
    Lowered,
    Rows,
    fastest_natural_frequency,
    fill_lanes,
    is_sound,
    lower,
    tabulate,
)
from brightgrey.simulation.kernel.machine.buffers import PlantBuffers, address, aligned, block_for, work_for
from brightgrey.simulation.kernel.machine.memory_layout import Call, Shape
from brightgrey.simulation.kernel.machine.simd import LANES
from brightgrey.simulation.kernel.step_control import accept_or_refine, refine_group, refine_lane
from brightgrey.simulation.kernel.tolerances import TOLERANCES
from brightgrey.simulation.preparation import prepare_kernel
from brightgrey.simulation.settings import Settings, stepping_of, tolerances
from brightgrey.simulation.shared_cores import on_idle_cores

__all__ = ["Response", "parts_per_sample", "response", "squares"]


@dataclass(frozen=True)
class Response:
    """Outputs of K simulations."""

    #: In SI units. From the sample on at which a simulation diverged it is not a number. Shape (outputs, samples, K).
    y: Array
    #: First sample at which the state is not finite or exceeds `Tolerances.diverged`; -1 if there is none. It is
    #: sample 0 for all sets of a group if a number of one of its systems or initial states is not finite. Shape (K,).
    diverged: NDArray[np.int64]
    #: Samples at which sets continued from the state of the set that leads their group, and which sets, shape (R, 2).
    rejoined: NDArray[np.int64]


def response(
    system: StateSpace,
    u: ArrayLike,
    dt: float,
    x0: ArrayLike,
    settings: Settings,
    *,
    group: int = 1,
) -> Response:
    """Simulate K systems of one structure side by side.

    The result of a parameter set never depends on the others (unless `group` says so), nor on the cores that
    :func:`shared_cores` offers. No step has to be chosen: see :class:`Settings`.

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
        ones, so that differences between them are smooth. Forward differences with a relative step of 1e-6 give
        derivatives. With 1, every set chooses its own. Contacts may multiply a difference until it is no derivative
        any more. When a limited state is further than a hundredth of its range from that of the first set at two
        samples in succession, all sets of the group continue from the first one's state.

    Returns
    -------
    Response

    Raises
    ------
    SettingsError
        If the sets do not make whole groups.
    """
    job = _Job.of(system, u, dt, x0, settings)
    sets = job.lowered.A.shape[-1]
    if sets % group:
        raise SettingsError(f"{sets} parameter sets do not make groups of {group}")
    cuts = parts_per_sample(system, job.lowered, dt, settings)[::group]
    sound = is_sound(job.rows).reshape(-1, group).all(axis=1)
    parts = []
    for cut in np.unique(cuts[sound]):
        leaders = np.flatnonzero((cuts == cut) & sound)
        own = (leaders[:, None] * group + np.arange(group)).ravel()
        lanes = _assign_lanes(len(leaders), group)
        parts.append((own, lanes, *_simulate_lanes(job, own, lanes, int(cut))))
    if len(parts) == 1 and sound.all():
        ((_, lanes, y, diverged, _),) = parts
        y, diverged = (y[:, :, :sets] if lanes.in_order else y.take(lanes.place, axis=2)), diverged[lanes.place]
    else:
        y, diverged = np.empty((len(job.lowered.outputs), len(job.u), sets)), np.zeros(sets, np.int64)
        for own, lanes, columns, lost, _ in parts:
            y[:, :, own], diverged[own] = columns[:, :, lanes.place], lost[lanes.place]
    for k in np.flatnonzero(diverged >= 0):
        y[:, diverged[k] :, k] = np.nan
    return Response(y, diverged, np.concatenate([np.empty((0, 2), np.int64), *(part[-1] for part in parts)]))


class _SquaresTarget(NamedTuple):
    """Desired outputs, shape (outputs, samples), their weights (outputs,), and per set a sum and its limit (K,)."""

    outputs: Array
    weights: Array
    sums: Array
    upper_limits: Array


def squares(
    system: StateSpace,
    u: ArrayLike,
    dt: float,
    x0: ArrayLike,
    settings: Settings,
    target: ArrayLike,
    weights: ArrayLike,
    *,
    sums: Array,
    upper_limits: Array,
) -> Array:
    """Sums of squared deviations of K simulations from a target; each is given up when its sum reaches a limit.

    The squares are added sample by sample, so that a sum below its limit does not depend on the limit.

    Parameters
    ----------
    system, u, dt, x0, settings
        As for :func:`response`.
    target : array_like, shape (outputs, samples)
    weights : array_like, shape (outputs,)
        Weights of the squares.
    sums, upper_limits : ndarray, shape (K,)
        Value to which the squares are added, and the limit of the sum.

    Returns
    -------
    ndarray, shape (K,)
        Infinite where the limit was reached or the simulation diverged.
    """
    job = _Job.of(system, u, dt, x0, settings)
    desired = _SquaresTarget(
        np.ascontiguousarray(target, float), np.ascontiguousarray(weights, float), sums, upper_limits
    )
    cuts = parts_per_sample(system, job.lowered, dt, settings)
    sound = is_sound(job.rows)
    total = np.full(len(cuts), np.inf)
    for cut in np.unique(cuts[sound]):
        own = np.flatnonzero((cuts == cut) & sound)
        found, lost, _ = _simulate_lanes(job, own, _assign_lanes(len(own), 1), int(cut), desired)
        total[own] = np.where(lost < 0, found.ravel(), np.inf)[: len(own)]
    return total


def parts_per_sample(system: StateSpace, lowered: Lowered, dt: float, settings: Settings) -> NDArray[np.int64]:
    """Parts of a sample, a power of two: with limits, a fast oscillation must not pass one unseen within a part."""
    if settings.level == "euler":
        return np.full(lowered.A.shape[-1], settings.substeps, np.int64)
    if not lowered.limited:
        return np.ones(lowered.A.shape[-1], np.int64)
    turns = fastest_natural_frequency(system, lowered) * dt / tolerances(settings.level, limits=True).max_angle
    steps = 2 ** np.ceil(np.log2(np.maximum(np.nan_to_num(turns, nan=1.0, posinf=1.0), 1.0)))
    return np.asarray(np.minimum(steps, tolerances(settings.level).max_parts).astype(np.int64))


@dataclass(frozen=True)
class _Job:
    """Systems, input and settings of a call, for all its parameter sets."""

    lowered: Lowered
    rows: Rows
    u: Array
    dt: float
    settings: Settings

    @classmethod
    def of(cls, system: StateSpace, u: ArrayLike, dt: float, x0: ArrayLike, settings: Settings) -> _Job:
        """Lower the system and tabulate its parameter sets."""
        lowered = lower(system, dt)
        start, shape = np.asarray(x0, float), (lowered.A.shape[0], lowered.A.shape[-1])
        if start.shape != shape:
            start = np.broadcast_to(start[:, None] if start.ndim == 1 else start, shape)
        return cls(lowered, tabulate(lowered, start), np.ascontiguousarray(u, float), dt, settings)


def _simulate_lanes(
    job: _Job, sets: NDArray[np.int64], lanes: _LaneAssignment, cut: int, target: _SquaresTarget | None = None
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Simulate parameter `sets` in `lanes`, for all of which a sample is cut in `cut` parts.

    Returns
    -------
    Array
        Outputs, shape (outputs, samples, lanes), or with a target the sums of squares, shape (rows, LANES).
    int ndarray, shape (lanes,)
        Sample at which each lane diverged or was given up, else -1.
    int ndarray, shape (R, 2)
        Samples at which sets rejoined their leaders, and which sets; see `Response.rejoined`.
    """
    pick = sets[lanes.pick]
    shape = _shape_of(job, lanes, cut)
    plants = fill_lanes(job.lowered, job.rows, pick)
    numbers = _call_numbers(job)
    y = aligned((shape.outputs, shape.samples, pick.size) if target is None else pick.shape)
    upper_limits = aligned(pick.shape)
    if target is not None:
        y[:] = target.sums[pick]
        upper_limits[:] = target.upper_limits[pick]
    diverged = np.empty(pick.shape, np.int64)
    led = lanes.width > 1 and shape.limits > 0
    rejoined = np.zeros((len(pick), shape.samples) if led else (0, 0), np.int64)
    call = Call(
        numbers=address(numbers),
        u=address(job.u),
        y=address(y),
        stride=pick.size,
        diverged=address(diverged),
        rejoined=address(rejoined),
        idle=address(lanes.idle),
        target=0 if target is None else address(target.outputs),
        weights=0 if target is None else address(target.weights),
        squares=address(y),
        square_limits=address(upper_limits),
        delayed=0,
        **_entries(steps=shape.euler == 0, grouped=shape.group > 1, delayed=bool(job.lowered.delay.any())),
    )
    _run_batches(shape, plants, call, len(pick))
    row, sample = np.nonzero(rejoined)
    which, lane = np.nonzero(rejoined[row, sample, None] >> np.arange(LANES) & 1)
    return y, diverged.ravel(), np.stack([sample[which], pick[row[which], lane]], axis=1)


def _shape_of(job: _Job, lanes: _LaneAssignment, cut: int) -> Shape:
    """Sizes and options of a call."""
    lowered, settings = job.lowered, job.settings
    level = tolerances(settings.level, bool(lowered.limited))
    stepping = stepping_of(level, cut)
    return Shape(
        n=lowered.A.shape[0],
        channels=lowered.G.shape[0],
        limits=len(lowered.limited),
        elements=len(lowered.smooth),
        outputs=len(lowered.outputs),
        ticks=stepping.ticks,
        base_steps=stepping.base_steps,
        jump=int(level.long_steps),
        points=stepping.points,
        newton=level.newton,
        hold=int(settings.hold == "linear"),
        group=lanes.width,
        samples=len(job.u),
        euler=int(settings.level == "euler"),
        dry=int(lowered.dry),
    )


def _call_numbers(job: _Job) -> Array:
    """Numbers of a call, in the order of `Call.numbers`."""
    scale = job.settings.speed_scale
    level = tolerances(job.settings.level, bool(job.lowered.limited))
    diverged = level.diverged * max(scale, float(np.abs(job.u).max()))
    return np.array([job.dt, level.error * scale, level.change * scale, diverged])


@cache
def _entries(*, steps: bool, grouped: bool, delayed: bool) -> Mapping[str, int]:
    """Addresses of the compiled entries that a call needs; those that it does not need are not loaded."""
    prepare_kernel()
    return {
        "fill_propagator_tables": fill_propagator_tables.address() if steps else 0,
        "input_knot_weights": input_knot_weights.address() if steps and delayed else 0,
        "set_initial_state": set_initial_state.address(),
        "accept_or_refine": accept_or_refine.address() if steps else 0,
        "refine_lane": refine_lane.address() if steps else 0,
        "refine_group": refine_group.address() if steps and grouped else 0,
        "locate_events": locate_events.address() if steps else 0,
        "euler_step": 0 if steps else euler_step.address(),
    }


def _run_batches(shape: Shape, plants: PlantBuffers, call: Call, batches: int) -> None:
    """Run the kernel on all batches, one after the other or also on idle cores."""
    helpers = min(batches, batches * shape.samples // TOLERANCES.least_shared_samples) - 1
    size = 1 if helpers > 0 else batches

    def part(waiting: Iterator[int]) -> None:  # in turn: some batches last longer than others
        work, memory = work_for(shape)
        block = block_for(shape, plants, work, call)
        for first in waiting:
            run_batch(address(block), first, first + size)
        del memory, block  # not before the simulation is done

    on_idle_cores(part, range(0, batches, size), helpers)


class _LaneAssignment(NamedTuple):
    """Assignment of parameter sets to rows of lanes."""

    pick: NDArray[np.int64]  #: Number of the set in each lane, shape (rows, LANES).
    width: int  #: Lanes of a group; the first one leads.
    place: NDArray[np.int64]  #: Lane, counted through all rows, of each set in the order of the sets, shape (sets,).
    idle: NDArray[np.int64]  #: Bits of the lanes whose results are not needed, shape (rows,).
    in_order: bool  #: The first set is in the first lane and so on.


@lru_cache(maxsize=256)
def _assign_lanes(count: int, group: int) -> _LaneAssignment:
    """Assign lanes to `count` groups.

    A group takes the next power of two, or several rows that all begin with its leader. The remaining lanes of a group
    and of the last row repeat a set and are idle.
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
    return _LaneAssignment(pick, width, place, idle, bool(place[-1] == len(place) - 1))
