"""What follows from several parameters, and how sure it is: the estimates' joint errors carried on."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from brightgrey.arrays import Array
from brightgrey.model.model import Model

__all__ = ["Correlation", "intervals", "parameter_draws"]

Correlation = Mapping[tuple[str, str], float]
LIMIT = 1.959963984540054  # quantile of the normal distribution at 97.5 %
_FAR = 300.0  # in the logarithm: what cannot be told has an interval that no number holds


def parameter_draws(model: Model, correlation: Correlation, count: int) -> dict[str, Array]:
    """Parameter sets from the estimates' joint distribution, within the searched bounds.

    Parameters
    ----------
    model : Model
    correlation : mapping of (str, str) to float
        Of the errors, in the logarithm of what is always positive.
    count : int

    Returns
    -------
    dict of str to ndarray, shape (count,)
        SI, by name; empty if nothing is known of errors.
    """
    names = _known(model, correlation)
    if not names:
        return {}
    size, axes = np.linalg.eigh(_matrix(names, correlation))
    z = np.random.default_rng(model.seed).standard_normal((count, len(names)))
    errors = (z * np.sqrt(np.maximum(size, 0.0))) @ axes.T / LIMIT  # 1 is the end of the 95 % interval
    sets = {name: np.full(count, value) for name, value in model.values_si().items()}
    for name, error in zip(names, errors.T, strict=True):
        sets[name] = _moved(model, name, error)
    return sets


def intervals(
    model: Model, correlation: Correlation, quantities: Callable[[Mapping[str, Array]], Array]
) -> list[tuple[float, float] | None]:
    """95 % intervals of quantities that follow from the parameters, to first order.

    Positive quantities are taken by their logarithm, so that a quantity that is one parameter has its interval.

    Parameters
    ----------
    model : Model
    correlation : mapping of (str, str) to float
    quantities : callable
        ``quantities(sets) -> ndarray, shape (quantities, K)`` from parameter values, SI, each of shape (K,).

    Returns
    -------
    list of (low, high) or None
        None where a quantity depends on nothing that has an interval.
    """
    names = _known(model, correlation)
    count = 2 * len(names) + 1
    sets = {name: np.full(count, value) for name, value in model.values_si().items()}
    for k, name in enumerate(names):
        sets[name][1 + 2 * k : 3 + 2 * k] = _moved(model, name, np.array([1.0, -1.0]))
    R = _matrix(names, correlation)
    out: list[tuple[float, float] | None] = []
    for q in np.asarray(quantities(sets), float):
        log = bool((q > 0.0).all())
        at = np.log(q) if log else q
        change = 0.5 * (at[1::2] - at[2::2])
        half = float(np.sqrt(max(change @ R @ change, 0.0)))
        ends = np.array([at[0] - half, at[0] + half])
        low, high = (np.exp(ends) if log else ends).tolist()
        out.append((low, high) if half > 0.0 and np.isfinite([low, high]).all() else None)
    return out


def _known(model: Model, correlation: Correlation) -> list[str]:
    """Parameters whose errors are known."""
    return [name for name, part in model.parameters.items() if (name, name) in correlation and part.ci95 is not None]


def _matrix(names: list[str], correlation: Correlation) -> Array:
    return np.array([[correlation[a, b] for b in names] for a in names]).reshape(len(names), len(names))


def _moved(model: Model, name: str, error: Array) -> Array:
    """Values, SI, that are off by `error`; 1 is the upper end of the interval."""
    part, declared = model.parameters[name], model.structure.parameters[name]
    assert part.ci95 is not None
    high = part.ci95[1]
    if declared.scale == "log":
        reach = error * np.log(max(high / part.value, 1.0))
        moved = part.value * np.exp(np.clip(reach, -_FAR, _FAR))
    else:
        moved = part.value + error * (high - part.value)
    bounds = model.settings.bounds.get(name, (-np.inf, np.inf))
    return np.asarray(np.clip(moved, *bounds) / model.units.of(declared.dimension)[1])
