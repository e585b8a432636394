"""Width of friction's reversal: none that the recording can show, or a width with its interval.

The width is searched with all parameters. Whether friction may as well reverse at once is asked once, at the optimum.
One batch of simulations over the width gives residuals; one Gauss-Newton step of the other parameters, by generalised
least squares, gives a profile of the likelihood. Exact friction is fitted anew from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.error_floor import error_variances
from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, fit_to_convergence
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH, Nuisance
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


WIDTH_DEFAULTS = WidthOptions()


class FrictionWidth(NamedTuple):
    """Speed within which dry friction reverses, rad/s (m/s)."""

    value: float  #: 0 if the recording shows no width; the sharpest one at level ``euler``, which cannot stop a mass.
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
    """Width with its interval; where friction may as well reverse at once, it does so from now on.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
        With the width, or with exact friction: then it stays exact, and the upper limit is asked for.
    settings : Settings
    best : OptimumWithJacobian
        Of all parameters, and of the width if the space has it.
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
    width = problem.friction_width
    if width is None:
        return None, space, best
    profile = _Profile.of(problem, space, settings, best, options)
    if FRICTION_WIDTH in space.fixed:
        end = _interval(profile, width, profile.of_optimum(space, best))[1]
        return FrictionWidth(0.0, (0.0, end)), space, best
    row = space.names.index(FRICTION_WIDTH)
    sharpest = width.low if settings.level == "euler" else 0.0
    sharp = space.fix(FRICTION_WIDTH, sharpest)
    again = fit_to_convergence(problem, sharp, settings, np.delete(best.values, row))
    begin, end = _interval(profile, width, profile.of_optimum(sharp, again))
    if begin == 0.0:
        return FrictionWidth(sharpest, (0.0, end)), sharp, again
    value = float(best.values[row])
    # Whitened and not, the least sum of squares may differ where the residual is no noise.
    return FrictionWidth(value, (min(begin, value), max(end, value))), space, best


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
        values = self.space.named(np.repeat(self.values[:, None], widths.size, axis=1))
        residuals = self.problem.residuals({**values, FRICTION_WIDTH: widths}, self.settings)
        return np.array([self.whitening.gls_rss(residual, self.others) for residual in residuals.T])

    def of_optimum(self, space: ParameterSpace, optimum: OptimumWithJacobian) -> float:
        """The same of another optimum in its own space."""
        moving = space.active_bounds(optimum.values) == 0
        return self.whitening.gls_rss(optimum.residual, optimum.jacobian[:, moving])


def _interval(profile: _Profile, width: Nuisance, at_once: float) -> tuple[float, float]:
    """Widths that a likelihood ratio does not reject, to infinity where it rejects none.

    They begin at 0 if it does not reject the deviance of friction that reverses `at_once`.
    """
    options, low, high = profile.options, width.low, width.high
    grid = np.geomspace(low, high, 1 + round(options.points_per_decade * np.log10(high / low)))
    if FRICTION_WIDTH in profile.space.names:
        grid = np.sort(np.append(grid, profile.values[profile.space.names.index(FRICTION_WIDTH)]))
    deviance = profile(grid)
    limit = float(min(deviance.min(), at_once) + chi2.isf(options.level, 1))
    inside = np.flatnonzero(deviance <= limit)
    if not len(inside):
        return 0.0, low
    first, last = inside[0], inside[-1]
    end = np.inf if last == grid.size - 1 else _crossing(profile, grid[last + 1], grid[last], limit)
    if at_once <= limit:
        return 0.0, end
    return low if first == 0 else _crossing(profile, grid[first - 1], grid[first], limit), end


def _crossing(profile: _Profile, outer: float, inner: float, limit: float) -> float:
    """Width between `outer` and `inner` at which the profile falls to `limit`."""
    grid = np.geomspace(outer, inner, profile.options.points_refined)
    deviance = profile(grid)
    first = int(np.argmax(deviance <= limit))
    if first == 0:
        return inner
    share = (deviance[first - 1] - limit) / (deviance[first - 1] - deviance[first])
    return float(grid[first - 1] * (grid[first] / grid[first - 1]) ** share)
