"""Drift: a torque that grows evenly over a recording and is zero in the mean, as a nuisance.

Friction that warms up, a sensor or a load that changes slowly: on real axes the balance of torque drifts. A model
without drift follows it by a soft shaft or a spring, which are not there. So long recordings have a drift each, in
every structure that a search compares. It is no property of the drive and is in no model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import TORQUE, Element, Law, State
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.kit import StateSpace
from brightgrey.recordings import Recording

__all__ = ["DRIFT", "DriftOptions", "drift_in", "drifts_of", "with_drift"]

DRIFT = "drift"
"""Name of the torque by which a recording's end is above its middle; recordings of several have a tag behind it."""


@dataclass(frozen=True)
class DriftOptions:
    """Recordings that have a drift, and its range."""

    shortest: float = 5.0  #: Duration in s from which a recording has one.
    largest: float = 0.2  #: In parts of the largest input.


DRIFT_DEFAULTS = DriftOptions()


def _drift_nuisance(recording: Recording, tag: str, options: DriftOptions) -> Nuisance | None:
    """Drift of a recording; None if it is short."""
    if (recording.samples - 1) * recording.dt < options.shortest:
        return None
    most = options.largest * float(np.abs(recording.u).max())
    return Nuisance(f"{DRIFT}{tag}", -most, most, 0.0, sampled=False) if most > 0.0 else None


def _rate(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    return p[0], ()


_RATE_LAW = Law(("rate",), _rate, ports=0, affine=True)


def with_drift(system: StateSpace, x0: Array, torque: Array, duration: float) -> tuple[StateSpace, Array]:
    """Add a torque from ``-torque`` to ``torque`` to the input of a system, and the state that holds it.

    Parameters
    ----------
    system : StateSpace
    x0 : ndarray, shape (n, K) or (n, 1)
        Initial states.
    torque : ndarray, shape (K,)
    duration : float
        In s.

    Returns
    -------
    StateSpace, ndarray
        With one more state.
    """
    n, sets = len(system.states), torque.size

    def batched(matrix: Array, rows: int, columns: int) -> Array:
        out = np.zeros((rows, columns, sets))
        whole = matrix if matrix.ndim == 3 else matrix[..., None]
        out[: matrix.shape[0], : matrix.shape[1]] = whole
        return out

    A, B = batched(system.A, n + 1, n + 1), batched(system.B, n + 1, 1)
    C, D = batched(system.C, len(system.outputs), n + 1), batched(system.D, len(system.outputs), 1)
    A[:, n], C[:, n] = B[:, 0], D[:, 0]
    column = np.zeros((n + 1, sets))
    column[n] = 1.0
    nothing = np.zeros((0, n + 1, sets)), np.zeros((0, sets))
    ramp = Element(DRIFT, _RATE_LAW, *nothing, column, (2.0 * torque / duration,))
    elements = (*(e.with_state() for e in system.elements), ramp)
    states = (*system.states, State(DRIFT, TORQUE, "zero"))
    start = np.concatenate([np.broadcast_to(x0, (n, sets)), -torque[None, :]])
    return replace(system, A=A, B=B, C=C, D=D, elements=elements, states=states), start


def drifts_of(
    recordings: Sequence[Recording], tags: Sequence[str], options: DriftOptions = DRIFT_DEFAULTS
) -> tuple[Nuisance, ...]:
    """Drifts of those recordings that are long enough."""
    found = (_drift_nuisance(r, tag, options) for r, tag in zip(recordings, tags, strict=True))
    return tuple(d for d in found if d is not None)


def drift_in(values: Mapping[str, Array], tag: str) -> Array | None:
    """Drift of a recording among the values, shape (K,); None if there is none."""
    found = values.get(f"{DRIFT}{tag}")
    return None if found is None else np.atleast_1d(np.asarray(found, float))
