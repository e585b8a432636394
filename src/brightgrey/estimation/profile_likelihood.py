"""Profile likelihood: intervals where the quadratic approximation of the cost fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import one_of
from brightgrey.estimation.fit import Fit
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.nuisance import friction_width_nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import sandwich_covariance
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["Profile", "ProfileOptions", "profile"]

_SIDES: tuple[Literal["low", "high"], ...] = ("low", "high")


@dataclass(frozen=True)
class ProfileOptions:
    """Steps of a profile, all relative to the half width of the quadratic interval."""

    first_step: float = 1.0  #: First step away from the optimum.
    step_growth: float = 1.6  #: Factor from step to step.
    max_steps: int = 12  #: Largest number of steps to each side; they reach 280 half widths.
    end_tolerance: float = 0.02  #: Accuracy of the ends of the interval.
    #: Difference of an end from the quadratic one up to which the quadratic interval counts as confirmed.
    quadratic_tolerance: float = 0.25
    unknown_step: float = 0.05  #: First step where the half width is unknown, as part of the range.


PROFILE_DEFAULTS = ProfileOptions()


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter, SI."""

    name: str
    #: Values at which the parameter was fixed, ascending, and the least cost there.
    values: tuple[float, ...]
    costs: tuple[float, ...]
    threshold: float  #: Cost at the ends of the interval.
    ci95: tuple[float, float]  #: 95 % interval; the bound where the cost stays below the threshold up to it.
    open: tuple[Literal["low", "high"], ...]  #: Sides on which the interval has no end within the bounds.
    quadratic: bool  #: True if the interval from the curvature at the optimum agrees with this one.
    text: str  #: One sentence on the result.


def profile(
    found: Fit, recordings: Sequence[Recording], name: str, options: ProfileOptions = PROFILE_DEFAULTS
) -> Profile:
    """Fix one parameter at values around its estimate, fit all others again, and find where the cost is too high.

    Parameters
    ----------
    found : Fit
    recordings : sequence of Recording
        Those of the fit.
    name : str
        A parameter that was estimated.
    options : ProfileOptions

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
    noise the quantile is multiplied by the ratio of the parameter's variances with and without the autocorrelation of
    the residuals. Both intervals then agree where the cost is a parabola (Wald-type calibration of the composite
    likelihood; Varin, Reid, Firth 2011, section 2.3).
    """
    bounds = {n: found.bounds[n] for n in found.structure.parameters if n in found.bounds}
    name = one_of("estimated parameter", name, bounds)
    known, width = scales(recordings), found.friction_width
    free_width = friction_width_nuisance(known.speed) if width is not None and not width.is_sharp else None
    problem = SimulationErrorProblem.of(
        found.structure, recordings, friction_width=free_width, per_recording=tuple(found.in_recordings)
    )
    values = {n: e.value for n, e in found.estimates.items()} | dict(found.deviations)
    fixed = {n: value for n, value in values.items() if n not in bounds}
    nuisances = [*problem.deviations, *([] if free_width is None else [free_width])]
    space = parameter_space(found.structure, known, bounds, fixed, nuisances)
    k = space.names.index(name)
    settings, start = found.settings, np.array([values.get(n, 1.0 / found.settings.f_tanh) for n in space.names])
    best = fit_to_convergence(problem, space, settings, start)
    half, rise = _calibration(problem, best, k)
    low, high, middle = (float(v[k]) for v in (*space.box, space.to_scaled(best.values)))
    curve = _CostCurve(problem, space, settings, k, best.cost + rise, {middle: (best.cost, best.values)})
    step = half if np.isfinite(half) and half > 0.0 else options.unknown_step * (high - low)
    ends = [_profile_end(curve, middle, side * step, bound, options) for side, bound in ((-1.0, low), (1.0, high))]
    opened = tuple(side for side, (_, closed) in zip(_SIDES, ends, strict=True) if not closed)
    tolerance = options.quadratic_tolerance * half
    quadratic = not opened and all(abs(abs(t - middle) - half) <= tolerance for t, _ in ends)
    return Profile(
        name=name,
        values=tuple(curve.to_si(t) for t in sorted(curve.fitted)),
        costs=tuple(curve.fitted[t][0] for t in sorted(curve.fitted)),
        threshold=curve.threshold,
        ci95=(curve.to_si(ends[0][0]), curve.to_si(ends[1][0])),
        open=opened,
        quadratic=quadratic,
        text=_summary(name, opened, quadratic),
    )


@dataclass(frozen=True)
class _CostCurve:
    """Cost minus the threshold over one scaled parameter; `fitted` keeps the cost and the values of all fits."""

    problem: SimulationErrorProblem
    space: ParameterSpace
    settings: Settings
    k: int
    threshold: float
    fitted: dict[float, tuple[float, Array]]

    def to_si(self, theta: float) -> float:
        """SI value."""
        return float(np.exp(theta)) if self.space.log[self.k] else float(theta * self.space.width[self.k])

    def __call__(self, theta: float) -> float:
        if theta not in self.fitted:
            near = min(self.fitted, key=lambda t: abs(t - theta))
            value, start = self.to_si(theta), np.delete(self.fitted[near][1], self.k)
            rest = self.space.fix(self.space.names[self.k], value)
            end = fit_to_convergence(self.problem, rest, self.settings, start)
            self.fitted[theta] = (end.cost, np.insert(end.values, self.k, value))
        return self.fitted[theta][0] - self.threshold


def _calibration(problem: SimulationErrorProblem, best: OptimumWithJacobian, k: int) -> tuple[float, float]:
    """Half width of the quadratic interval in the scaled space, and the rise of the cost at its ends."""
    J = best.jacobian
    own = sandwich_covariance(best.residual, J, problem.segment_lengths)
    half = float(own.quantile[k] * own.std[k])
    curvature = float(np.linalg.pinv(J.T @ J, hermitian=True)[k, k])
    return half, half**2 / curvature if curvature > 0.0 else 0.0


def _profile_end(
    cost: Callable[[float], float], middle: float, step: float, bound: float, options: ProfileOptions
) -> tuple[float, bool]:
    """Point on one side where the cost crosses zero, and True; or the bound and False."""
    inner, length = middle, options.first_step * abs(step)
    for _ in range(options.max_steps):
        outer = middle + np.sign(step) * length
        last = abs(outer - middle) >= abs(bound - middle)
        outer = bound if last else outer
        if cost(outer) >= 0.0:
            from scipy.optimize import brentq  # slow to import, and only profiles need it

            return float(brentq(cost, inner, outer, xtol=options.end_tolerance * abs(step))), True
        if last:
            break
        inner, length = outer, options.step_growth * length
    return float(bound), False


def _summary(name: str, opened: Sequence[str], quadratic: bool) -> str:
    if opened:
        sides = " and no ".join({"low": "lower", "high": "upper"}[side] for side in opened)
        return f"the recording gives no {sides} limit of {name} within its bounds"
    if not quadratic:
        return f"the quadratic interval of {name} is wrong: use the interval of the profile"
    return f"the profile of {name} confirms the quadratic interval"
