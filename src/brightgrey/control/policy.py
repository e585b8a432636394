"""Numbers of the analyses for control: tolerances, grids and orders of approximations."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ANALYSIS", "AnalysisPolicy"]


@dataclass(frozen=True)
class AnalysisPolicy:
    """Numbers by which a model is linearised, discretised and analysed."""

    part_of_speed: float = 0.5  #: Of the largest speed: where a model is linearised unless told otherwise.
    most_newton_steps: int = 20  #: Towards a steady motion.
    balance_tolerance: float = 1e-8  #: Residual of a steady motion, relative to the largest term of the balance.
    points_of_a_wave: int = 720  #: Positions among which a position-dependent load is steepest or largest.
    #: Of the fastest pole: a pole nearer to the imaginary axis counts as on it.
    axis_tolerance: float = 1e-9
    rounding: float = 4e-15  #: Of the sum of the terms: a sum that is smaller is zero.
    #: Remainder of a Krylov direction, relative to A, that counts as zero.
    krylov_tolerance: float = 1e-10
    points_per_decade: int = 200  #: Of a frequency grid.
    pade_order: int = 6  #: Of the dead time in the poles of a closed loop.
    quadrature_points: int = 128  #: Over a quarter of a period, for a describing function.
    taylor_order: int = 8  #: Of the matrix exponential of a sampling interval.
    #: Norm that its matrix is scaled down to: the remainder is below 1e-10.
    taylor_norm: float = 0.3


ANALYSIS = AnalysisPolicy()
"""The numbers that every analysis uses."""
