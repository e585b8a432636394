"""Assembly of the state-space form from a structure and its parameter values, in the paper's order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, get_args

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Draft, Stage
from brightgrey.errors import SettingsError, one_of
from brightgrey.kit.state_space import StateSpace
from brightgrey.kit.structure import Placed, Structure

__all__ = ["OUTPUTS", "assemble", "slowest_resonance"]

OUTPUTS = ("position", "velocity", "acceleration")
_STAGE_ORDER: tuple[str, ...] = get_args(Stage)
_SELECT_BEFORE = _STAGE_ORDER.index("current control")


def assemble(
    structure: Structure,
    values: Mapping[str, Any],
    f_tanh: float | Array,
    outputs: Sequence[str] = ("velocity",),
    actuator: int = 1,
) -> StateSpace:
    """Assemble the state space of `structure`.

    The order is that of the paper's section 2.2: masses, friction, gravity, backlash, selection of actuator and
    sensors, current control from the left, delay.

    Parameters
    ----------
    structure : Structure
        A legal structure; see :class:`brightgrey.kit.Grammar`.
    values : mapping of str to float or ndarray of shape (K,)
        Parameter values in SI units by name. Arrays give K systems at once.
    f_tanh : float or ndarray of shape (K,)
        Gain of eq. (2) in s/rad (s/m): the inverse of the width of friction's reversal.
    outputs : sequence of str
        ``position``, ``velocity``, ``acceleration`` of mass 1; ``velocity@2`` is that of mass 2.
    actuator : int
        Mass that the input acts on.

    Returns
    -------
    StateSpace

    Raises
    ------
    SettingsError
        If a parameter is missing or unknown, or an output is none of the three. Also if an output or the actuator is
        at a mass that is not there.
    """
    names = structure.parameters
    for name in values:
        if name not in names:
            one_of(f"parameter of '{structure}'", name, names)
    missing = [name for name in names if name not in values]
    if missing:
        raise SettingsError(f"no value for parameter {', '.join(missing)} of '{structure}'")
    sensors = [_sensor(output, structure) for output in outputs]
    if not 1 <= actuator <= structure.masses:
        raise SettingsError(f"actuator at mass {actuator}: '{structure}' has {_masses_of(structure)}")
    given = [np.asarray(values[n], float) for n in names]
    if len({a.shape for a in given}) > 1:
        given = list(np.broadcast_arrays(*given))
    arrays = dict(zip(names, given, strict=True))

    draft = Draft()
    for stage, placed in _in_order(structure):
        if stage >= _SELECT_BEFORE:
            draft = _select_actuator(draft, actuator)
        own = {q.symbol: arrays[placed.parameter(q.symbol)] for q in placed.effect.parameters}
        draft = replace(draft, owner=f"{placed.name}@{placed.place}")
        draft = placed.effect.stamp(draft, placed.place, {**own, "f_tanh": f_tanh})
    return _select_sensors(_select_actuator(draft, actuator), sensors, outputs)


def slowest_resonance(structure: Structure, values: Mapping[str, float]) -> float:
    """Angular frequency in rad/s of the slowest undamped mode in which masses move against each other.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        Parameters by name, SI; others are left out.

    Returns
    -------
    float
        Infinite with one mass.
    """
    n = structure.masses
    if n < 2:
        return float("inf")
    system = assemble(structure, {name: values[name] for name in structure.parameters}, 1.0)
    squares = np.sort(np.linalg.eigvals(-system.A[n : 2 * n, :n]).real)  # states are q, q', ...
    return float(np.sqrt(max(squares[1], 0.0)))  # the first is the motion of all together


@cache
def _in_order(structure: Structure) -> list[tuple[int, Placed]]:
    """Placed effects in the order in which they are stamped, each with the number of its stage."""
    return sorted(((_STAGE_ORDER.index(p.effect.stage), p) for p in structure.placed), key=lambda pair: pair[0])


def _select_actuator(draft: Draft, mass: int) -> Draft:
    """Apply the input selection matrix: the only actuator is at a mass. A second call changes nothing."""
    return draft if draft.B.shape[1] == 1 else replace(draft, B=draft.B[:, mass - 1 : mass])


def _sensor(output: str, structure: Structure) -> tuple[str, int]:
    """Kind and mass of an output such as ``velocity@2``."""
    kind, _, mass = output.partition("@")
    one_of("output", kind, OUTPUTS)
    if mass and not (mass.isdecimal() and 1 <= int(mass) <= structure.masses):
        raise SettingsError(f"output '{output}': '{structure}' has {_masses_of(structure)}")
    return kind, int(mass or 1)


def _masses_of(structure: Structure) -> str:
    return "mass 1 only" if structure.masses == 1 else f"masses 1 to {structure.masses}"


def _select_sensors(draft: Draft, sensors: Sequence[tuple[str, int]], outputs: Sequence[str]) -> StateSpace:
    """Apply the output selection matrix: rows of x, or rows of x' for acceleration, at the sensors' masses.

    Acceleration as a row of x' gives C, D and g of eq. (9), (10), (18) and of backlash step 5 at once. It contains
    friction and gravity, which are missing in the paper's eq. (11).
    """
    n = len(draft.states)
    C = np.zeros((len(outputs), n, *draft.batch))
    D = np.zeros((len(outputs), 1, *draft.batch))
    rows = []
    for out, (kind, mass) in enumerate(sensors):
        if kind == "acceleration":
            row = draft.index(f"v{mass}")
            C[out], D[out] = draft.A[row], draft.B[row]
            rows.append(row)
        else:
            C[out] = draft.unit_row(f"q{mass}" if kind == "position" else f"v{mass}")
            rows.append(-1)
    return StateSpace(
        draft.A, draft.B, C, D, draft.elements, draft.dead_time, draft.states, tuple(outputs), tuple(rows)
    )
