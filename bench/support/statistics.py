"""Shares with confidence intervals, and the number of independent samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.numerics.proportions import wilson_interval

__all__ = ["effective_samples", "share", "share_of"]


def share(hits: int, count: int, digits: int = 1, *, percent: bool = False) -> str:
    """Write a share with its 95 % Wilson interval, such as ``95 of 100 (88.8 to 97.8 %)``."""
    if not count:
        return "none"
    low, high = (100 * limit for limit in wilson_interval(hits, count))
    value = f" = {100 * hits / count:.{digits}f} %" if percent else ""
    return f"{hits} of {count}{value} ({low:.{digits}f} to {high:.{digits}f} %)"


def share_of(hits: Sequence[bool], digits: int = 0) -> str:
    """Write the share of true values with its 95 % Wilson interval."""
    return share(sum(hits), len(hits), digits)


def effective_samples(residual: Array) -> float:
    """Return how many independent samples estimate a variance as well as this residual.

    It is N / (1 + 2 Σ ρ²) over lags up to a fifth of the samples, and 20 at least.
    """
    n = residual.size
    r = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    c = np.fft.irfft(spectrum)[: n // 5]
    rho = c[1:] / c[0] if c[0] > 0.0 else np.zeros(1)
    return float(max(n / (1.0 + 2.0 * np.sum(np.maximum(rho**2 - 1.0 / n, 0.0))), 20.0))
