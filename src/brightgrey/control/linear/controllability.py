"""Controllability and observability: the rank, and how close a system is to losing it.

The distance is that to the nearest uncontrollable pair, ``min over s of sigma_min([A - s I, B])`` (Eising 1984,
doi:10.1016/0167-6911(84)90083-8), of the balanced system with A and B of norm 1: 0 is lost, below about 1e-6 is lost in
practice. A rank alone says nothing: the controllability matrix of a healthy drive with two resonances has a
condition beyond 1e12.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import matrix_balance

from brightgrey.arrays import Array
from brightgrey.kit import Linear

__all__ = ["Controllability", "controllability", "minimal_realisation", "observability"]

RANK_TOLERANCE = 1e-10  # what is left of a direction, relative to A, that counts as nothing


class Controllability(NamedTuple):
    """How far input or output reach.

    Attributes
    ----------
    rank, order : int
        Dimension of the controllable (observable) part, and of the whole.
    distance : float
        To the nearest pair that is not controllable (observable), relative; 0 where the rank is lost already.
    where : complex
        Point of the complex plane in 1/s at which it is closest: the mode that escapes first.
    """

    rank: int
    order: int
    distance: float
    nearest_mode: complex

    @property
    def complete(self) -> bool:
        """Whether all states are reached."""
        return self.rank == self.order


def controllability(linear: Linear) -> Controllability:
    """Which states the input reaches."""
    return _pair_properties(linear.A, linear.B)


def observability(linear: Linear) -> Controllability:
    """Which states the outputs show."""
    return _pair_properties(linear.A.T, linear.C.T)


def _pair_properties(A: Array, B: Array) -> Controllability:
    n = len(A)
    balanced, scaling = matrix_balance(A, permute=False, separate=True)
    size = float(np.linalg.norm(balanced, 2)) or 1.0
    A1: Array = np.asarray(balanced / size, float)
    B1 = B / scaling[0][:, None]
    widths = np.linalg.norm(B1, axis=0)
    B1 = B1 / np.where(widths > 0.0, widths, 1.0)

    def smallest(s: complex) -> float:
        return float(np.linalg.svd(np.hstack([A1 - s * np.eye(n), B1]), compute_uv=False)[-1])

    def away(p: Array) -> float:
        return smallest(complex(p[0], p[1]))

    rank = _krylov_basis(A1, B1).shape[1]
    starts = sorted(np.linalg.eigvals(A1), key=smallest)
    if rank < n:
        return Controllability(rank, n, 0.0, complex(starts[0] * size))
    from scipy.optimize import minimize  # slow to import, and an identification does not need it

    best, where = smallest(starts[0]), complex(starts[0])
    for start in starts[:2]:
        found = minimize(
            away,
            np.array([start.real, start.imag]),
            method="Nelder-Mead",
            options={"maxiter": 200},
        )
        if found.fun < best:
            best, where = float(found.fun), complex(found.x[0], found.x[1])
    return Controllability(rank, n, best, where * size)


def minimal_realisation(linear: Linear) -> Linear:
    """Linear model without what the input does not reach or the outputs do not show; its states have no names.

    In an open gap the load coasts on its own: a pole at the origin that no loop over the motor moves and that is no
    matter of its stability.
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
        for _ in range(2):  # once more, against cancellation
            block = block - basis @ (basis.T @ block)
        U, s, _ = np.linalg.svd(block, full_matrices=False)
        fresh = U[:, s > RANK_TOLERANCE]
        if not fresh.shape[1]:
            break
        basis = np.hstack([basis, fresh])
        block = A @ fresh
    return basis[:, :n]
