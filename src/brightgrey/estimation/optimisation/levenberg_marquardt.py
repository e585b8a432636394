"""Steps of the Levenberg-Marquardt method within bounds, for many starts at once.

Parameters at a bound that the gradient pushes outwards are held. Those that a step would carry out of the box stop at
the bound, and the others are solved for once more (projected Newton, Bertsekas 1982, doi:10.1137/0320018).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, positive
from brightgrey.estimation.optimisation.options import LM_DEFAULTS, LMOptions

__all__ = ["NormalEquations", "levenberg_marquardt_step"]


class NormalEquations(NamedTuple):
    """Cost, shape (S,), half its gradient (S, P), and J' J (S, P, P)."""

    cost: Array
    gradient: Array
    curvature: Array

    def of(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> NormalEquations:
        """Normal equations of some starts, by a mask or by their indices."""
        return NormalEquations(self.cost[which], self.gradient[which], self.curvature[which])


def levenberg_marquardt_step(
    theta: Array,
    normal: NormalEquations,
    scale: Array,
    damping: Array,
    low: Array,
    high: Array,
    max_step: Array,
    options: LMOptions = LM_DEFAULTS,
) -> Array:
    """Damped steps, shape (S, P), that stay in the box.

    Parameters
    ----------
    theta : ndarray, shape (S, P)
        Where the steps begin.
    normal : NormalEquations
    scale : ndarray, shape (S, P)
        Scale of the damping: about the largest diagonal of J' J so far.
    damping : ndarray, shape (S,)
    low, high : ndarray, shape (P,)
    max_step : ndarray, shape (P,)
        Longest step of each parameter; a longer one is shortened as a whole.
    options : LMOptions
    """
    _, g, H = normal
    count = theta.shape[1]
    floor = positive(options.min_relative_curvature * scale.max(axis=1, keepdims=True, initial=0.0))
    diagonal = damping[:, None] * np.maximum(scale, floor)
    held = ((theta <= low) & (g >= 0.0)) | ((theta >= high) & (g <= 0.0)) | (high <= low)
    step = np.zeros_like(theta)
    for _ in range(options.active_set_passes):
        free = ~held
        both = free[:, :, None] & free[:, None, :]
        matrix = np.where(both, H, 0.0)
        matrix[:, range(count), range(count)] += np.where(free, diagonal, 1.0)
        held_step = np.where(held, step, 0.0)
        right_side = np.where(free, -g - np.einsum("sij,sj->si", H, held_step), step)
        solved = _solve(matrix, right_side)
        excess = np.max(np.where(free, np.abs(solved) / max_step, 0.0), axis=1, initial=1.0)
        solved = np.where(free, solved / excess[:, None], solved)
        step = np.clip(solved, low - theta, high - theta)
        out = free & (step != solved)
        if not out.any():
            break
        held = held | out
    return step


def _solve(matrix: Array, right_side: Array) -> Array:
    """Solutions with symmetric scaling; zero where a system has none."""
    size = 1.0 / np.sqrt(positive(np.einsum("sii->si", matrix)))
    scaled = matrix * size[:, :, None] * size[:, None, :]
    try:
        found = np.linalg.solve(scaled, (right_side * size)[:, :, None])[:, :, 0] * size
    except np.linalg.LinAlgError:
        found = (np.linalg.pinv(scaled, hermitian=True) @ (right_side * size)[:, :, None])[:, :, 0] * size
    return np.where(np.isfinite(found), found, 0.0)
