"""Start points of fits: given ones, diverse candidates and perturbed optima."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.options import START_POINT_DEFAULTS, StartPointOptions
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import Structure
from brightgrey.simulation import Settings

__all__ = [
    "best_diverse",
    "given_starts",
    "perturbed_starts",
    "torque_rows",
]


def given_starts(space: ParameterSpace, given: Sequence[Mapping[str, float]]) -> list[Array]:
    """Given starts in SI, each of shape (P,); parameters that are not named take their declared start value."""
    declared = list(zip(space.names, space.start.tolist(), strict=True))
    return [space.clip(np.array([start.get(name, value) for name, value in declared])) for start in given]


def best_diverse(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    candidates: Array,
    count: int,
    options: StartPointOptions = START_POINT_DEFAULTS,
) -> list[Array]:
    """Choose the best `count` of the candidates, shape (P, K) in SI, each at some distance from all better ones."""
    cost = problem.costs(space.named(candidates), settings)
    chosen = _diverse(space.to_scaled(candidates), cost, count, options.min_distance)
    return [candidates[:, i] for i in chosen]


def perturbed_starts(
    space: ParameterSpace,
    parents: Sequence[Array],
    fresh: Array,
    rng: np.random.Generator,
    torques: Sequence[int] = (),
    options: StartPointOptions = START_POINT_DEFAULTS,
) -> Array:
    """Perturb optima: sample some parameters anew, or exchange the roles of parts, and shift all others a little.

    The torques at the masses share what they explain. So all of them are sampled anew together in a part of the copies.

    Parameters
    ----------
    space : ParameterSpace
    parents : sequence of ndarray, shape (P,)
        SI, best first; each is taken twice as often as the next one.
    fresh : ndarray, shape (P, K)
        Samples from which the parameters that are sampled anew are taken.
    rng : numpy.random.Generator
    torques : sequence of int
        Rows of the torques at the masses, see `torque_rows`.
    options : StartPointOptions

    Returns
    -------
    ndarray, shape (P, K)
        SI.
    """
    count = fresh.shape[1]
    low, high = (bound[:, None] for bound in space.box)
    share = 0.5 ** np.arange(len(parents))
    chosen = rng.choice(len(parents), count, p=share / share.sum())
    parent = np.stack(parents, axis=1)[:, chosen]
    exchanged: NDArray[np.bool_] = np.zeros(count, np.bool_)
    for block in space.blocks:
        if block.hints.perturb is not None:
            exchanged = np.less(rng.random(count), options.exchanged_share)
            rows = np.array(block.rows)[:, None]
            share, any_frequency = rng.random((len(rows), exchanged.sum())), np.full(exchanged.sum(), np.nan)
            parent[rows, exchanged] = block.hints.perturb(parent[rows, exchanged], share, any_frequency)
    theta = np.clip(space.to_scaled(space.clip(parent)), low, high)
    shift = rng.choice(options.shifts, count) * rng.standard_normal(theta.shape)
    near = np.clip(theta + np.where(space.log[:, None], shift, options.linear_shift * shift), low, high)
    rank = rng.random(theta.shape).argsort(axis=0)
    redrawn = rank < np.where(exchanged, 0, rng.choice([*options.redrawn, len(theta) // 2], count))
    if torques:
        together: NDArray[np.bool_] = np.zeros(theta.shape, np.bool_)
        together[list(torques)] = True
        redrawn = np.where(np.less(rng.random(count), options.redrawn_torques), together, redrawn)
    return space.from_scaled(np.where(redrawn, space.to_scaled(fresh), near))


def torque_rows(structure: Structure, space: ParameterSpace) -> list[int]:
    """Rows of the parameters of all torques at the masses, and of the width in which friction reverses."""
    placed = (p for p in structure.beside if p.effect.where == "mass")
    names = {FRICTION_WIDTH, *(p.parameter(q.symbol) for p in placed for q in p.effect.parameters)}
    return [i for i, name in enumerate(space.names) if name in names]


def _diverse(theta: Array, cost: Array, count: int, min_distance: float) -> list[int]:
    """Indices of `count` candidates, best first, each at some distance from those before; `theta` of shape (P, K)."""
    spread = theta.std(axis=1)
    place = (theta / np.where(spread > 0.0, spread, 1.0)[:, None]).T
    order = np.argsort(cost, kind="stable")
    place = place[order]
    distance = np.sqrt(np.maximum(np.square(place[:, None] - place[None]).sum(axis=2), 0.0))
    required = min_distance * float(np.median(distance))
    chosen: list[int] = []
    nearest = np.full(len(order), np.inf)
    while len(chosen) < min(count, len(order)):
        for i in range(len(order)):
            if nearest[i] > required and len(chosen) < count:
                chosen.append(i)
                nearest = np.minimum(nearest, distance[i])
                nearest[i] = -np.inf
        required = 0.5 * required if required > 1e-9 else -1.0  # equal candidates are apart by rounding only
    return [int(order[i]) for i in chosen]
