"""Where descents begin: given starts, the torque balance, and candidates that are good and unlike each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.problem import Problem
from brightgrey.simulation import Settings

__all__ = ["starting_points"]

Array = NDArray[np.float64]
_PER_PARAMETER = 16  # candidates
_APART = 0.5  # of the median distance between candidates: starts that are unlike each other


def starting_points(
    problem: Problem,
    search: Search,
    settings: Settings,
    given: Sequence[Mapping[str, float]],
    starts: int,
    seed: int,
) -> Array:
    """Starts in SI, shape (P, S): those given, the torque balance's, and the best of many candidates.

    Parameters
    ----------
    problem : Problem
    search : Search
    settings : Settings
    given : sequence of mapping of str to float
        SI; parameters that are not named take their declared start.
    starts : int
        How many there should be. All given ones are taken; without any, the torque balance's is.
    seed : int
        Of the candidates.
    """
    begins = [np.clip([g.get(n, v) for n, v in _declared(search)], search.low, search.high) for g in given]
    if len(begins) < starts or not begins:
        begins.append(search.start)
    missing = starts - len(begins)
    if missing > 0 and search.names:
        candidates = search.candidates(_PER_PARAMETER * (1 + len(search.names)), seed)
        cost = np.square(problem.residuals(search.named(candidates), settings)).sum(axis=0)
        begins += [candidates[:, i] for i in _diverse(search.inward(candidates), cost, missing)]
    return np.stack(begins, axis=1)


def _declared(search: Search) -> list[tuple[str, float]]:
    return list(zip(search.names, search.start.tolist(), strict=True))


def _diverse(theta: Array, cost: Array, count: int) -> list[int]:
    """Numbers of `count` candidates, best first, each some way from all chosen before; `theta` of shape (P, K)."""
    spread = theta.std(axis=1)
    place = (theta / np.where(spread > 0.0, spread, 1.0)[:, None]).T
    apart = np.sqrt(np.square(place[:, None] - place[None]).sum(axis=2))
    order = np.argsort(cost, kind="stable").tolist()
    reach = _APART * float(np.median(apart))
    chosen: list[int] = []
    while len(chosen) < min(count, len(order)):
        for i in order:
            if i not in chosen and all(apart[i, j] > reach for j in chosen):
                chosen.append(i)
        reach = 0.5 * reach if reach > 1e-9 else -1.0
    return chosen[:count]
