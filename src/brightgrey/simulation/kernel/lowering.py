"""Lowering of state spaces to the kernel's tables.

Affine laws are added to A and a constant, laws with the same port and column share a channel, and lanes are filled.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.effects import Element
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace
from brightgrey.simulation.kernel.law_dispatch import smooth_laws
from brightgrey.simulation.kernel.machine.buffers import PlantBuffers, plants_for

__all__ = ["Lowered", "Rows", "fastest_natural_frequency", "fill_lanes", "is_sound", "lower", "tabulate"]

Rows = dict[str, Array]
"""Rows of `memory_layout.PlantRows` by name, one column per parameter set."""


class Lowered(NamedTuple):
    """System in the kernel's form, with K parameter sets on the last axis of every matrix.

    ``x' = A x + B u + c + sum_k G_k F_k(H_k x + K_k u)`` with channels k, and integrators with saturation.
    """

    A: Array  #: Shape (n, n, K).
    #: Shape (n, K).
    B: Array
    c: Array
    #: Shape (channels, n, K).
    G: Array
    H: Array
    through: Array  #: K_k of the channels, shape (channels, K).
    smooth: tuple[tuple[Element, int], ...]  #: Elements that are solved for implicitly, each with its channel.
    limited: tuple[Element, ...]  #: Integrators with saturation.
    outputs: tuple[int, ...]  #: i for state i, n + i for its derivative.
    delay: Array  #: Dead time in samples, shape (K,).
    #: State that is the speed which dry friction of a channel stops, and its position (-1: none); -1 where the channel
    #: has no friction or a smoothed one. Shape (channels,).
    stopped: tuple[int, ...]
    held: tuple[int, ...]

    @property
    def dry(self) -> bool:
        """Friction has its exact, set-valued sign."""
        return max(self.stopped, default=-1) >= 0


def lower(system: StateSpace, dt: float) -> Lowered:
    """Sort the elements of `system`; those with affine laws are added to A and a constant.

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
    same = partial(np.array_equal, equal_nan=True)  # a set that is not a number must not change the others' channels
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
            known = (k for k, w in enumerate(channels) if all(map(same, w, wiring)))
            k = next(known, len(channels))
            if k == len(channels):
                channels.append(wiring)
            smooth.append((element, k))
    G, H, through = (np.array(part) for part in zip(*channels, strict=True)) if channels else _nothing(n, sets)
    outputs = tuple(
        n + row if row >= 0 else int(np.argmax(batched(system.C, 2)[out, :, 0]))
        for out, row in enumerate(system.derivative_rows)
    )
    delay = np.maximum(batched(system.dead_time, 0) / dt, 0.0)
    stopped = _stopped(smooth, H[..., 0], through[..., 0])
    held = tuple(_position(A[..., 0], speed) for speed in stopped)
    return Lowered(A, B, c, G, H, through, tuple(smooth), tuple(limited), outputs, delay, stopped, held)


def _stopped(smooth: Sequence[tuple[Element, int]], H: Array, through: Array) -> tuple[int, ...]:
    """Speed that the dry friction of each channel stops, else -1; `H` and `through` are those of one set."""
    states = [-1] * len(H)
    for element, k in smooth:
        if element.has_exact_sign:
            states[k] = int(np.argmax(H[k]))
            if through[k] or np.count_nonzero(H[k]) != 1 or H[k, states[k]] != 1.0:
                raise SettingsError(f"dry friction '{element.name}' has to act at a speed that is a state")
    return tuple(states)


def _position(A: Array, speed: int) -> int:
    """State whose rate is nothing but that speed, else -1."""
    rows = [i for i, row in enumerate(A) if row[speed] == 1.0 and np.count_nonzero(row) == 1]
    return rows[0] if speed >= 0 and rows else -1


def _nothing(n: int, sets: int) -> tuple[Array, Array, Array]:
    return np.zeros((0, n, sets)), np.zeros((0, n, sets)), np.zeros((0, sets))


def fastest_natural_frequency(system: StateSpace, lowered: Lowered) -> Array:
    """Upper bound, shape (K,), of the fastest natural frequency in rad/s.

    It is the square root of Gershgorin's bound for the matrix from positions to accelerations.
    """
    names = system.state_names
    speeds = [i for i, name in enumerate(names) if name.startswith("v")]
    positions = [i for i, name in enumerate(names) if name.startswith("q")]
    block = np.abs(lowered.A[np.ix_(speeds, positions)])
    return np.asarray(np.sqrt(block.sum(axis=1).max(axis=0)))


def tabulate(lowered: Lowered, x0: Array) -> Rows:
    """Numbers of all parameter sets in the rows of the kernel's tables; the initial states `x0` have shape (n, K)."""
    sets = x0.shape[1]
    n = lowered.A.shape[0]
    limits = [e.limits for e in lowered.limited if e.limits is not None]

    def stack(arrays: Sequence[Any], count: int) -> Array:
        full = np.empty((len(arrays), count, sets))
        for part, a in zip(full, arrays, strict=True):
            part[:] = np.asarray(a, float).reshape(count, -1)
        return full.reshape(-1, sets)

    whole = np.floor(lowered.delay)
    return {
        "A": lowered.A.reshape(-1, sets),
        "B": lowered.B,
        "c": lowered.c,
        "G": lowered.G.reshape(-1, sets),
        "H": lowered.H.reshape(-1, sets),
        "K": lowered.through,
        "gain": np.abs(lowered.G).max(axis=1, initial=0.0),
        "p": stack([value for element, k in lowered.smooth for value in _parameters(element, lowered.stopped[k])], 1),
        "rate": stack([e.H[0] for e in lowered.limited], n),
        "column": stack([e.G for e in lowered.limited], n),
        "low": stack([limit.lower for limit in limits], 1),
        "high": stack([limit.upper for limit in limits], 1),
        "delay": np.array([whole, lowered.delay - whole]),
        "x0": x0,
    }


def _parameters(element: Element, stopped: int) -> tuple[Any, ...]:
    """Parameters of a law; dry friction has no use for its infinite gain."""
    dry = stopped >= 0 and element.law.amplitude is not None
    return (*element.p[:-1], 0.0) if dry else tuple(element.p)


def is_sound(rows: Rows) -> NDArray[np.bool_]:
    """Parameter sets, shape (K,), of which all numbers are finite; only limits may be infinitely far away.

    Other sets must not go to the kernel: their series do not converge and would hold up the lanes beside them.
    """
    limits = np.isnan(np.concatenate([rows["low"], rows["high"]])).any(axis=0)
    others = np.isfinite(np.concatenate([a for name, a in rows.items() if name not in ("low", "high")])).all(axis=0)
    return np.asarray(others & ~limits)


def fill_lanes(lowered: Lowered, rows: Rows, pick: NDArray[np.int64]) -> PlantBuffers:
    """Tables of the kernel for the parameter sets ``pick``, shape (batches, LANES); incomplete batches repeat a set.

    `rows` come from `tabulate`: their parameters are in the order of the elements.
    """
    laws = smooth_laws()
    first, turning, row = [], [-1] * len(lowered.G), 0
    for element, k in lowered.smooth:
        first.append(row)
        row += len(element.p)
        if element.law.amplitude is not None:
            turning[k] = row - 1
    numbers = {
        "law": [laws.index(e.law) for e, _ in lowered.smooth],
        "channel": [k for _, k in lowered.smooth],
        "first": first,
        "turning": turning,
        "limited": [e.limits.state for e in lowered.limited if e.limits is not None],
        "stopped": lowered.stopped,
        "held": lowered.held,
        "outputs": lowered.outputs,
    }
    return plants_for(rows, numbers, pick)
