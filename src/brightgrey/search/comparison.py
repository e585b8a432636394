"""Comparison of nested structures: likelihood ratio and F statistics of whitened residual sums of squares.

The sums come from :class:`~brightgrey.estimation.noise.whitening.Whitening` with the noise of the structure that fits
best.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from brightgrey.arrays import Array, log_ratio
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.kit import Structure
from brightgrey.numerics.distributions import chi2, f, ncx2

__all__ = ["Judged", "chance_of", "power", "significance", "threshold"]


@dataclass(frozen=True)
class Judged:
    """A structure at the level that counts."""

    structure: Structure
    values: Mapping[str, float]  #: SI, fixed ones included.
    descent: OptimumWithJacobian  #: With residual and Jacobian.
    free: int  #: Number of estimated parameters.
    inside: tuple[int, ...]  #: Parameters, by column of the Jacobian, that are not at a bound.

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals."""
        return self.descent.cost

    @property
    def inside_jacobian(self) -> Array:
        """Jacobian by the parameters that are not at a bound, shape (residuals, len(inside))."""
        return self.descent.jacobian[:, list(self.inside)]


def significance(small: float, big: float, samples: int) -> float:
    """Twice the logarithm of the likelihood ratio of two misfits, noise of unknown size."""
    return samples * log_ratio(small, big)


def threshold(parameters: int, level: float) -> float:
    """Critical value of twice the log-likelihood ratio at `level`, by Wilks's theorem."""
    return float(chi2.isf(level, max(parameters, 1)))


def chance_of(ratio: float, parameters: int, left: float) -> float:
    """Probability that useless `parameters` lower a sum of squares by that `ratio`, `left` independent samples beyond.

    By Fisher's F distribution, which needs no number of samples to be large; 1 if none is left.
    """
    if not left > 0.0:
        return 1.0
    return float(f.sf((ratio - 1.0) * left / max(parameters, 1), max(parameters, 1), left))


def power(noncentrality: float, parameters: int, level: float) -> float:
    """Probability that an effect of this size is found at `level`."""
    return float(ncx2.sf(threshold(parameters, level), max(parameters, 1), max(noncentrality, 1e-12)))
