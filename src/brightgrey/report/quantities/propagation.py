"""Propagation of the estimates' joint errors to quantities that follow from several parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from brightgrey.arrays import Array
from brightgrey.model.model import Model
from brightgrey.report.quantities.assembled_model import AssembledModel

__all__ = ["Correlation", "intervals", "parameter_draws"]

Correlation = Mapping[tuple[str, str], float]
Z_95 = 1.959963984540054
"""Quantile of the normal distribution at 97.5 %."""
_MAX_LOG_ERROR = 300.0  # keeps the values of a parameter that is not identifiable within double precision


def parameter_draws(assembled: AssembledModel, correlation: Correlation, count: int) -> dict[str, Array]:
    """Parameter sets from the estimates' joint distribution, within the searched bounds.

    Parameters
    ----------
    assembled : AssembledModel
    correlation : mapping of (str, str) to float
        Of the errors; positive parameters count by their logarithm.
    count : int

    Returns
    -------
    dict of str to ndarray, shape (count,)
        SI, by name; empty if no errors are known.
    """
    names = _with_errors(assembled.model, correlation)
    if not names:
        return {}
    size, axes = np.linalg.eigh(_correlation_matrix(names, correlation))
    z = np.random.default_rng(assembled.model.seed).standard_normal((count, len(names)))
    errors = (z * np.sqrt(np.maximum(size, 0.0))) @ axes.T / Z_95  # 1 is the end of the 95 % interval
    sets = {name: np.full(count, value) for name, value in assembled.values.items()}
    for name, error in zip(names, errors.T, strict=True):
        sets[name] = _at_error(assembled.model, name, error)
    return sets


def intervals(
    assembled: AssembledModel, correlation: Correlation, quantities: Callable[[Mapping[str, Array]], Array]
) -> list[tuple[float, float] | None]:
    """95 % intervals of quantities that follow from the parameters, to first order.

    Positive quantities are taken by their logarithm, so that a quantity that is one parameter has its interval.

    Parameters
    ----------
    assembled : AssembledModel
    correlation : mapping of (str, str) to float
    quantities : callable
        ``quantities(sets) -> ndarray, shape (quantities, K)`` from parameter values, SI, each of shape (K,).

    Returns
    -------
    list of (low, high) or None
        None where a quantity depends on nothing that has an interval.
    """
    names = _with_errors(assembled.model, correlation)
    count = 2 * len(names) + 1
    sets = {name: np.full(count, value) for name, value in assembled.values.items()}
    for k, name in enumerate(names):
        sets[name][1 + 2 * k : 3 + 2 * k] = _at_error(assembled.model, name, np.array([1.0, -1.0]))
    R = _correlation_matrix(names, correlation)
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


def _with_errors(model: Model, correlation: Correlation) -> list[str]:
    """Parameters whose errors are known."""
    return [name for name, part in model.parameters.items() if (name, name) in correlation and part.ci95 is not None]


def _correlation_matrix(names: list[str], correlation: Correlation) -> Array:
    return np.array([[correlation[a, b] for b in names] for a in names]).reshape(len(names), len(names))


def _at_error(model: Model, name: str, error: Array) -> Array:
    """Values, SI, at an error in units of the half interval: 1 is its upper end."""
    part, declared = model.parameters[name], model.structure.parameters[name]
    assert part.ci95 is not None
    low, high = part.ci95
    if declared.scale == "log" and low == 0.0:  # a size that may be zero as well
        moved = np.maximum(part.value + error * (high - part.value), 0.0)
    elif declared.scale == "log":
        reach = error * np.log(max(high / part.value, 1.0))
        moved = part.value * np.exp(np.clip(reach, -_MAX_LOG_ERROR, _MAX_LOG_ERROR))
    else:
        moved = part.value + error * (high - part.value)
    bounds = model.settings.bounds.get(name, (-np.inf, np.inf))
    return np.asarray(np.clip(moved, *bounds) / model.units.of(declared.dimension)[1])
