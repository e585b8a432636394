"""Tuned numbers of the reference solutions, in one place."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REFERENCE_TOLERANCES", "ReferenceTolerances"]


@dataclass(frozen=True)
class ReferenceTolerances:
    """Tolerances and budgets of both methods and of their comparison. Changes are relative to a signal's peak.

    Attributes
    ----------
    coarsest_step : float
        First step of the method 'fixed' in s.
    trusted_step : float
        Step in s from which the method also ends where halving no longer helps.
    finest_step : float
        Last step in s.
    settled : float
        Change of position and velocity by a halving at which the step is small enough.
    unsettled : float
        Larger changes are refused: the solution is no reference.
    inner_points : int
        Points within a step at which the method 'events' looks for an event.
    max_switches : int
        Events in one piece of the input, after which chattering within the rounding error is ignored.
    push : float
        Change of the input that shows chaos.
    chaos : float
        A motion that grows apart by more after that push is chaotic.
    """

    coarsest_step: float = 8e-6
    trusted_step: float = 1e-6
    finest_step: float = 5e-8
    settled: float = 1e-9
    unsettled: float = 1e-6
    inner_points: int = 17
    max_switches: int = 50
    push: float = 1e-9
    chaos: float = 1e-5


REFERENCE_TOLERANCES = ReferenceTolerances()
