"""What the recordings so far say of a structure: normal equations without what belongs to one recording only."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Structure
from brightgrey.search.fitting.refined_fit import RefinedFits
from brightgrey.search.undecided.question import Known

__all__ = ["eliminated", "of_the_drive"]


def of_the_drive(structure: Structure, values: Mapping[str, float]) -> dict[str, float]:
    """Parameters of a structure and the width of friction's reversal, if there is one, without what a recording has."""
    return {n: float(v) for n, v in values.items() if n in structure.parameters or (n == FRICTION_WIDTH and v > 0.0)}


def eliminated(
    refined: RefinedFits, structure: Structure, values: Mapping[str, float], jacobian: Array, changes: Array
) -> tuple[Known, Array, Array]:
    """Normal equations of a structure, and gradients and products of changes of its residuals, whitened.

    Parameters
    ----------
    refined : RefinedFits
        Of the round.
    structure : Structure
    values : mapping of str to float
        SI, at which the Jacobian was taken.
    jacobian : ndarray, shape (residuals, P)
        Of all that is estimated, as the initial state.
    changes : ndarray, shape (residuals, K)

    Returns
    -------
    known : Known
    gradients : ndarray, shape (K, parameters)
    products : ndarray, shape (K, K)
    """
    space = refined.task.space(structure, nuisances=True)
    J, c = refined.whitening.whiten(jacobian), refined.whitening.whiten(changes)
    H, g = J.T @ J, c.T @ J
    own = np.array([n in structure.parameters or n == FRICTION_WIDTH for n in space.names], bool)
    inverse = np.linalg.pinv(H[np.ix_(~own, ~own)], rcond=1e-12, hermitian=True)
    through = inverse @ H[np.ix_(~own, own)]
    known = Known(
        str(structure),
        of_the_drive(structure, values),
        tuple(n for n, o in zip(space.names, own, strict=True) if o),
        tuple(map(tuple, (H[np.ix_(own, own)] - H[np.ix_(own, ~own)] @ through).tolist())),
    )
    return known, g[:, own] - g[:, ~own] @ through, c.T @ c - g[:, ~own] @ inverse @ g[:, ~own].T
