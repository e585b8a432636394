"""Which combinations of parameters a recording leaves open, and how they are written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.effects import Parameter
from brightgrey.estimation.problem.parameter_space import ParameterSpace

__all__ = ["UnidentifiableDirection", "describe", "power_product", "unidentifiable_directions"]

_BLIND = 1e-7  # singular value, relative to the largest, from which a direction cannot be seen
_LOOSE_LOG = 1.0  # standard deviation of a logarithm: the 95 % interval spans a factor of 50
_LOOSE_LINEAR = 0.25  # of the range: the 95 % interval spans it
_HIGHEST, _ROUNDED = 3.0, 0.1  # powers that are worth writing down
_SHARE = 0.1  # of the largest component: what takes part in a combination


@dataclass(frozen=True)
class UnidentifiableDirection:
    """A direction in the searched scale that the recording does not hold.

    Attributes
    ----------
    indices : tuple of int
        Parameters that take part, in the search's order.
    direction : tuple of float
        Their components.
    blind : bool
        Nothing of it is seen; otherwise too little to hold it within a factor of 50 or within its range.
    """

    indices: tuple[int, ...]
    direction: tuple[float, ...]
    blind: bool


def unidentifiable_directions(
    jacobian: Array, covariance: Array, search: ParameterSpace, inside: NDArray[np.intp]
) -> list[UnidentifiableDirection]:
    """Directions that cannot be seen: blind ones by the singular vectors, loose ones by their standard deviation.

    Parameters
    ----------
    jacobian : ndarray, shape (residuals, P)
        By the parameters `inside`, in the searched scale.
    covariance : ndarray, shape (P, P)
        Of the same.
    search : ParameterSpace
    inside : int ndarray, shape (P,)
        Indices of these parameters in the search.
    """
    loose = np.where(search.log[inside], _LOOSE_LOG, _LOOSE_LINEAR)
    size = np.linalg.norm(jacobian, axis=0)
    hidden = size <= _BLIND * np.max(size * loose, initial=0.0) / loose
    found = [UnidentifiableDirection((int(inside[i]),), (1.0,), True) for i in np.flatnonzero(hidden)]
    shown = np.flatnonzero(~hidden)
    if not shown.size:
        return found
    _, s, V = np.linalg.svd(jacobian[:, shown] / size[shown], full_matrices=False)
    blind = [v / size[shown] for v, value in zip(V, s, strict=True) if value <= _BLIND * s[0]]
    directions = [(v, True) for v in blind]
    if not blind:
        variance, vectors = np.linalg.eigh(covariance[np.ix_(shown, shown)] / np.outer(loose[shown], loose[shown]))
        directions = [(loose[shown] * v, False) for value, v in zip(variance, vectors.T, strict=True) if value > 1.0]
    for v, nothing in directions:
        weight = np.abs(v) / loose[shown]
        part = np.flatnonzero(weight >= _SHARE * weight.max())
        found.append(
            UnidentifiableDirection(
                tuple(int(inside[i]) for i in shown[part]), tuple(float(v[i]) for i in part), nothing
            )
        )
    return found


def describe(
    hidden: UnidentifiableDirection, search: ParameterSpace, values: Array, declared: Sequence[Parameter | None]
) -> str:
    """One sentence on what is not seen, and what of it is.

    Parameters
    ----------
    hidden : UnidentifiableDirection
    search : ParameterSpace
    values : ndarray, shape (P,)
        Estimates of all searched parameters, SI.
    declared : sequence of Parameter or None
        Their declarations, where they are parameters of effects.
    """
    names = [search.names[i] for i in hidden.indices]
    listed = ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]
    if len(names) == 1:
        return f"this recording does not show {listed}"
    if len(names) == 2:
        i, j = hidden.indices
        units = [values[k] if search.log[k] else search.width[k] for k in (i, j)]
        step = [v * unit for v, unit in zip(hidden.direction, units, strict=True)]
        one, other = declared[i], declared[j]
        alike = one is not None and other is not None and one.dimension == other.dimension
        if alike and 0.8 < abs(step[0] / step[1]) < 1.25:
            seen = f"{names[0]} {'+' if step[0] * step[1] < 0.0 else '-'} {names[1]}"
            return f"this recording shows {seen}, but not {names[0]} and {names[1]} alone"
        if search.log[i] and search.log[j] and _plain(hidden.direction):
            across = (-hidden.direction[1], hidden.direction[0])
            across = across if across[0] > 0.0 else (-across[0], -across[1])
            return f"this recording shows {power_product(names, across)}, but not {names[0]} and {names[1]} alone"
    if all(search.log[i] for i in hidden.indices) and _plain(hidden.direction):
        product = power_product(names, hidden.direction)
        return f"this recording does not show {product}: {listed} can change together unseen"
    return f"this recording cannot tell {listed} apart"


def _plain(exponents: Sequence[float]) -> bool:
    """Whether these are nearly small powers, in halves, of one another: else a product would say nothing."""
    powers = _powers(exponents)
    sizes = np.abs(np.asarray(exponents, float))
    exact = np.asarray(exponents) / sizes[sizes > _SHARE * sizes.max()].min()
    return bool(np.abs(powers).max() <= _HIGHEST and np.abs(powers - exact).max() <= _ROUNDED)


def _powers(exponents: Sequence[float]) -> Array:
    """Exponents relative to the smallest that counts, rounded to halves."""
    powers = np.asarray(exponents, float)
    sizes = np.abs(powers)
    return np.asarray(np.round(2.0 * powers / sizes[sizes > _SHARE * sizes.max()].min()) / 2.0)


def power_product(names: Sequence[str], exponents: Sequence[float]) -> str:
    """``J1/f_v`` for the exponents 1 and -1: relative to the first one's size, in halves; zeros are left out."""
    powers = _powers(exponents)
    powers = powers if powers[np.flatnonzero(powers)[0]] > 0.0 else -powers

    def part(sign: float) -> list[str]:
        return [
            name if abs(p) == 1.0 else f"{name}^{abs(p):g}"
            for name, p in zip(names, powers, strict=True)
            if p * sign > 0.0
        ]

    above, below = part(1.0), part(-1.0)
    if not below:
        return "·".join(above)
    return "·".join(above) + "/" + ("·".join(below) if len(below) == 1 else f"({'·'.join(below)})")
