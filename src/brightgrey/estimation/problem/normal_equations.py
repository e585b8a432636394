"""Normal equations of many starts straight from the simulated outputs, without storing residuals or derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np

from brightgrey.simulation.kernel.machine.compilation import cached

__all__ = ["LARGEST", "add_products", "add_squares"]

LARGEST = 1e6  # of a weighted residual: squares stay finite


@cached
def add_products(y: Any, measured: Any, weight: Any, lost: Any, per_step: Any, products: Any) -> None:
    """Add the products of residual and derivatives, summed over samples, of each start.

    Parameters
    ----------
    y : ndarray, shape (outputs, samples, starts, 1 + P)
        Simulated outputs of each start and its neighbours.
    measured : ndarray, shape (outputs, samples)
    weight, lost : ndarray, shape (outputs,)
        1 over the noise; residual of a simulation that has diverged.
    per_step : ndarray, shape (starts, P)
        1 over the distance of each neighbour.
    products : ndarray, shape (starts, 1 + P, 1 + P)
        Lower triangles are added to: row 0 the squared residual, entries (i, 0) the gradient, the rest J' J.
        Sums run over samples in their order, so they do not depend on how many starts there are.
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
    """Add the squared weighted residuals, summed over samples, of each simulation.

    Parameters
    ----------
    y : ndarray, shape (outputs, samples, K)
    measured, weight, lost
        As for `add_products`.
    squares : ndarray, shape (K,)
    """
    outputs, samples, sets = y.shape
    for out in range(outputs):
        for k in range(samples):
            for i in range(sets):
                r = (y[out, k, i] - measured[out, k]) * weight[out]
                r = min(max(r, -LARGEST), LARGEST) if np.isfinite(r) else lost[out]
                squares[i] += r * r
