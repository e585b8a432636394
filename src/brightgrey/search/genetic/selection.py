"""Selection of parents: roulette wheel, and number of clones (paper section 3.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["clone_count", "roulette"]


def roulette(fitness: ArrayLike, rng: np.random.Generator) -> int:
    """Index of one individual, drawn with a probability in proportion to its fitness.

    Parameters
    ----------
    fitness : array_like, shape (individuals,)
        Not negative. If none is positive (every simulation failed), each individual is as likely.
    rng : numpy.random.Generator
    """
    weights = np.asarray(fitness, float)
    largest = weights.max()
    if not largest > 0.0:
        return int(rng.integers(weights.size))
    edges = np.cumsum(weights / largest)
    return int(np.searchsorted(edges, rng.random() * edges[-1], side="right"))


def clone_count(size: int, p_clone: float, rng: np.random.Generator) -> int:
    """Number of individuals that are cloned, N_clone ~ B(size, p_clone)."""
    return int(rng.binomial(size, p_clone))
