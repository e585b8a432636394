"""Adequacy of a structure: the whitened cost that it leaves beyond the best ones, and the most that chance explains.

The *deviance* of a structure is its whitened sum of squared residuals, noise of variance 1. By Wilks's theorem the
deviance of the true structure is above that of a larger one by a chi-squared variable. Its degrees of freedom are the
parameters that the larger one has beyond the true one. A structure is compared with the largest of each number of
masses, since what friction explains shows best among structures with as many.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from brightgrey.numerics.distributions import chi2
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import SELECTION, SelectionPolicy

__all__ = ["Deviance", "Round", "gained_by_chance", "material_growth"]


@dataclass(frozen=True)
class Deviance:
    """A fitted structure as the decision sees it."""

    value: float  #: Whitened sum of squared residuals, noise of variance 1.
    free: int  #: Number of estimated parameters.
    masses: int  #: Number of masses.


def gained_by_chance(parameters: int, tests: float = 1.0, policy: SelectionPolicy = SELECTION) -> float:
    """Deviance that further parameters gain by chance, at a level that several tests share; at least one counts."""
    return float(chi2.isf(policy.false_alarm_level / tests, max(parameters, 1)))


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
    most_free: Mapping[int, int]  #: The same of the largest structure with so many masses, by masses.
    error_floor: float  #: Deviance that errors of simulation and sensor may cause.
    model_error: bool = False  #: The residual of the best structure follows a pattern that nothing explains.
    policy: SelectionPolicy = SELECTION

    @property
    def material_growth(self) -> float:
        """See :func:`material_growth`."""
        return material_growth(model_error=self.model_error, policy=self.policy)

    def chance(self, parameters: int, masses: int = 0, *, among: int = 1) -> float:
        """Deviance that further parameters gain by chance.

        Parameters
        ----------
        parameters : int
            At least one counts.
        masses : int
            Further masses that bring some of the parameters. The resonance of each may lie anywhere, and the best fit
            has it where it explains most of the noise. So Wilks's theorem holds at one frequency only, and the level is
            shared among `SelectionPolicy.resonances` of them (Bonferroni; Davies 1977, doi:10.1093/biomet/64.2.247).
        among : int
            Number of effects that were tried, of which the best is taken; at least one counts.
        """
        return gained_by_chance(parameters, max(among, 1) * self.policy.resonances**masses, self.policy)

    def by_chance(self, parameters: int = 1) -> float:
        """Deviance that further parameters gain by chance, or that errors of simulation and sensor may cause."""
        return max(self.chance(parameters), self.error_floor)

    def chance_beyond(self, free: int, masses: int, most_masses: int) -> float:
        """Deviance that the largest structure with so many masses gains by chance over a structure.

        A structure has one test for each number of masses that is no smaller than its own. They share the false alarm
        level: each further mass has half as much (weighted Bonferroni tests; Genovese, Roeder and Wasserman 2006,
        doi:10.1093/biomet/93.3.509). What it has is shared among the frequencies again, see :meth:`chance`.

        Parameters
        ----------
        free, masses : int
            Estimated parameters and masses of the structure.
        most_masses : int
            Of the largest structure.
        """
        further = max(most_masses - masses, 0)
        shares = [0.5 ** (n - masses) for n in self.most_free if n >= most_masses - further]
        tests = sum(shares) / 0.5 ** (most_masses - masses) * self.policy.resonances**further
        return gained_by_chance(self.most_free[most_masses] - free, tests, self.policy)

    def least(self, table: Collection[Deviance]) -> dict[int, float]:
        """Least deviance of the structures with so many masses at most, by masses."""
        found = {n: [d.value for d in table if d.masses <= n] for n in self.most_free}
        return {n: min(values) for n, values in found.items() if values}

    def limit(self, deviance: Deviance, least: Mapping[int, float]) -> float:
        """Largest deviance with which a structure is adequate.

        It has to keep up with the best structure of each number of masses that is no smaller than its own. What
        friction explains shows best among structures with as many masses: the largest has few parameters more.

        Parameters
        ----------
        deviance : Deviance
            Of the structure.
        least : mapping of int to float
            Least deviances, see :meth:`least`.
        """
        own = min(deviance.masses, max(least))
        ahead = {n: value for n, value in least.items() if n >= own}
        return min(v + self._allowed(self.chance_beyond(deviance.free, own, n), v) for n, v in ahead.items())

    def threshold_of_one_test(self, least: float) -> float:
        """Excess that the smallest structure may have if it is compared with the largest one alone.

        An excess of several times as much refutes any structure, and everything within it.
        """
        return self._allowed(self.chance(max(self.most_free.values()) - self.least_free), least)

    def _allowed(self, chance: float, least: float) -> float:
        return max(chance, self.material_growth * least, self.error_floor)
