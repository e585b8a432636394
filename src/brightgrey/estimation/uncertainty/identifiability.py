"""Directions of the parameter space that a recording does not identify, and their description in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.effects import Parameter
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.uncertainty.options import UNCERTAINTY_DEFAULTS, UncertaintyOptions

__all__ = ["UnidentifiableDirection", "describe", "power_product", "unidentifiable_directions"]


@dataclass(frozen=True)
class UnidentifiableDirection:
    """A direction in the scaled parameter space that the recording does not identify."""

    indices: tuple[int, ...]  #: Parameters that take part, in the order of the space.
    direction: tuple[float, ...]  #: Their components.
    #: True if nothing of it is seen; otherwise its interval is wider than a factor of 50 or than its range.
    blind: bool


def unidentifiable_directions(
    jacobian: Array,
    covariance: Array,
    space: ParameterSpace,
    inside: NDArray[np.intp],
    options: UncertaintyOptions = UNCERTAINTY_DEFAULTS,
) -> list[UnidentifiableDirection]:
    """Find blind directions by singular vectors and, where there are none, loose ones by their standard deviation.

    Parameters
    ----------
    jacobian : ndarray, shape (residuals, P)
        By the parameters `inside`, in the scaled space.
    covariance : ndarray, shape (P, P)
        Of the same parameters.
    space : ParameterSpace
    inside : int ndarray, shape (P,)
        Indices of these parameters in the space.
    options : UncertaintyOptions
    """
    limit = options.blind_singular_value
    loose = np.where(space.log[inside], options.loose_std_log, options.loose_std_linear)
    size = np.linalg.norm(jacobian, axis=0)
    unseen = size <= limit * np.max(size * loose, initial=0.0) / loose
    found = [UnidentifiableDirection((int(inside[i]),), (1.0,), True) for i in np.flatnonzero(unseen)]
    seen = np.flatnonzero(~unseen)
    if not seen.size:
        return found
    _, s, V = np.linalg.svd(jacobian[:, seen] / size[seen], full_matrices=False)
    directions = [(v / size[seen], True) for v, value in zip(V, s, strict=True) if value <= limit * s[0]]
    if not directions:
        variance, vectors = np.linalg.eigh(covariance[np.ix_(seen, seen)] / np.outer(loose[seen], loose[seen]))
        directions = [(loose[seen] * v, False) for value, v in zip(variance, vectors.T, strict=True) if value > 1.0]
    for v, blind in directions:
        weight = np.abs(v) / loose[seen]
        part = np.flatnonzero(weight >= options.participation * weight.max())
        indices, components = (tuple(int(inside[i]) for i in seen[part]), tuple(float(v[i]) for i in part))
        found.append(UnidentifiableDirection(indices, components, blind))
    return found


def describe(
    hidden: UnidentifiableDirection,
    space: ParameterSpace,
    values: Array,
    declared: Sequence[Parameter | None],
    options: UncertaintyOptions = UNCERTAINTY_DEFAULTS,
) -> str:
    """Describe in one sentence which combination of parameters is not identified, and which one is.

    Parameters
    ----------
    hidden : UnidentifiableDirection
    space : ParameterSpace
    values : ndarray, shape (P,)
        Estimates of all parameters of the space, SI.
    declared : sequence of Parameter or None
        Their declarations, where they are parameters of effects.
    options : UncertaintyOptions
    """
    names = [space.names[i] for i in hidden.indices]
    listed = ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]
    if len(names) == 1:
        return f"this recording does not determine {listed}"
    identified = _identified_pair(hidden, space, values, declared, options) if len(names) == 2 else None
    if identified is not None:
        return f"this recording determines {identified}, but not {names[0]} and {names[1]} separately"
    if all(space.log[i] for i in hidden.indices) and _has_simple_powers(hidden.direction, options):
        product = power_product(names, hidden.direction, options)
        return f"this recording does not determine {product}: {listed} can change together without being noticed"
    return f"this recording cannot tell {listed} apart"


def _identified_pair(
    hidden: UnidentifiableDirection,
    space: ParameterSpace,
    values: Array,
    declared: Sequence[Parameter | None],
    options: UncertaintyOptions,
) -> str | None:
    """Sum, difference, product or ratio of two parameters that is identified although they are not, if simple."""
    i, j = hidden.indices
    one, other = space.names[i], space.names[j]
    step = [v * (values[k] if space.log[k] else space.width[k]) for v, k in zip(hidden.direction, (i, j), strict=True)]
    first, second = declared[i], declared[j]
    alike = first is not None and second is not None and first.dimension == second.dimension
    low, high = options.equal_steps
    if alike and low < abs(step[0] / step[1]) < high:
        return f"{one} {'+' if step[0] * step[1] < 0.0 else '-'} {other}"
    if space.log[i] and space.log[j] and _has_simple_powers(hidden.direction, options):
        across = (-hidden.direction[1], hidden.direction[0])
        across = across if across[0] > 0.0 else (-across[0], -across[1])
        return power_product((one, other), across, options)
    return None


def _has_simple_powers(exponents: Sequence[float], options: UncertaintyOptions) -> bool:
    """Test if these are nearly small powers of one another, in halves; otherwise a product would say nothing."""
    powers, exact = _relative_powers(exponents, options)
    return bool(np.abs(powers).max() <= options.max_power and np.abs(powers - exact).max() <= options.power_rounding)


def _relative_powers(exponents: Sequence[float], options: UncertaintyOptions) -> tuple[Array, Array]:
    """Exponents relative to the smallest that takes part, rounded to halves and exact."""
    sizes = np.abs(np.asarray(exponents, float))
    smallest = sizes[sizes > options.participation * sizes.max()].min()
    exact = np.asarray(exponents, float) / smallest
    return np.asarray(np.round(2.0 * np.asarray(exponents, float) / smallest) / 2.0), exact


def power_product(
    names: Sequence[str], exponents: Sequence[float], options: UncertaintyOptions = UNCERTAINTY_DEFAULTS
) -> str:
    """Write a product of powers, ``J1/f_v`` for the exponents 1 and -1.

    Exponents are relative to the smallest, rounded to halves; zeros are left out.
    """
    powers, _ = _relative_powers(exponents, options)
    powers = powers if powers[np.flatnonzero(powers)[0]] > 0.0 else -powers

    def factors(sign: float) -> list[str]:
        return [
            name if abs(p) == 1.0 else f"{name}^{abs(p):g}"
            for name, p in zip(names, powers, strict=True)
            if p * sign > 0.0
        ]

    numerator, denominator = factors(1.0), factors(-1.0)
    if not denominator:
        return "·".join(numerator)
    below = "·".join(denominator) if len(denominator) == 1 else f"({'·'.join(denominator)})"
    return "·".join(numerator) + "/" + below
