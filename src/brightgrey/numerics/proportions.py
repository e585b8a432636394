"""Proportions: shares of successes with their intervals."""

from __future__ import annotations

import math

__all__ = ["wilson_interval"]


def wilson_interval(successes: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Confidence interval of a rate (Wilson 1927, doi:10.1080/01621459.1927.10502953).

    Parameters
    ----------
    successes, count : int
    z : float
        Quantile of the normal distribution; 1.96 gives an interval of 95 %.
    """
    rate, share = successes / count, z * z / count
    middle = (rate + 0.5 * share) / (1.0 + share)
    half = z / (1.0 + share) * math.sqrt(rate * (1.0 - rate) / count + 0.25 * share / count)
    return max(0.0, middle - half), min(1.0, middle + half)
