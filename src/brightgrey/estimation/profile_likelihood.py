"""Profile likelihood: intervals where the quadratic picture of the cost fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.fit import Fit
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import sandwich_covariance
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["Profile", "profile"]

_FIRST = 1.0  # first step, in half widths of the quadratic interval
_GROWTH, _STEPS = 1.6, 12  # from there to 280 of them
_FAILED = 0.25  # of the half width: by how much an end may move before the quadratic picture has failed
_SIDES: tuple[Literal["low", "high"], ...] = ("low", "high")
_ROOT = 0.02  # of the half width: how well an end is found


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter, SI.

    Attributes
    ----------
    name : str
    values, costs : tuple of float
        Values at which the parameter was held, ascending, and the least cost there.
    threshold : float
        Cost at the ends of the interval.
    ci95 : (low, high)
        The search's bound where the cost stays below the threshold up to it.
    open : tuple of {'low', 'high'}
        Sides on which the recording gives no end.
    quadratic : bool
        Whether the interval from the curvature at the optimum agrees with this one.
    text : str
    """

    name: str
    values: tuple[float, ...]
    costs: tuple[float, ...]
    threshold: float
    ci95: tuple[float, float]
    open: tuple[Literal["low", "high"], ...]
    quadratic: bool
    text: str


def profile(found: Fit, recordings: Sequence[Recording], name: str) -> Profile:
    """Hold one parameter at values around its estimate, fit all others again, and see where the cost is too high.

    Parameters
    ----------
    found : Fit
    recordings : sequence of Recording
        Those of the fit.
    name : str
        A parameter that was estimated.

    Returns
    -------
    Profile

    Raises
    ------
    SettingsError
        For a parameter that was not estimated.

    Notes
    -----
    For white noise the threshold is the least cost plus the quantile times the variance of the residuals. For coloured
    noise the quantile is stretched by the parameter's variance with the residuals' autocorrelation over that without:
    then both intervals agree where the cost is a parabola (a Wald-type calibration of the composite likelihood;
    Varin, Reid, Firth 2011, section 2.3).
    """
    bounds = {n: found.bounds[n] for n in found.structure.parameters if n in found.bounds}
    if name not in bounds:
        raise SettingsError(unknown_name("estimated parameter", name, bounds))
    problem = SimulationErrorProblem.of(found.structure, recordings)
    fixed = {n: e.value for n, e in found.estimates.items() if n not in bounds}
    search = parameter_space(found.structure, scales(recordings), bounds, fixed)
    k = search.names.index(name)
    start = np.array([found.estimates[n].value for n in search.names])
    best = fit_to_convergence(problem, search, found.settings, start)
    half, rise = _calibrated(problem, best, k)
    low, high, middle = (float(v[k]) for v in (*search.box, search.to_scaled(best.values)))
    course = _Course(problem, search, found.settings, k, best.cost + rise, {middle: (best.cost, best.values)})
    step = half if np.isfinite(half) and half > 0.0 else 0.05 * (high - low)
    ends = [_end(course, middle, side * step, bound) for side, bound in ((-1.0, low), (1.0, high))]
    opened = tuple(side for side, (_, closed) in zip(_SIDES, ends, strict=True) if not closed)
    quadratic = not opened and all(abs(abs(t - middle) - half) <= _FAILED * half for t, _ in ends)
    return Profile(
        name=name,
        values=tuple(course.outward(t) for t in sorted(course.known)),
        costs=tuple(course.known[t][0] for t in sorted(course.known)),
        threshold=course.threshold,
        ci95=(course.outward(ends[0][0]), course.outward(ends[1][0])),
        open=opened,
        quadratic=quadratic,
        text=_text(name, opened, quadratic),
    )


@dataclass(frozen=True)
class _Course:
    """Cost above the threshold over one parameter, in the searched scale; `known` keeps what was fitted."""

    problem: SimulationErrorProblem
    search: ParameterSpace
    settings: Settings
    k: int
    threshold: float
    known: dict[float, tuple[float, Array]]

    def outward(self, theta: float) -> float:
        """SI value."""
        return float(np.exp(theta)) if self.search.log[self.k] else float(theta * self.search.width[self.k])

    def __call__(self, theta: float) -> float:
        if theta not in self.known:
            near = min(self.known, key=lambda t: abs(t - theta))
            value, start = self.outward(theta), self.known[near][1]
            rest = [i for i in range(len(start)) if i != self.k]
            part = replace(
                self.search,
                names=tuple(self.search.names[i] for i in rest),
                low=self.search.low[rest],
                high=self.search.high[rest],
                start=self.search.start[rest],
                log=self.search.log[rest],
                fixed={**self.search.fixed, self.search.names[self.k]: value},
            )
            end = fit_to_convergence(self.problem, part, self.settings, start[rest])
            self.known[theta] = (end.cost, np.insert(end.values, self.k, value))
        return self.known[theta][0] - self.threshold


def _calibrated(problem: SimulationErrorProblem, best: OptimumWithJacobian, k: int) -> tuple[float, float]:
    """Half width of the quadratic interval (searched scale), and by how much the cost rises at its ends."""
    J = best.jacobian
    own = sandwich_covariance(best.residual, J, [r.samples for r in problem.recordings for _ in r.outputs])
    half = float(own.quantile[k] * np.sqrt(max(own.covariance[k, k], 0.0)))
    curvature = float(np.linalg.pinv(J.T @ J, hermitian=True)[k, k])
    return half, half**2 / curvature if curvature > 0.0 else 0.0


def _end(cost: Callable[[float], float], middle: float, step: float, bound: float) -> tuple[float, bool]:
    """Where the cost crosses zero on one side, and whether it does before the bound."""
    inner, length = middle, _FIRST * abs(step)
    for _ in range(_STEPS):
        outer = middle + np.sign(step) * length
        last = abs(outer - middle) >= abs(bound - middle)
        outer = bound if last else outer
        if cost(outer) >= 0.0:
            from scipy.optimize import brentq  # slow to import, and only profiles need it

            return float(brentq(cost, inner, outer, xtol=_ROOT * abs(step))), True
        if last:
            break
        inner, length = outer, _GROWTH * length
    return float(bound), False


def _text(name: str, opened: Sequence[str], quadratic: bool) -> str:
    if opened:
        return f"the recording gives {name} no {' and no '.join(opened)} end within its bounds"
    if not quadratic:
        return f"the quadratic picture fails for {name}: use the profile's interval"
    return f"the profile of {name} confirms the quadratic interval"
