"""Orthonormal basis of the columns of a matrix, such as a Jacobian."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array

__all__ = ["BASIS_RANK_TOLERANCE", "beyond", "orthonormal_basis"]

BASIS_RANK_TOLERANCE = 1e-9
"""Singular values of normed columns below this part of the largest count as zero."""


def orthonormal_basis(columns: Array, rank_tolerance: float = BASIS_RANK_TOLERANCE) -> Array:
    """Orthonormal basis of the space of the columns, shape (rows, rank), by a singular value decomposition.

    Parameters
    ----------
    columns : ndarray, shape (rows, P)
        Each is scaled to norm 1 first; columns of zeros are left out.
    rank_tolerance : float
        Singular values below this part of the largest count as zero.
    """
    size = np.linalg.norm(columns, axis=0)
    nonzero = size > 0.0
    if not nonzero.any():
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(columns[:, nonzero] / size[nonzero], full_matrices=False)
    return np.asarray(U[:, s > rank_tolerance * s[0]])


def beyond(basis: Array, x: Array) -> Array:
    """Part of `x`, shape (rows, ...), that is orthogonal to an orthonormal `basis`, shape (rows, rank)."""
    return np.asarray(x - basis @ (basis.T @ x))
