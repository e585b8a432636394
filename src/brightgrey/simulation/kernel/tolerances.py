"""Tuned numbers of the compiled simulator, in one place."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["TOLERANCES", "KernelTolerances"]


class KernelTolerances(NamedTuple):
    """Tolerances and budgets inside a step. numba compiles a named tuple as constants."""

    taylor_degree: int = 14  #: Degree of the Taylor polynomial of a matrix exponential whose argument is at most 1/2.
    #: Terms of a power series that are this small, relative to the sum, count as rounding.
    series_rounding: float = 1e-16
    max_events: int = 200  #: Limits reached or left within one tick, beyond which the simulation is given up.
    #: Rate of a state at its limit that counts as rounding, relative to the sum of its summands' magnitudes.
    contact_rounding: float = 1e-13
    #: A limited state that relaxes this many times within a span is replaced by its quasi-steady course.
    stiff_time_constants: float = 8.0
    #: Effect of a limited state on other states, relative to its column, that counts as rounding.
    negligible_coupling: float = 1e-9
    same_span: float = 1e-9  #: Spans of time that differ by less than this part of a tick are the same.
    #: Distance between a limited state and that of its group's leader, relative to the width between the limits, up to
    #: which differences between the two count as linear.
    leader_distance: float = 0.01
    least_shared_samples: int = 1000  #: Samples of a batch for which another thread is worth its start.


TOLERANCES = KernelTolerances()
