"""Adequacy of a structure: the whitened cost that it leaves beyond the best one, and the most that chance explains.

The *deviance* of a structure is its whitened sum of squared residuals, noise of variance 1. By Wilks's theorem the
deviance of the true structure is above that of the largest by a chi-squared variable. Its degrees of freedom are the
parameters that the largest has beyond the true one.
"""

from __future__ import annotations

from dataclasses import dataclass

from brightgrey.numerics.distributions import chi2
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import SELECTION, SelectionPolicy

__all__ = ["Deviance", "Round", "material_growth"]


@dataclass(frozen=True)
class Deviance:
    """A fitted structure as the decision sees it."""

    value: float  #: Whitened sum of squared residuals, noise of variance 1.
    free: int  #: Number of estimated parameters.


def material_growth(*, model_error: bool, policy: SelectionPolicy = SELECTION) -> float:
    """Growth of the deviance, as a part of it, that does not matter however significant it is.

    Where the best residual holds model error, many samples make anything significant, and an effect has to explain a
    notable part of the residual's RMS.
    """
    notable = 1.0 / (1.0 - policy.notable_gain) ** 2
    return (notable if model_error else policy.min_rss_ratio) - 1.0


@dataclass(frozen=True)
class Round:
    """All that is common to the structures that are compared."""

    lattice: Lattice
    least_free: int  #: Number of estimated parameters of the smallest structure.
    most_free: int  #: Of the largest one.
    error_floor: float  #: Deviance that errors of simulation and sensor may cause.
    model_error: bool = False  #: The residual of the best structure follows a pattern that nothing explains.
    policy: SelectionPolicy = SELECTION

    @property
    def material_growth(self) -> float:
        """See :func:`material_growth`."""
        return material_growth(model_error=self.model_error, policy=self.policy)

    def threshold(self, deviance: Deviance, least: float) -> float:
        """Largest excess over the `least` deviance with which a structure is adequate.

        Calibration (bench/recovery.py): no surcharge for missing masses and gaps is called for, although a resonance
        may lie anywhere, because nobody looks everywhere for the optimum of the largest structure.
        """
        more = max(self.most_free - deviance.free, 1)
        chance = float(chi2.isf(self.policy.false_alarm_level, more))
        return max(chance, self.material_growth * least, self.error_floor)

    def largest_threshold(self, least: float) -> float:
        """Threshold of the smallest structure: one fit that leaves more refutes everything within it."""
        return self.threshold(Deviance(least, self.least_free), least)
