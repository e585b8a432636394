"""Controllability and observability: the rank, and the distance to a system of lower rank.

The distance is that to the nearest uncontrollable pair, ``min over s of sigma_min([A - s I, B])`` (Eising 1984,
doi:10.1016/0167-6911(84)90083-8), of the balanced system with A and B of norm 1. Below about 1e-6 a state is lost in
practice. The rank of the controllability matrix is no help: that of a healthy drive with two resonances has a condition
number above 1e12.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import matrix_balance

from brightgrey.arrays import Array
from brightgrey.control.policy import ANALYSIS
from brightgrey.kit import Linear

__all__ = ["Controllability", "controllability", "minimal_realisation", "observability"]


class Controllability(NamedTuple):
    """Rank of the controllable (observable) part, and the distance to a lower rank."""

    #: Dimension of the controllable (observable) part, and of the whole system.
    rank: int
    order: int
    #: Relative distance to the nearest uncontrollable (unobservable) pair; 0 where the rank is below the order.
    distance: float
    nearest_mode: complex  #: Mode in 1/s that is uncontrollable (unobservable) first.

    @property
    def complete(self) -> bool:
        """True if the rank is the order."""
        return self.rank == self.order


def controllability(linear: Linear) -> Controllability:
    """Controllability of the states from the input."""
    return _pair_properties(linear.A, linear.B)


def observability(linear: Linear) -> Controllability:
    """Observability of the states from the outputs."""
    return _pair_properties(linear.A.T, linear.C.T)


def _pair_properties(A: Array, B: Array) -> Controllability:
    n = len(A)
    balanced, scaling = matrix_balance(A, permute=False, separate=True)
    size = float(np.linalg.norm(balanced, 2)) or 1.0
    A1: Array = np.asarray(balanced / size, float)
    B1 = B / scaling[0][:, None]
    norms = np.linalg.norm(B1, axis=0)
    B1 = B1 / np.where(norms > 0.0, norms, 1.0)

    def smallest_singular_value(s: complex) -> float:
        return float(np.linalg.svd(np.hstack([A1 - s * np.eye(n), B1]), compute_uv=False)[-1])

    def distance(p: Array) -> float:
        return smallest_singular_value(complex(p[0], p[1]))

    from scipy.optimize import minimize  # imported here: it takes long, and most analyses never ask

    rank = _krylov_basis(A1, B1).shape[1]
    starts = sorted(np.linalg.eigvals(A1), key=smallest_singular_value)
    if rank < n:
        return Controllability(rank, n, 0.0, complex(starts[0] * size))

    best, nearest = smallest_singular_value(starts[0]), complex(starts[0])
    for start in starts[:2]:
        found = minimize(
            distance,
            np.array([start.real, start.imag]),
            method="Nelder-Mead",
            options={"maxiter": 200},
        )
        if found.fun < best:
            best, nearest = float(found.fun), complex(found.x[0], found.x[1])
    return Controllability(rank, n, best, nearest * size)


def minimal_realisation(linear: Linear) -> Linear:
    """Controllable and observable part of a linear model; its states have no names.

    In an open gap the load coasts: it is a pole at the origin that no feedback to the motor moves.
    """
    A, scaling = matrix_balance(linear.A, permute=False, separate=True)
    B, C = linear.B / scaling[0][:, None], linear.C * scaling[0]
    size = float(np.linalg.norm(A, 2)) or 1.0
    V = _krylov_basis(np.asarray(A / size, float), B / (np.linalg.norm(B, axis=0) + 1e-300))
    A, B, C = V.T @ A @ V, V.T @ B, C @ V
    W = _krylov_basis(np.asarray(A.T / size, float), C.T / (np.linalg.norm(C.T, axis=0) + 1e-300))
    return Linear(W.T @ A @ W, W.T @ B, C @ W, linear.D)


def _krylov_basis(A: Array, B: Array) -> Array:
    """Orthonormal basis of span{B, A B, A² B, ..}, direction by direction (block Arnoldi)."""
    n = len(A)
    basis = np.zeros((n, 0))
    block = B
    while basis.shape[1] < n:
        for _ in range(2):  # twice, against cancellation
            block = block - basis @ (basis.T @ block)
        U, s, _ = np.linalg.svd(block, full_matrices=False)
        new = U[:, s > ANALYSIS.krylov_tolerance]
        if not new.shape[1]:
            break
        basis = np.hstack([basis, new])
        block = A @ new
    return basis[:, :n]
