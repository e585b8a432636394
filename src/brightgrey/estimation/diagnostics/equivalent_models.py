"""Exact twins: a lag of the input and a real pole of a linear drive may change places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.identifiability import power_product
from brightgrey.kit import Structure, assemble
from brightgrey.kit.structure import Placed
from brightgrey.simulation import Settings

__all__ = ["resolve_lag_pole_exchange"]

_WIDER = 1e4  # by which the twin's parameters may leave the range that is searched
_STEP = 1e-5  # of the logarithm, for the powers in which a pole depends on parameters
_NO_WORSE = 4.0  # of the cost that one parameter wins by chance (95 %, per residual's variance)


def resolve_lag_pole_exchange(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, best: OptimumWithJacobian
) -> tuple[OptimumWithJacobian, list[Finding]]:
    """Of two parameter sets with the same response, the one with the shorter lag, and what to say of the other.

    In a chain of two first-order lags nobody can see which comes first. Where an effect's only parameter is a lag
    with a state of its own, and all laws are straight lines, each real pole of the drive is tried as that lag:
    with it fixed, the other parameters are estimated again, and if the cost is the same within what the noise allows,
    there are two drives behind this recording. The pole's time constant is written as a product of powers.

    Returns
    -------
    best : OptimumWithJacobian
        The given one, or its twin if that has the shorter lag and lies within the bounds.
    findings : list of Finding
    """
    structure = problem.structure
    linear = all(p.effect.law is None or (p.effect.law.affine and p.effect.law.ports) for p in structure.placed)
    lags = [p for p in structure.placed if p.effect.has_states and [q.lag for q in p.effect.parameters] == [True]]
    if not linear or structure.has_hard_limit:
        return best, []
    for placed in lags:
        name = placed.parameter(placed.effect.parameters[0].symbol)
        if name in search.names:
            return _exchanged(problem, search, settings, best, placed, name)
    return best, []


def _exchanged(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    placed: Placed,
    name: str,
) -> tuple[OptimumWithJacobian, list[Finding]]:
    values = dict(zip(search.names, best.values.tolist(), strict=True)) | dict(search.fixed)
    plant = Structure(tuple(p for p in problem.structure.placed if p != placed))
    free = [n for n in plant.parameters if n in search.names and plant.parameters[n].scale == "log"]
    allowed = _NO_WORSE * best.cost / max(len(best.residual), 1)
    for k in range(len(_time_constants(plant, values, settings.f_tanh))):
        powers, constant = _powers(plant, values, settings.f_tanh, k, free)
        twin = _fitted(problem, search, settings, values, name, constant, dict(zip(free, powers, strict=True)))
        if twin is None or twin.cost > best.cost + allowed:
            continue
        part = np.abs(powers) > 1e-3
        product = power_product([n for n, p in zip(free, part, strict=True) if p], powers[part].tolist())
        others = dict(zip(search.names, twin.values.tolist(), strict=True))
        keep, other = (best, others) if values[name] <= constant else (twin, values)
        if keep is twin and not np.all((twin.values >= search.low) & (twin.values <= search.high)):
            keep, other = best, others
        kept = dict(zip(search.names, keep.values.tolist(), strict=True))
        shown = ", ".join(
            f"{n} = {other[n]:.4g}" for n in search.names if abs(other[n] - kept[n]) > 0.01 * abs(kept[n])
        )
        text = f"{name} and {product} can be exchanged: {shown} (SI) fits just as well"
        if keep is twin:
            found = fit_to_convergence(problem, search, settings, twin.values)
            keep = found if found.cost <= twin.cost + allowed else best
        return keep, [Finding("equivalent model", text, (name, *(n for n, p in zip(free, part, strict=True) if p)))]
    return best, []


def _time_constants(plant: Structure, values: dict[str, float], f_tanh: float) -> Array:
    """Time constants in s of the real decaying poles, the slowest first."""
    system = assemble(plant, {n: values[n] for n in plant.parameters}, f_tanh)
    poles = np.linalg.eigvals(system.linearise(np.zeros(len(system.states))).A)
    size = np.abs(poles).max(initial=0.0)
    real = poles.real[(np.abs(poles.imag) <= 1e-9 * size) & (poles.real < -1e-9 * size)]
    return np.sort(-1.0 / real)[::-1]


def _powers(plant: Structure, values: dict[str, float], f_tanh: float, k: int, names: list[str]) -> tuple[Array, float]:
    """Powers of the parameters in the k-th time constant, and it in s."""
    constant = _time_constants(plant, values, f_tanh)[k]
    powers = np.zeros(len(names))
    for i, name in enumerate(names):
        moved = _time_constants(plant, values | {name: values[name] * np.exp(_STEP)}, f_tanh)
        powers[i] = np.log(moved[k] / constant) / _STEP if len(moved) > k else 0.0
    return powers, float(constant)


def _fitted(
    problem: SimulationErrorProblem,
    search: ParameterSpace,
    settings: Settings,
    values: dict[str, float],
    name: str,
    lag: float,
    powers: dict[str, float],
) -> OptimumWithJacobian | None:
    """All other parameters estimated again with the lag fixed at `lag`, from where the pole is the old lag."""
    length = sum(p * p for p in powers.values())
    if not length > 0.0:
        return None
    move = np.log(values[name] / lag) / length
    keep = [i for i, n in enumerate(search.names) if n != name]
    names = tuple(search.names[i] for i in keep)
    start = np.array([values[n] * np.exp(move * powers.get(n, 0.0)) for n in names])
    wider = np.where(search.log[keep], _WIDER, 1.0)
    other = replace(
        search,
        names=names,
        low=np.minimum(search.low[keep] / wider, start),
        high=np.maximum(search.high[keep] * wider, start),
        start=start,
        log=search.log[keep],
        fixed={**search.fixed, name: lag},
    )
    found = fit_to_convergence(problem, other, settings, start)
    all_values = dict(zip(names, found.values.tolist(), strict=True)) | {name: lag}
    return found._replace(values=np.array([all_values[n] for n in search.names]))
