"""From state spaces to the kernel's tables: straight lines counted to A, equal ports joined, lanes filled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.effects import Element
from brightgrey.kit import StateSpace
from brightgrey.simulation.laws import smooth_laws
from brightgrey.simulation.memory import Plants, plants_for

__all__ = ["Lowered", "lower", "turning_rate"]

Array = NDArray[np.float64]


class Lowered(NamedTuple):
    """System with K parameter sets on the last axis of every matrix, elements sorted by what the kernel does.

    ``x' = A x + B u + c + sum_k G_k F_k(H_k x + K_k u)``; `G`, `H` (channels, n, K), `through` (channels, K).
    `smooth` pairs each law with its channel; `limited` are the integrators with saturation.
    """

    A: Array
    B: Array
    c: Array
    G: Array
    H: Array
    through: Array
    smooth: tuple[tuple[Element, int], ...]
    limited: tuple[Element, ...]
    outputs: tuple[int, ...]
    delay: Array


def lower(system: StateSpace, dt: float) -> Lowered:
    """Sort the elements of `system` and fold those with affine laws into A and a constant.

    Parameters
    ----------
    system : StateSpace
        Single or batch; a single one becomes a batch of one.
    dt : float
        Sampling interval in s: dead time is counted in samples.
    """
    sets = system.batch[0] if system.batch else 1

    def batched(array: Any, lead: int) -> Array:
        a = np.asarray(array, float)
        if a.ndim == lead + 1 and a.shape[-1] == sets:
            return a
        return np.broadcast_to(a.reshape((*a.shape[:lead], -1)), (*a.shape[:lead], sets))

    n = len(system.states)
    A, B = batched(system.A, 2).copy(), batched(system.B[:, 0], 1).copy()
    c = np.zeros((n, sets))
    channels: list[tuple[Array, Array, Array]] = []
    smooth: list[tuple[Element, int]] = []
    limited: list[Element] = []
    for element in system.elements:
        G = batched(element.G, 1)
        if element.limits is not None:
            limited.append(element)
        elif element.law.affine:
            p = tuple(batched(value, 0) for value in element.p)
            phi, slopes = element.law.value((np.zeros(sets),) * element.law.ports, p)
            c += G * phi
            for port, slope in enumerate(slopes):
                A += slope * G[:, None] * batched(element.H, 2)[port]
                B += slope * G * batched(element.K, 1)[port]
        else:
            wiring = (G, batched(element.H, 2)[0], batched(element.K, 1)[0])
            known = (k for k, w in enumerate(channels) if all(map(np.array_equal, w, wiring)))
            k = next(known, len(channels))
            if k == len(channels):
                channels.append(wiring)
            smooth.append((element, k))
    G, H, through = (np.stack(part) for part in zip(*channels, strict=True)) if channels else _nothing(n, sets)
    outputs = tuple(
        n + row if row >= 0 else int(np.argmax(batched(system.C, 2)[out, :, 0]))
        for out, row in enumerate(system.derivative_rows)
    )
    delay = np.maximum(batched(system.dead_time, 0) / dt, 0.0)
    return Lowered(A, B, c, G, H, through, tuple(smooth), tuple(limited), outputs, delay)


def _nothing(n: int, sets: int) -> tuple[Array, Array, Array]:
    return np.zeros((0, n, sets)), np.zeros((0, n, sets)), np.zeros((0, sets))


def turning_rate(system: StateSpace, lowered: Lowered) -> Array:
    """Upper bound, shape (K,), of the fastest oscillation in rad/s: Gershgorin's on speed over position."""
    names = system.state_names
    speeds = [i for i, name in enumerate(names) if name.startswith("v")]
    positions = [i for i, name in enumerate(names) if name.startswith("q")]
    block = np.abs(lowered.A[np.ix_(speeds, positions)])
    return np.asarray(np.sqrt(block.sum(axis=1).max(axis=0)))


def fill(lowered: Lowered, x0: Array, pick: NDArray[np.int64]) -> Plants:
    """Tables of the kernel for the parameter sets ``pick``, shape (batches, LANES).

    Parameters
    ----------
    lowered : Lowered
    x0 : ndarray, shape (n, K)
    pick : int ndarray
        Parameter set of each lane; incomplete batches repeat one.
    """
    sets = x0.shape[1]
    laws = smooth_laws()
    parameters: list[Array] = []
    first = []
    turning = [-1] * len(lowered.G)
    for element, k in lowered.smooth:
        first.append(len(parameters))
        if element.law.amplitude is not None:
            turning[k] = len(parameters) + len(element.p) - 1
        parameters += [np.broadcast_to(np.asarray(value, float), (sets,)) for value in element.p]
    limits = [e.limits for e in lowered.limited if e.limits is not None]

    def stack(arrays: list[Any]) -> Array:
        n = lowered.A.shape[0]
        full = [np.broadcast_to(np.asarray(a, float).reshape((*np.shape(a)[:1], -1)), (n, sets)) for a in arrays]
        return np.stack(full) if full else np.zeros((0, n, sets))

    def bounds(values: list[Any]) -> Array:
        return np.array([np.broadcast_to(np.asarray(v, float), (sets,)) for v in values]).reshape(-1, sets)

    def table(array: Array) -> Array:
        return array.reshape(-1, sets)

    whole = np.floor(lowered.delay)
    tables = {
        "A": table(lowered.A),
        "B": lowered.B,
        "c": lowered.c,
        "G": table(lowered.G),
        "H": table(lowered.H),
        "K": lowered.through,
        "gain": np.abs(lowered.G).max(axis=1, initial=0.0),
        "p": np.array(parameters).reshape(-1, sets),
        "rate": table(stack([e.H[0] for e in lowered.limited])),
        "column": table(stack([e.G for e in lowered.limited])),
        "low": bounds([limit.lower for limit in limits]),
        "high": bounds([limit.upper for limit in limits]),
        "delay": np.stack([whole, lowered.delay - whole]),
        "x0": x0,
    }
    numbers = {
        "law": [laws.index(e.law) for e, _ in lowered.smooth],
        "channel": [k for _, k in lowered.smooth],
        "first": first,
        "turning": turning,
        "limited": [limit.state for limit in limits],
        "outputs": lowered.outputs,
    }
    return plants_for(tables, numbers, pick)
