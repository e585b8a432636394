"""Errors of simulation and sensor that no model can be asked to be better than."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings import Recording

__all__ = ["TRUSTED_ACCURACY", "error_variances"]

TRUSTED_ACCURACY = 1e-4
"""Trusted accuracy of simulation and sensor, as part of an output's standard deviation."""


def error_variances(recordings: Sequence[Recording], weights: Array, share: float = TRUSTED_ACCURACY) -> Array:
    """Weighted variances of errors whose RMS is `share` of the output's standard deviation.

    Shapes (outputs,) of the weights and (recordings, outputs) of the result.
    """
    return np.array([np.square(share * r.y.std(axis=1) * weights) for r in recordings])
