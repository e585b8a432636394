"""Twist coordinates: the twists of the shafts, and the absolute position only where something depends on it.

If only speeds are measured, the absolute position of a drive is not observable. It would be a pole at the origin that
no velocity controller moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.policy import ANALYSIS
from brightgrey.effects import State
from brightgrey.kit import StateSpace

__all__ = ["TwistModel", "to_twist_coordinates"]


@dataclass(frozen=True)
class TwistModel:
    """A system in twist coordinates ``z = W x``, with the inverse transformation ``x = V z``."""

    #: Transformed system; states ``q1`` (if it is kept), ``twist1``.., ``v1``.., and the others unchanged.
    system: StateSpace
    W: Array  #: Shape (m, n).
    V: Array  #: Without the absolute position mass 1 is at 0, shape (n, m).


def to_twist_coordinates(system: StateSpace, *, keep_position: bool = False) -> TwistModel:
    """Transform `system` to twist coordinates ``twist_k = q_k - q_(k+1)``.

    Parameters
    ----------
    system : StateSpace
        One parameter set or K.
    keep_position : bool
        Keep the absolute position even if no output and no element depends on it.

    Returns
    -------
    TwistModel
    """
    positions = [i for i, state in enumerate(system.states) if state.at_rest == "position"]
    others = [i for i in range(len(system.states)) if i not in positions]
    n = len(system.states)
    shift = np.zeros(n)
    shift[positions] = 1.0
    W = np.zeros((n, n))
    W[0, positions[0]] = 1.0
    for row, (i, j) in enumerate(pairwise(positions), start=1):
        W[row, i], W[row, j] = 1.0, -1.0
    for row, i in enumerate(others, start=len(positions)):
        W[row, i] = 1.0
    V: Array = np.linalg.inv(W).astype(np.float64)
    names = [
        system.states[positions[0]],
        *(replace(system.states[i], name=f"twist{k}", at_rest="zero") for k, i in enumerate(positions[:-1], start=1)),
        *(system.states[i] for i in others),
    ]
    if not keep_position and not _depends_on(system, shift):
        W, V, names = W[1:], V[:, 1:], names[1:]
    return TwistModel(_transform(system, W, V, tuple(names)), W, V)


def _depends_on(system: StateSpace, shift: Array) -> bool:
    """True if anything in `system` depends on a common shift of all masses."""
    rows = [system.A, system.C, *(element.H for element in system.elements)]
    return any(bool(_product(matrix, shift[:, None]).any()) for matrix in rows)


def _product(matrix: Array, V: Array) -> Array:
    """Product of `matrix`, shape (rows, n, ...), and V, shape (n, m), without what is rounding.

    The torques of shafts cancel where all masses move alike. A rest of 1e-16 would be a pole that no output sees.
    """
    product = np.einsum("ij...,jb->ib...", matrix, V)
    terms = np.einsum("ij...,jb->ib...", np.abs(matrix), np.abs(V))
    return np.where(np.abs(product) <= ANALYSIS.rounding * terms, 0.0, product)


def _transform(system: StateSpace, W: Array, V: Array, states: tuple[State, ...]) -> StateSpace:
    names = [state.name for state in states]
    elements = []
    for e in system.elements:
        limits = e.limits and replace(e.limits, state=names.index(system.states[e.limits.state].name))
        elements.append(replace(e, H=_product(e.H, V), G=np.einsum("ki,i...->k...", W, e.G), limits=limits))
    rows = tuple(names.index(system.states[row].name) if row >= 0 else -1 for row in system.derivative_rows)
    return replace(
        system,
        A=np.einsum("ai,ib...->ab...", W, _product(system.A, V)),
        B=np.einsum("ai,ij...->aj...", W, system.B),
        C=_product(system.C, V),
        elements=tuple(elements),
        states=states,
        derivative_rows=rows,
    )
