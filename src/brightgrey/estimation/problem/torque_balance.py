"""Balance of torques on a drive whose masses all move as the first: its terms from the motion, without a simulation.

A drive whose shafts are stiff at slow motion is one rigid inertia there. Its input is the inertia times the
acceleration and the torques of its effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import INERTIA
from brightgrey.kit import Placed, Structure, assemble

__all__ = ["inertias", "lags_of", "rigid_torque", "sizes_of", "torque_kinds"]


def inertias(structure: Structure) -> tuple[str, ...]:
    """Names of the inertias of the masses."""
    masses = [p for p in structure.placed if p.effect.masses]
    return tuple(p.parameter(q.symbol) for p in masses for q in p.effect.parameters if q.dimension == INERTIA)


def torque_kinds(structure: Structure) -> list[tuple[Placed, ...]]:
    """Effects that are torques on masses, those of one kind together: a rigid drive does not tell their places."""
    kinds: dict[str, list[Placed]] = {}
    for placed in structure.placed:
        if placed.effect.where == "mass" and any(q.size for q in placed.effect.parameters):
            kinds.setdefault(placed.name, []).append(placed)
    return [tuple(group) for group in kinds.values()]


def sizes_of(group: Sequence[Placed]) -> tuple[str, ...]:
    """Names of the parameters in which the torque of effects of one kind is linear."""
    return tuple(p.parameter(q.symbol) for p in group for q in p.effect.parameters if q.size)


def lags_of(structure: Structure) -> tuple[str, ...]:
    """Names of the parameters that delay the input, in s."""
    return tuple(name for name, declared in structure.parameters.items() if declared.lag)


def rigid_torque(
    structure: Structure,
    group: Sequence[Placed],
    values: Mapping[str, Array],
    position: Array,
    velocity: Array,
    f_tanh: float | Array,
) -> Array:
    """Torque of effects of one kind on a rigid drive.

    Parameters
    ----------
    structure : Structure
    group : sequence of Placed
        Effects of one kind.
    values : mapping of str to ndarray, shape (samples,)
        Parameters at each sample, SI.
    position, velocity : ndarray, shape (samples,)
        Motion of all masses, SI.
    f_tanh : float or ndarray, shape (samples,)
        Gain of the sign of friction in s/rad (s/m).

    Returns
    -------
    ndarray, shape (samples,)
        In N m (N), in the direction of the motion.
    """
    alone = Structure((*(p for p in structure.placed if p.effect.masses), *group))
    own = {name: values[name] for name in alone.parameters}
    system = assemble(alone, own, f_tanh)
    moving = {"position": position, "speed": velocity}
    x = np.array([moving.get(state.at_rest, np.zeros_like(velocity)) for state in system.states])
    rate = np.einsum("ij...,j...->i...", system.A, x)
    for element in system.elements:
        ports = np.einsum("pj...,j...->p...", element.H, x)
        rate += element.G * element.law.value(tuple(ports), element.p)[0]
    rows = [system.state_names.index(f"v{i + 1}") for i in range(structure.masses)]
    return np.asarray(sum(own[name] * rate[row] for name, row in zip(inertias(alone), rows, strict=True)))
