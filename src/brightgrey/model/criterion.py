"""Information criterion of a model, from its residuals on the recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.model.trace import Trace
from brightgrey.search.criteria import bic

__all__ = ["bic_of_traces"]


def bic_of_traces(traces: Sequence[Trace], n_parameters: int, resolution: Sequence[float]) -> float | None:
    """Bayesian information criterion, smaller is better, see :func:`brightgrey.search.criteria.bic`.

    It takes the residuals as white. Simulation errors seldom are, and then it favours too many parameters. The units of
    the outputs shift it by a constant: compare it only between models of the same recordings.

    Parameters
    ----------
    traces : sequence of Trace
        Recordings that the model was identified from.
    n_parameters : int
        Number of estimated parameters.
    resolution : sequence of float
        Smallest step of each output in its unit. The residual sum of squares counts as no less than that of rounding to
        this step, step²/12 per sample, so that a perfect fit does not end in -inf.

    Returns
    -------
    float or None
        None if a simulation diverged.
    """
    samples = sum(trace.t.size for trace in traces)
    rss = [sum(float(np.sum(trace.residual[row] ** 2)) for trace in traces) for row in range(len(resolution))]
    floored = [max(one, samples * step**2 / 12.0) for one, step in zip(rss, resolution, strict=True)]
    value = bic(floored, samples, n_parameters)
    return value if np.isfinite(value) else None
