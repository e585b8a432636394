"""Width of friction's reversal: as sharp as the recording can show, or a width with its interval.

The width is searched with all parameters. Whether it differs from the sharpest one is asked once, at the optimum. One
batch of simulations over the width gives residuals; one Gauss-Newton step of the other parameters, by generalised least
squares, gives a profile of the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.error_floor import error_variances
from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.numerics.distributions import chi2
from brightgrey.simulation import Settings

__all__ = ["FrictionWidth", "WidthOptions", "estimated_width"]


@dataclass(frozen=True)
class WidthOptions:
    """Grid and level of the profile over the width."""

    points_per_decade: int = 12
    points_refined: int = 9  #: Points between two of these, where an end of the interval is.
    level: float = 0.05  #: Chance that a width is reported although friction reverses at once.
    #: Growth of the sum of squares up to which friction that reverses at once makes the same motion,
    same_motion: float = 1.5
    same_digits: float = 10.0  #: beside so many times what the errors of simulation and sensor make.


WIDTH_DEFAULTS = WidthOptions()


class FrictionWidth(NamedTuple):
    """Speed within which dry friction reverses, rad/s (m/s)."""

    value: float  #: The sharpest one that is simulated, if the recording shows no width.
    #: 95 % interval: from 0 if the recording shows no width, to infinity if it shows no upper limit.
    ci95: tuple[float, float]

    @property
    def is_sharp(self) -> bool:
        """The recording shows no width."""
        return self.ci95[0] == 0.0


def estimated_width(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    options: WidthOptions = WIDTH_DEFAULTS,
) -> tuple[FrictionWidth | None, ParameterSpace, OptimumWithJacobian]:
    """Width with its interval; where the recordings show none, it is fixed at the sharpest one.

    A mass that creeps through a smooth reversal may stick for good where friction reverses at once. Then the sharpest
    width is one that the recordings show: the interval begins with it.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
    best : OptimumWithJacobian
        Of all parameters and the width.
    options : WidthOptions

    Returns
    -------
    FrictionWidth or None
        None if the width is not estimated.
    ParameterSpace
        In which a width that does not show is fixed.
    OptimumWithJacobian
        In that space.
    """
    if FRICTION_WIDTH not in space.names:
        return None, space, best
    row = space.names.index(FRICTION_WIDTH)
    low, high = float(space.low[row]), float(space.high[row])
    value = float(best.values[row])
    begin, end = _interval(_Profile.of(problem, space, settings, best, options), low, high)
    if begin > 0.0 and space.active_bounds(best.values)[row] >= 0:
        # Whitened and not, the least sum of squares may differ where the residual is no noise.
        return FrictionWidth(value, (min(begin, value), max(end, value))), space, best
    sharp = space.fix(FRICTION_WIDTH, low)
    again = fit_to_convergence(problem, sharp, settings, np.delete(best.values, row))
    begin = 0.0 if _moves_alike(problem, sharp, settings, again, options) else low
    return FrictionWidth(low, (begin, end)), sharp, again


def _moves_alike(
    problem: SimulationErrorProblem,
    sharp: ParameterSpace,
    settings: Settings,
    best: OptimumWithJacobian,
    options: WidthOptions,
) -> bool:
    """True if friction that reverses at once makes the same motion as the sharpest width, but for its last digits."""
    if settings.level == "euler":  # which cannot stop a mass
        return True
    values = sharp.named(best.values[:, None])
    del values[FRICTION_WIDTH]
    at_once = replace(problem, friction_width=None).costs(values, replace(settings, f_tanh=np.inf))
    floor = error_variances(problem.recordings, problem.weights).ravel() @ np.array(problem.segment_lengths)
    return bool(at_once[0] <= options.same_motion * best.cost + options.same_digits * floor)


@dataclass(frozen=True)
class _Profile:
    """Whitened sum of squares over the width, the other parameters one Gauss-Newton step from their optimum."""

    problem: SimulationErrorProblem
    space: ParameterSpace
    settings: Settings
    values: Array
    others: Array
    whitening: Whitening
    options: WidthOptions

    @classmethod
    def of(
        cls,
        problem: SimulationErrorProblem,
        space: ParameterSpace,
        settings: Settings,
        best: OptimumWithJacobian,
        options: WidthOptions,
    ) -> Self:
        """Profile at an optimum; parameters at their bounds stay there."""
        moving = (space.active_bounds(best.values) == 0) & (np.array(space.names) != FRICTION_WIDTH)
        others = best.jacobian[:, moving]
        floor = error_variances(problem.recordings, problem.weights).ravel().tolist()
        whitening = Whitening.of(best.residual, others, problem.segment_lengths, floor)
        return cls(problem, space, settings, best.values, others, whitening, options)

    def __call__(self, widths: Array) -> Array:
        values = np.repeat(self.values[:, None], widths.size, axis=1)
        values[self.space.names.index(FRICTION_WIDTH)] = widths
        residuals = self.problem.residuals(self.space.named(values), self.settings)
        return np.array([self.whitening.gls_rss(residual, self.others) for residual in residuals.T])


def _interval(profile: _Profile, low: float, high: float) -> tuple[float, float]:
    """Widths that a likelihood ratio does not reject: from 0 and to infinity where it rejects none."""
    options = profile.options
    grid = np.geomspace(low, high, 1 + round(options.points_per_decade * np.log10(high / low)))
    grid = np.sort(np.append(grid, profile.values[profile.space.names.index(FRICTION_WIDTH)]))
    deviance = profile(grid)
    limit = float(deviance.min() + chi2.isf(options.level, 1))
    inside = np.flatnonzero(deviance <= limit)
    begin = 0.0 if grid[inside[0]] <= grid[0] else _crossing(profile, grid[inside[0] - 1], grid[inside[0]], limit)
    end = np.inf if inside[-1] == grid.size - 1 else _crossing(profile, grid[inside[-1] + 1], grid[inside[-1]], limit)
    return begin, end


def _crossing(profile: _Profile, outer: float, inner: float, limit: float) -> float:
    """Width between `outer` and `inner` at which the profile falls to `limit`."""
    grid = np.geomspace(outer, inner, profile.options.points_refined)
    deviance = profile(grid)
    first = int(np.argmax(deviance <= limit))
    if first == 0:
        return inner
    share = (deviance[first - 1] - limit) / (deviance[first - 1] - deviance[first])
    return float(grid[first - 1] * (grid[first] / grid[first - 1]) ** share)
