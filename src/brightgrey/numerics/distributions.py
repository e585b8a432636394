"""Distributions of test statistics, by the functions of scipy.special that scipy.stats rests on.

The import of scipy.stats takes longer than the fit of a given structure.
"""

from __future__ import annotations

from typing import Any

from scipy import special

__all__ = ["chi2", "f", "ncx2", "norm", "t"]


class _ChiSquared:
    """Chi-squared distribution with `df` degrees of freedom."""

    def sf(self, x: Any, df: Any) -> Any:
        """Probability of a larger value than `x` (survival function)."""
        return special.chdtrc(df, x)

    def isf(self, q: Any, df: Any) -> Any:
        """Value that is exceeded with probability `q`."""
        return special.chdtri(df, q)

    def median(self, df: Any) -> Any:
        """Median."""
        return 2 * special.gammaincinv(df / 2, 0.5)


class _NoncentralChiSquared:
    """Chi-squared distribution with `df` degrees of freedom and noncentrality `nc`."""

    def sf(self, x: Any, df: Any, nc: Any) -> Any:
        """Probability of a larger value than `x` (survival function)."""
        from scipy import stats  # only a search for the structure needs this one

        return stats.ncx2.sf(x, df, nc)


class _Fisher:
    """Fisher's F distribution with `dfn` and `dfd` degrees of freedom."""

    def sf(self, x: Any, dfn: Any, dfd: Any) -> Any:
        """Probability of a larger value than `x` (survival function)."""
        return special.fdtrc(dfn, dfd, x)

    def isf(self, q: Any, dfn: Any, dfd: Any) -> Any:
        """Value that is exceeded with probability `q`."""
        return special.fdtri(dfn, dfd, 1.0 - q)


class _Normal:
    """Standard normal distribution."""

    def ppf(self, q: Any) -> Any:
        """Value that is not exceeded with probability `q` (quantile)."""
        return special.ndtri(q)

    def isf(self, q: Any) -> Any:
        """Value that is exceeded with probability `q`."""
        return -special.ndtri(q)


class _Student:
    """Student's t distribution with `df` degrees of freedom."""

    def ppf(self, q: Any, df: Any) -> Any:
        """Value that is not exceeded with probability `q` (quantile)."""
        return special.stdtrit(df, q)


chi2, ncx2, f, norm, t = _ChiSquared(), _NoncentralChiSquared(), _Fisher(), _Normal(), _Student()
