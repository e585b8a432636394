"""Clock skew: the time by which one output comes late against the first one, as a nuisance.

It is a fault of the recording and no property of the drive, so it is in no model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.recordings import Recording

__all__ = ["SkewOptions", "skewed", "skews_of"]

_SKEW = "skew"


@dataclass(frozen=True)
class SkewOptions:
    """Range of a clock skew."""

    largest: float = 0.05  #: In parts of the shortest recording.


SKEW_DEFAULTS = SkewOptions()


def skews_of(recordings: Sequence[Recording], options: SkewOptions = SKEW_DEFAULTS) -> tuple[Nuisance, ...]:
    """Skew in s of every output but the first one, the same in all recordings."""
    most = options.largest * min((r.samples - 1) * r.dt for r in recordings)
    later = range(1, len(recordings[0].outputs))
    return tuple(Nuisance(f"{_SKEW}{output}", -most, most, 0.0, sampled=False) for output in later)


def skewed(y: Array, values: Mapping[str, Array], dt: float) -> Array:
    """Delay outputs by the skews among the values.

    Parameters
    ----------
    y : ndarray, shape (outputs, samples, K)
    values : mapping of str to ndarray, shape (K,)
    dt : float
        In s.
    """
    skews = {output: values[f"{_SKEW}{output}"] for output in range(len(y)) if f"{_SKEW}{output}" in values}
    for output, skew in skews.items():
        y[output] = _delayed(y[output], np.broadcast_to(skew, y.shape[2:]) / dt)
    return y


def _delayed(y: Array, delay: Array) -> Array:
    """Signals, shape (samples, K), delayed by a number of samples each, by cubic interpolation (Catmull and Rom).

    Before its first sample a signal is constant; after its last one it goes on in a straight line.
    """
    whole = np.floor(-delay).astype(int)
    x = -delay - whole
    reach = int(np.abs(whole).max()) + 2
    slope, steps = y[-1:] - y[-2:-1], np.arange(1, reach + 1)[:, None]
    longer = np.concatenate([np.repeat(y[:1], reach, axis=0), y, y[-1:] + steps * slope])
    rows = reach + np.arange(len(y))[:, None] + whole
    a, b, c, d = (np.take_along_axis(longer, rows + k, axis=0) for k in (-1, 0, 1, 2))
    rise, slope_b, slope_c = c - b, 0.5 * (c - a), 0.5 * (d - b)
    square, cube = 3.0 * rise - 2.0 * slope_b - slope_c, slope_b + slope_c - 2.0 * rise
    return np.asarray(b + x * (slope_b + x * (square + x * cube)))
