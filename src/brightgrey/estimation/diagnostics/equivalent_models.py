"""Equivalent models: a lag of the input and a real pole of a linear drive may change places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.diagnostics.options import EXCHANGE_DEFAULTS, ExchangeOptions
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.identifiability import power_product
from brightgrey.kit import Structure, assemble
from brightgrey.kit.structure import Placed
from brightgrey.simulation import Settings

__all__ = ["resolve_lag_pole_exchange"]


def resolve_lag_pole_exchange(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    options: ExchangeOptions = EXCHANGE_DEFAULTS,
) -> tuple[OptimumWithJacobian, list[Finding]]:
    """Choose the shorter lag of two parameter sets with the same response, and report the other one.

    The order of two first-order lags in series has no effect on the response. Where an effect's only parameter is a lag
    with a state of its own, and all laws are linear, each real pole of the drive is tried as that lag. The other
    parameters are estimated again with the lag fixed. If the cost is the same within the noise, both models are
    equivalent. The time constant of the pole is written as a product of powers.

    Returns
    -------
    best : OptimumWithJacobian
        The given one, or the equivalent one if that has the shorter lag and lies within the bounds.
    findings : list of Finding
    """
    structure = problem.structure
    linear = all(p.effect.law is None or (p.effect.law.affine and p.effect.law.ports) for p in structure.placed)
    lags = [p for p in structure.placed if p.effect.has_states and [q.lag for q in p.effect.parameters] == [True]]
    if not linear or structure.has_hard_limit:
        return best, []
    for placed in lags:
        name = placed.parameter(placed.effect.parameters[0].symbol)
        if name in space.names:
            return _exchange(problem, space, settings, best, placed, name, options)
    return best, []


def _exchange(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    lag: Placed,
    name: str,
    options: ExchangeOptions,
) -> tuple[OptimumWithJacobian, list[Finding]]:
    """Try each real pole of the drive without `lag`, whose parameter is `name`, as that lag."""
    values = space.by_name(best.values)
    plant = Structure(tuple(p for p in problem.structure.placed if p != lag))
    free = [n for n in plant.parameters if n in space.names and plant.parameters[n].scale == "log"]
    tolerance = options.cost_tolerance * best.cost / max(len(best.residual), 1)
    for k in range(len(_time_constants(plant, values, settings.f_tanh))):
        powers, constant = _pole_powers(plant, values, settings.f_tanh, k, free, options)
        by_name = dict(zip(free, powers, strict=True))
        other = _fit_with_lag(problem, space, settings, values, name, constant, by_name, options)
        if other is None or other.cost > best.cost + tolerance:
            continue
        taking_part = [n for n in free if abs(by_name[n]) > options.min_power]
        product = power_product(taking_part, [float(by_name[n]) for n in taking_part])
        inside = np.all((other.values >= space.low) & (other.values <= space.high))
        keep, alternative = (best, other) if values[name] <= constant or not inside else (other, best)
        values_of_other = _differing_values(space, keep, alternative, options)
        text = f"{name} and {product} can be exchanged: {values_of_other} (SI) fits as well"
        if keep is other:
            found = fit_to_convergence(problem, space, settings, other.values)
            keep = found if found.cost <= other.cost + tolerance else best
        return keep, [Finding("equivalent model", text, (name, *taking_part))]
    return best, []


def _differing_values(
    space: ParameterSpace, kept: OptimumWithJacobian, alternative: OptimumWithJacobian, options: ExchangeOptions
) -> str:
    """List the values of the alternative that differ from those that are kept."""
    values = zip(space.names, kept.values.tolist(), alternative.values.tolist(), strict=True)
    return ", ".join(f"{n} = {v:.4g}" for n, own, v in values if abs(v - own) > options.different_value * abs(own))


def _time_constants(plant: Structure, values: dict[str, float], f_tanh: float) -> Array:
    """Time constants in s of the real decaying poles, the slowest first."""
    system = assemble(plant, {n: values[n] for n in plant.parameters}, f_tanh)
    poles = np.linalg.eigvals(system.linearise(np.zeros(len(system.states))).A)
    size = np.abs(poles).max(initial=0.0)
    real = poles.real[(np.abs(poles.imag) <= 1e-9 * size) & (poles.real < -1e-9 * size)]  # but for rounding
    return np.sort(-1.0 / real)[::-1]


def _pole_powers(
    plant: Structure, values: dict[str, float], f_tanh: float, k: int, names: list[str], options: ExchangeOptions
) -> tuple[Array, float]:
    """Powers with which the k-th time constant depends on parameters, and the time constant in s."""
    constant, step = _time_constants(plant, values, f_tanh)[k], options.log_step
    powers = np.zeros(len(names))
    for i, name in enumerate(names):
        moved = _time_constants(plant, values | {name: values[name] * np.exp(step)}, f_tanh)
        powers[i] = np.log(moved[k] / constant) / step if len(moved) > k else 0.0
    return powers, float(constant)


def _fit_with_lag(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    values: dict[str, float],
    name: str,
    lag: float,
    powers: dict[str, float],
    options: ExchangeOptions,
) -> OptimumWithJacobian | None:
    """Fit all other parameters with `name` fixed at `lag`, from where the pole has the value of the old lag."""
    length = sum(p * p for p in powers.values())
    if not length > 0.0:
        return None
    move = np.log(values[name] / lag) / length
    rest = space.fix(name, lag)
    start = np.array([values[n] * np.exp(move * powers.get(n, 0.0)) for n in rest.names])
    widening = np.where(rest.log, options.widening, 1.0)
    low, high = np.minimum(rest.low / widening, start), np.maximum(rest.high * widening, start)
    found = fit_to_convergence(problem, replace(rest, low=low, high=high, start=start), settings, start)
    return found._replace(values=np.insert(found.values, space.names.index(name), lag))
