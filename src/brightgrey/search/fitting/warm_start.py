"""Start values for one structure from the optimum of another."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.kit import Structure
from brightgrey.search.lattice import mass_chain_of

__all__ = ["exchanged", "growing_from_zero", "handed_down", "information"]

Values = Mapping[str, float]
_SEEN = 1e-6  # of the largest eigenvalue: the square of the derivatives' relative error


def information(curvature: Array, pace: Array) -> Array:
    """J' J by SI values, shape (P, P), from that by scaled values; `pace` is the derivative of SI by scaled values."""
    scale = np.outer(pace, pace)
    return np.divide(curvature, scale, out=np.zeros_like(curvature), where=scale > 0.0)


def handed_down(
    values: Values, known: Array | None, larger: Structure, structure: Structure, space: ParameterSpace
) -> list[Values]:
    """Project the optimum of a larger structure onto a smaller one.

    Parameters that the smaller one lacks are left out. Further candidates join the masses in every way, if there are
    fewer, and let the remaining effects compensate for those that are removed.

    Parameters
    ----------
    values : mapping of str to float
        Of `larger`, SI, those that were estimated first.
    known : ndarray, shape (P, P), optional
        The `information` of these P.
    larger, structure : Structure
    space : ParameterSpace
        Of `structure`.
    """
    here, there = mass_chain_of(structure), mass_chain_of(larger)
    out = [values]
    if structure.masses < larger.masses and there.effect.search.merge is not None:
        present = {q.symbol: values[there.parameter(q.symbol)] for q in there.effect.parameters}
        joined = there.effect.search.merge(present, structure.masses)
        out += [{**values, **{here.parameter(symbol): v for symbol, v in chain.items()}} for chain in joined]
    if known is not None and np.isfinite(known).all():
        made_up = _made_up(values, known, larger, space)
        out += [{**v, **made_up} for v in out] if made_up else []
    return out


def _made_up(values: Values, known: Array, larger: Structure, space: ParameterSpace) -> Values:
    """Sizes of the remaining effects that compensate for those removed: an Optimal Brain Surgeon step.

    Coulomb friction may have grown with the gravity that it cancels while the motion does not reverse, and a lag takes
    its part of the dead time. Without this step a descent would lead elsewhere. It is the step of Hassibi and Stork
    (1993, eq. 5) within the ranges. Masses, springs and gaps are held: the step is not valid so far from the optimum.
    """
    row = {name: i for i, name in enumerate(list(values)[: len(known)])}
    sizes = [name for name in _sizes(larger) if name in row and known[row[name], row[name]] > 0.0]
    free = {name for name, low, high in zip(space.names, space.low, space.high, strict=True) if low < high}
    names = [name for name in sizes if name in free]
    kept = [row[name] for name in names]
    gone = [row[name] for name in sizes if name not in space.names]
    if not (kept and gone):
        return {}
    value = np.array([values[name] for name in row])
    seen = np.sqrt(np.diag(known)[kept])
    push = known[np.ix_(kept, gone)] @ value[gone] / seen
    own = [space.names.index(name) for name in names]
    low, high = ((limit[own] - value[kept]) * seen for limit in (space.low, space.high))
    step = _lowest(known[np.ix_(kept, kept)] / np.outer(seen, seen), push, np.minimum(low, 0.0), np.maximum(high, 0.0))
    return dict(zip(names, (value[kept] + step / seen).tolist(), strict=True))


def _lowest(H: Array, push: Array, low: Array, high: Array) -> Array:
    """Minimum of ``x' H x / 2 - push' x`` between `low` and `high`, shape (P,)."""
    turning, V = np.linalg.eigh(H)
    followed = turning > _SEEN * turning[-1]
    root = np.sqrt(turning[followed])
    A = root[:, None] * V[:, followed].T
    from scipy.optimize import lsq_linear  # slow to import, and only a search needs it

    found: Array = lsq_linear(A, V[:, followed].T @ push / root, (low, high), method="bvls").x
    return found


def exchanged(values: Values, structure: Structure, held: Collection[str]) -> list[Values]:
    """Start values, SI, in which one other effect of the same unit compensates for each fixed size.

    Coulomb friction cancels gravity exactly while the motion does not reverse, and a lag is nearly a dead time. With a
    rattling gap, derivatives do not show that, since they hold for changes of a ten-thousandth only.
    """
    unit = {p.parameter(q.symbol): q.dimension for p in structure.placed for q in p.effect.parameters}
    sizes = _sizes(structure)
    return [
        {**values, other: values[other] + sign * values[name]}
        for name in sizes
        if name in held
        for other in sizes
        if other not in held and unit[other] == unit[name]
        for sign in (1.0, -1.0)
    ]


def _sizes(structure: Structure) -> list[str]:
    """Parameters at whose zero an effect vanishes, of effects that have neither masses nor a hard limit."""
    beside = [p for p in structure.placed if not (p.effect.masses or p.effect.has_hard_limit)]
    return [p.parameter(q.symbol) for p in beside for q in p.effect.parameters if q.size]


def growing_from_zero(structure: Structure) -> set[str]:
    """Parameters that are zero while their effect is absent: its size, or those of the last mass and its shaft."""
    return {p.parameter(q.symbol) for p in structure.placed for q in p.effect.parameters if q.size or p.effect.masses}
