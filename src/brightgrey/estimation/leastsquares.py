"""Bounded least squares on the simulation error, all derivatives from one batch of simulations."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.problem import Problem
from brightgrey.simulation import Settings

__all__ = ["Descent", "descend", "evaluate"]

Array = NDArray[np.float64]
_STEP = 1e-6  # of a forward difference, in the searched scale


class Descent(NamedTuple):
    """Where a descent ended.

    Attributes
    ----------
    values : ndarray, shape (P,)
        SI.
    cost : float
        Sum of squared weighted residuals.
    converged : bool
    evaluations : int
        Batches of simulations.
    residual : ndarray, shape (residuals,)
    jacobian : ndarray, shape (residuals, P)
        Of the residuals by the parameters in the searched scale.
    """

    values: Array
    cost: float
    converged: bool
    evaluations: int
    residual: Array
    jacobian: Array


def evaluate(problem: Problem, search: Search, settings: Settings, theta: Array) -> tuple[Array, Array]:
    """Residuals, shape (residuals,), and Jacobian, shape (residuals, P), at `theta` (searched scale).

    The parameter set itself leads, its neighbours take the same steps (`frozen`), all in one call. Steps go away
    from the nearer bound.
    """
    low, high = search.inward(search.low), search.inward(search.high)
    steps = np.where(theta + _STEP <= high, _STEP, -_STEP)
    steps = np.where((steps < 0) & (theta - _STEP < low), _STEP, steps)
    sets = np.repeat(theta[:, None], len(theta) + 1, axis=1)
    sets[:, 1:] += np.diag(steps)
    outward = np.where(
        search.log[:, None], np.exp(np.where(search.log[:, None], sets, 0.0)), sets * search.width[:, None]
    )
    values = dict(zip(search.names, outward, strict=True)) | {
        k: np.full(sets.shape[1], v) for k, v in search.fixed.items()
    }
    r = problem.residuals(values, settings, frozen=True)
    return r[:, 0], (r[:, 1:] - r[:, :1]) / steps


def descend(problem: Problem, search: Search, settings: Settings, start: Array, *, limit: int = 50) -> Descent:
    """Least squares from `start`, shape (P,), SI values.

    Trust-region reflective method (scipy); `limit` bounds the number of batches.
    """
    if not len(search.names):
        residual, jacobian = evaluate(problem, search, settings, start)
        return Descent(start, float(residual @ residual), True, 1, residual, jacobian)
    known: dict[bytes, tuple[Array, Array]] = {}

    def both(theta: Array) -> tuple[Array, Array]:
        key = theta.tobytes()
        if key not in known:
            known[key] = evaluate(problem, search, settings, theta)
        return known[key]

    part: Callable[[int], Callable[[Array], Array]] = lambda i: lambda theta: both(theta)[i]  # noqa: E731
    low, high = search.inward(search.low), search.inward(search.high)
    margin = 1e-10 * (high - low)
    closed = high <= low  # a range without width: scipy wants low < high
    low, high = np.where(closed, low - 1e-12, low), np.where(closed, high + 1e-12, high)
    theta = np.clip(search.inward(start), low + margin, high - margin)
    found = least_squares(
        part(0), theta, part(1), bounds=(low, high), x_scale="jac", ftol=1e-9, xtol=1e-9, gtol=1e-12, max_nfev=limit
    )
    residual, jacobian = both(found.x)
    cost = float(residual @ residual)
    return Descent(search.outward(found.x), cost, found.status > 0, len(known), residual, jacobian)
