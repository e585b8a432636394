"""What models of the same recordings are compared by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.model.trace import Trace

__all__ = ["bic"]


def bic(traces: Sequence[Trace], n_parameters: int, resolution: Sequence[float]) -> float | None:
    """Bayesian information criterion (Schwarz 1978, doi:10.1214/aos/1176344136), smaller is better.

    ``sum over outputs of n ln(RSS/n) + d ln(N)`` for noise whose size is unknown and different for each
    output; n samples per output, N in all, d parameters. It takes the residuals as white; simulation errors
    seldom are, and then it favours too many parameters. The outputs' units shift it by a constant: compare it
    only between models of the same recordings.

    Parameters
    ----------
    traces : sequence of Trace
        The recordings the model was identified from.
    n_parameters : int
        Number of estimated parameters d.
    resolution : sequence of float
        Smallest step of each output in its unit. RSS counts as no less than that of rounding to it, step²/12
        per sample, so that a perfect fit does not end in -inf.

    Returns
    -------
    float or None
        None if a simulation diverged.
    """
    samples = sum(trace.t.size for trace in traces)
    total = 0.0
    for row, step in enumerate(resolution):
        mean_square = sum(float(np.sum(trace.residual[row] ** 2)) for trace in traces) / samples
        total += samples * float(np.log(max(mean_square, step**2 / 12.0)))
    if not np.isfinite(total):
        return None
    return total + n_parameters * float(np.log(samples * len(resolution)))
