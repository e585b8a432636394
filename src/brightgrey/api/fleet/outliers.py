"""Outliers among equal machines, beyond chance and the scatter of the machines themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brightgrey.arrays import Array

__all__ = ["OUTLIERS", "Compared", "OutlierPolicy", "compare"]


@dataclass(frozen=True)
class OutlierPolicy:
    """Numbers of the comparison of equal machines."""

    chance: float = 0.05  #: That any sibling of a healthy family is called different.
    fewest: int = 4  #: Siblings that can be compared.
    draws: int = 4_000  #: Of healthy families.
    spreads: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 4.0, 1e3)  #: Of the siblings, over their median error.


OUTLIERS = OutlierPolicy()
_MAD_TO_STD = 1.4826  # standard deviation of normal numbers over their median absolute deviation


@dataclass(frozen=True)
class Compared:
    """Comparison of one quantity of all siblings.

    Attributes
    ----------
    deviation : ndarray, shape (siblings,)
        From the median, in units of the siblings' robust spread and the value's own standard deviation together; not a
        number where there is none.
    threshold : float
        That the largest deviation of a healthy family exceeds by chance, with this quantity's part of
        `OutlierPolicy.chance`.
    median : float
    """

    deviation: Array
    threshold: float
    median: float

    @property
    def different(self) -> NDArray[np.bool_]:
        """True for every sibling that differs from the others, shape (siblings,)."""
        return np.abs(self.deviation) > self.threshold


def compare(
    quantities: Mapping[str, tuple[ArrayLike, ArrayLike]], *, chance: float = OUTLIERS.chance, seed: int = 0
) -> dict[str, Compared]:
    """Compare siblings by several quantities.

    The null hypothesis: a quantity is normal over the siblings, and each estimate adds its own normal error. The
    distribution of the largest deviation is drawn under it with the same errors, and with spreads from none to much
    larger than the errors. A few siblings do not tell their own spread, so that the largest threshold counts. The
    chance is divided among the quantities as if they were independent (Sidak 1967,
    doi:10.1080/01621459.1967.10482935).

    Parameters
    ----------
    quantities : mapping of str to (values, stds)
        Each of shape (siblings,); not a number where a sibling has none. What is always positive comes as its
        logarithm.
    chance : float
        Probability that at least one sibling is called different where none is.
    seed : int
        Of the drawing.

    Returns
    -------
    dict of str to Compared
        Of the quantities that at least `OutlierPolicy.fewest` siblings have.
    """
    pairs = {name: _arrays(*pair) for name, pair in quantities.items()}
    usable = {
        name: pair
        for name, pair in pairs.items()
        if np.count_nonzero(np.isfinite(pair[0] + pair[1])) >= OUTLIERS.fewest
    }
    share = 1.0 - (1.0 - chance) ** (1.0 / max(len(usable), 1))
    out = {}
    for number, (name, (x, s)) in enumerate(usable.items()):
        known = np.isfinite(x + s)
        z, median = _deviations(x[known][None, :], s[known])
        deviation = np.full(x.shape, np.nan)
        deviation[known] = z[0]
        limit = _threshold(s[known], share, np.random.default_rng([seed, number]))
        out[name] = Compared(deviation, limit, float(median[0]))
    return out


def _threshold(s: Array, chance: float, rng: np.random.Generator) -> float:
    """Threshold that the largest deviation of siblings with errors `s` exceeds with probability `chance` at most."""
    normal = rng.standard_normal((OUTLIERS.draws, s.size))
    errors = rng.standard_normal((OUTLIERS.draws, s.size)) * s
    size = float(np.median(s)) or 1.0
    limits = []
    for spread in OUTLIERS.spreads:
        largest = np.abs(_deviations(spread * size * normal + errors, s)[0]).max(axis=1)
        limits.append(float(np.quantile(largest, 1.0 - chance)))
    return max(limits)


def _arrays(values: ArrayLike, stds: ArrayLike) -> tuple[Array, Array]:
    return np.asarray(values, np.float64), np.asarray(stds, np.float64)


def _deviations(x: Array, s: Array) -> tuple[Array, Array]:
    """Deviations, shape (families, siblings), and medians, shape (families,), of estimates with errors `s`."""
    median = np.median(x, axis=1)
    apart = x - median[:, None]
    seen = np.square(_MAD_TO_STD * np.median(np.abs(apart), axis=1))
    spread = np.sqrt(np.maximum(seen - np.median(np.square(s)), 0.0))
    tiny = 1e-12 * np.maximum(np.abs(median), 1e-300)
    return apart / np.maximum(np.hypot(spread[:, None], s), tiny[:, None]), median
