"""Normal equations of many starts, computed from the simulated outputs without storing residuals or derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np

from brightgrey.simulation.kernel.machine.compilation import cached

__all__ = ["LARGEST", "add_products", "add_squares"]

LARGEST = 1e6
"""Limit of a weighted residual, so that its square stays finite."""


@cached
def add_products(y: Any, measured: Any, weight: Any, lost: Any, per_step: Any, products: Any) -> None:
    """Add to `products` the sums over samples of the products of residual and derivatives, for each start.

    Parameters
    ----------
    y : ndarray, shape (outputs, samples, starts, 1 + P)
        Simulated outputs of each start and its neighbours.
    measured : ndarray, shape (outputs, samples)
    weight, lost : ndarray, shape (outputs,)
        Inverse of the noise; weighted residual of a simulation that has diverged.
    per_step : ndarray, shape (starts, P)
        Inverse of the distance to each neighbour in the scaled space.
    products : ndarray, shape (starts, 1 + P, 1 + P)
        Changed in place, lower triangles only. Entry (0, 0) is the squared residual, entries (i, 0) are half the
        gradient, and the rest is J' J. Sums run over samples in their order, so they do not depend on the number of
        starts.
    """
    outputs, samples, starts, width = y.shape
    d = np.zeros(width)
    for s in range(starts):
        total = products[s]
        for out in range(outputs):
            for k in range(samples):
                centre = y[out, k, s, 0]
                r = (centre - measured[out, k]) * weight[out]
                d[0] = min(max(r, -LARGEST), LARGEST) if np.isfinite(r) else lost[out]
                for j in range(1, width):
                    slope = (y[out, k, s, j] - centre) * weight[out] * per_step[s, j - 1]
                    d[j] = slope if abs(slope) < np.inf else 0.0
                for i in range(width):
                    a = d[i]
                    for j in range(i + 1):
                        total[i, j] += a * d[j]


@cached
def add_squares(y: Any, measured: Any, weight: Any, lost: Any, squares: Any) -> None:
    """Add to `squares` the sum of squared weighted residuals of each simulation.

    Parameters
    ----------
    y : ndarray, shape (outputs, samples, K)
    measured, weight, lost
        As for `add_products`.
    squares : ndarray, shape (K,)
        Changed in place.
    """
    outputs, samples, sets = y.shape
    for out in range(outputs):
        for k in range(samples):
            for i in range(sets):
                r = (y[out, k, i] - measured[out, k]) * weight[out]
                r = min(max(r, -LARGEST), LARGEST) if np.isfinite(r) else lost[out]
                squares[i] += r * r
