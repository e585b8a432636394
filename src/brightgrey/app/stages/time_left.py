"""Time that a search may take yet: an estimate while parts of the border are left, and a bound by its budget."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["rounded_time", "time_left"]


def time_left(stage: Mapping[str, Any], seconds: float, workers: int) -> str:
    """Sentence on the time that is left; empty before anything has been computed.

    The estimate takes the parts of the border that are left to be as costly as those that are decided. The bound takes
    every further structure to be as costly as those that are fitted, until the budget ends the search.

    Parameters
    ----------
    stage : mapping
        Of a run's status: `done`, and of a border `decided`, `left` and `most`.
    seconds : float
        Computing time so far in s, of all workers together.
    workers : int
    """
    done, most, left = stage.get("done", 0), stage.get("most"), stage.get("left")
    if not done or most is None:
        return "Time left: it can be estimated once the largest structures are fitted." if seconds else ""
    passed = seconds / workers
    bound = passed * max(most - done, 0) / done
    budget = f"at most {rounded_time(bound)}, when {most} structures are fitted" if bound else "the budget is spent"
    if not left:
        return f"Time left: nothing is left to decide, only missed optima are looked for; {budget}."
    estimate = passed * left / max(stage.get("decided", 0), 1)
    if estimate >= bound:
        return f"Time left: {budget}."
    return f"Time left: about {rounded_time(estimate)} for the {left} parts that are left; {budget}."


def rounded_time(seconds: float) -> str:
    """Time in words, with one or two digits: an estimate is no better."""
    if seconds < 90.0:
        return f"{max(5 * round(seconds / 5.0), 5)} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
