"""Time that a search may take yet, as far as it can be told: for the parts of the border that are left."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["rounded_time", "time_left"]


def time_left(stage: Mapping[str, Any], seconds: float, workers: int) -> str:
    """Sentences on the time that is left; empty before anything has been computed.

    How many parts open yet is not known, so two times are told, both at the pace of this run. The first is that of one
    structure for each part that is left, the second that of all structures of the budget. The look for missed optima
    and the verdicts in the end fit no further structures, and are in neither.

    Parameters
    ----------
    stage : mapping
        Of a run's status: `done`, the structures that are fitted, and of a border `left` and `most`.
    seconds : float
        Computing time so far in s, of all workers together.
    workers : int
    """
    done, most, left = stage.get("done", 0), stage.get("most"), stage.get("left")
    if not done or most is None:
        return "Time left: it can be estimated once the largest structures are fitted." if seconds else ""
    pace = seconds / workers / done
    spent = rounded_time(pace * (most - done))
    budget = f"At this pace the budget of {most} structures is spent in {spent}; then only simpler ones are tried."
    if done >= most:
        budget = f"The budget of {most} structures is spent: only simpler ones are still tried."
    if not left:
        return (
            "Time left: unknown. Nothing is left to decide at the moment. Missed optima are looked for, which may open "
            f"parts again, and verdicts are made. {budget}"
        )
    parts = "1 part that is left" if left == 1 else f"{left} parts that are left"
    return (
        f"Time left: at least {rounded_time(pace * left)}, for the {parts}. More may open, and missed optima are "
        f"looked for in the end. {budget}"
    )


def rounded_time(seconds: float) -> str:
    """Time in words, with one or two digits: an estimate is no better."""
    if seconds < 90.0:
        return f"{max(5 * round(seconds / 5.0), 5)} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
