"""Whether several recordings agree on the parameters that were fitted to all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from brightgrey.estimation.uncertainty import Spread

__all__ = ["Agreement", "agreement"]

Array = NDArray[np.float64]
_CHANCE = 0.01  # of calling recordings that agree different, over all parameters
_PRIOR = 1e-6  # of the joint information, so that what a recording does not show stays where it is


class Agreement(NamedTuple):
    """Scatter of each parameter between recordings, shape (P,), and whether it is more than chance makes."""

    spread: Array
    apart: NDArray[np.bool_]


def agreement(residual: Array, jacobian: Array, samples: Sequence[int], found: Spread) -> Agreement:
    """What each recording alone would say, one Gauss-Newton step from the joint optimum.

    Parameters
    ----------
    residual : ndarray, shape (residuals,)
    jacobian : ndarray, shape (residuals, P)
    samples : sequence of int
        Residuals per recording, all outputs together.
    found : Spread
        With the middle of the sandwich for every output of every recording.

    Returns
    -------
    Agreement
        The spread is the standard deviation between recordings, each counted by its information. Recordings disagree
        on a parameter if Cochran's Q of the recordings' values is beyond chance (1 % for all parameters together)
        and the spread beyond the joint interval's half.
    """
    count, parameters = len(samples), jacobian.shape[1]
    if count < 2:
        return Agreement(np.full(parameters, np.nan), np.zeros(parameters, bool))
    joint = jacobian.T @ jacobian
    outputs = len(found.meat) // count
    moves, variances = [], []
    for i, (r, J) in enumerate(
        zip(np.split(residual, np.cumsum(samples)[:-1]), np.split(jacobian, np.cumsum(samples)[:-1]), strict=True)
    ):
        inverse = np.linalg.pinv(J.T @ J + _PRIOR * joint, rcond=1e-13, hermitian=True)
        meat = np.sum(found.meat[i * outputs : (i + 1) * outputs], axis=0)
        moves.append(-inverse @ (J.T @ r))
        variances.append(np.maximum(np.diag(inverse @ (meat + _PRIOR * joint) @ inverse), 1e-300))
    move, weight = np.array(moves), 1.0 / np.array(variances)
    middle = (weight * move).sum(axis=0) / weight.sum(axis=0)
    excess = weight * (move - middle) ** 2
    spread = np.sqrt(excess.sum(axis=0) / weight.sum(axis=0) * count / (count - 1))
    half = found.quantile * np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    beyond = excess.sum(axis=0) > chi2.isf(_CHANCE / max(parameters, 1), count - 1)
    return Agreement(spread, beyond & (spread > half))
