"""Estimates of parameters with their intervals, from where a descent ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.leastsquares import Descent
from brightgrey.estimation.uncertainty import spread
from brightgrey.recordings import Recording

__all__ = ["Estimate", "estimates_of"]

_AT_BOUND = 1e-4  # of the searched range


@dataclass(frozen=True)
class Estimate:
    """One parameter in SI: value, standard deviation, 95 % interval, and the bound it ran to."""

    value: float
    std: float
    ci95: tuple[float, float]
    at_bound: Literal["low", "high"] | None


def estimates_of(search: Search, best: Descent, recordings: Sequence[Recording]) -> dict[str, Estimate]:
    """Values with intervals in the searched scale; a parameter at its bound has none, and lends none to others."""
    theta, low, high = (search.inward(v) for v in (best.values, search.low, search.high))
    near = _AT_BOUND * (high - low)
    side = np.where(theta - low <= near, -1, np.where(high - theta <= near, 1, 0))
    inside = np.flatnonzero(side == 0)
    lengths = [r.samples for r in recordings for _ in r.outputs]
    std, quantile = np.full(len(theta), np.nan), np.nan
    if len(inside):
        found = spread(best.residual, best.jacobian[:, inside], lengths)
        std[inside] = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
        quantile = found.quantile
    result = {name: Estimate(value, 0.0, (value, value), None) for name, value in search.fixed.items()}
    for i, name in enumerate(search.names):
        value, s = float(best.values[i]), float(std[i])
        half = quantile * s
        if search.log[i]:
            interval = (value * float(np.exp(-min(half, 700.0))), value * float(np.exp(min(half, 700.0))))
            s *= value
        else:
            half *= float(search.width[i])
            interval = (value - half, value + half)
            s *= float(search.width[i])
        if not np.isfinite(s):
            interval = (np.nan, np.nan)
        at: dict[int, Literal["low", "high"] | None] = {-1: "low", 0: None, 1: "high"}
        result[name] = Estimate(value, s, interval, at[int(side[i])])
    return result
