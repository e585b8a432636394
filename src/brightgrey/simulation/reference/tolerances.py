"""Tuned numbers of the reference solutions, in one place."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REFERENCE_TOLERANCES", "ReferenceTolerances"]


@dataclass(frozen=True)
class ReferenceTolerances:
    """Tolerances and budgets of both methods and of their comparison. Changes are relative to a signal's peak."""

    coarsest_step: float = 8e-6  #: First step of the method 'fixed' in s.
    trusted_step: float = 1e-6  #: Step in s from which the method also ends where halving no longer helps.
    finest_step: float = 5e-8  #: Last step in s.
    settled: float = 1e-9  #: Change of position and velocity by a halving at which the step is small enough.
    unsettled: float = 1e-6  #: Larger changes are refused: the solution is no reference.
    #: Speed, in parts of the largest one expected, that the method 'events' takes for rest where a mass can stick.
    still: float = 1e-14
    inner_points: int = 17  #: Points within a step at which the method 'events' looks for an event.
    #: Events in one piece of the input, after which chattering within the rounding error is ignored.
    max_switches: int = 50
    push: float = 1e-9  #: Change of the input that shows chaos.
    chaos: float = 1e-5  #: A motion that grows apart by more after that push is chaotic.


REFERENCE_TOLERANCES = ReferenceTolerances()
