"""Steps of the Levenberg-Marquardt method in a box, for many starts at once.

Parameters at a bound that the gradient pushes out of the box are held; those that a step would carry out of it
stop at the bound, and the others are solved for once more (projected Newton, Bertsekas 1982,
doi:10.1137/0320018).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array

__all__ = ["NormalEquations", "levenberg_marquardt_step"]

_PASSES = 3
_TINY = 1e-12  # of the largest diagonal entry: what cannot be seen is damped as if it were that much


class NormalEquations(NamedTuple):
    """Cost, shape (S,), half its gradient (S, P), and J' J (S, P, P)."""

    cost: Array
    gradient: Array
    curvature: Array

    def of(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> NormalEquations:
        """Those of some starts, by a mask or by their numbers."""
        return NormalEquations(self.cost[which], self.gradient[which], self.curvature[which])


def levenberg_marquardt_step(
    theta: Array, normal: NormalEquations, scale: Array, damped: Array, low: Array, high: Array, cap: Array
) -> Array:
    """Damped steps, shape (S, P), from `theta`, shape (S, P), that stay in the box.

    Parameters
    ----------
    theta : ndarray, shape (S, P)
    normal : NormalEquations
    scale : ndarray, shape (S, P)
        Largest diagonal of J' J so far: what the damping is relative to.
    damped : ndarray, shape (S,)
    low, high : ndarray, shape (P,)
    cap : ndarray, shape (P,)
        Longest step in each direction; a longer one is shortened as a whole.
    """
    _, g, H = normal
    count = theta.shape[1]
    floor = np.maximum(_TINY * scale.max(axis=1, keepdims=True, initial=0.0), 1e-300)
    diagonal = damped[:, None] * np.maximum(scale, floor)
    held = ((theta <= low) & (g >= 0.0)) | ((theta >= high) & (g <= 0.0)) | (high <= low)
    change = np.zeros_like(theta)
    for _ in range(_PASSES):
        free = ~held
        both = free[:, :, None] & free[:, None, :]
        matrix = np.where(both, H, 0.0)
        matrix[:, range(count), range(count)] += np.where(free, diagonal, 1.0)
        pushed = np.where(held, change, 0.0)
        wanted = np.where(free, -g - np.einsum("sij,sj->si", H, pushed), change)
        solved = _solve(matrix, wanted)
        long = np.max(np.where(free, np.abs(solved) / cap, 0.0), axis=1, initial=1.0)
        solved = np.where(free, solved / long[:, None], solved)
        change = np.clip(solved, low - theta, high - theta)
        out = free & (change != solved)
        if not out.any():
            break
        held = held | out
    return change


def _solve(matrix: Array, wanted: Array) -> Array:
    """Solutions with symmetric scaling; zero where a system has none."""
    size = 1.0 / np.sqrt(np.maximum(np.einsum("sii->si", matrix), 1e-300))
    scaled = matrix * size[:, :, None] * size[:, None, :]
    try:
        found = np.linalg.solve(scaled, (wanted * size)[:, :, None])[:, :, 0] * size
    except np.linalg.LinAlgError:
        found = (np.linalg.pinv(scaled, hermitian=True) @ (wanted * size)[:, :, None])[:, :, 0] * size
    return np.where(np.isfinite(found), found, 0.0)
