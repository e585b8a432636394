"""Time that a search may take yet, as far as it can be told: for the parts of the border that are left."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["rounded_time", "time_left"]


def time_left(stage: Mapping[str, Any], seconds: float, workers: int) -> str:
    """Sentences on the time that is left; empty before anything has been computed.

    The estimate takes the parts of the border that are left to be as costly as those that are decided. It leaves out
    parts that open later and the look for missed optima in the end, and says so: on measured axes these take longer
    than the rest. The budget counts structures, not time.

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
    budget = f"{done} of at most {most} structures are fitted"
    if done >= most:
        budget = f"the budget of {most} structures is spent, so that only simpler ones are still tried"
    if not left:
        return (
            "Time left: unknown. Nothing is left to decide at the moment; missed optima are looked for, which may open "
            f"parts again. Budget: {budget}."
        )
    estimate = seconds / workers * left / max(stage.get("decided", 0), 1)
    parts = "1 part that is left" if left == 1 else f"{left} parts that are left"
    return (
        f"Time left: about {rounded_time(estimate)} for the {parts}. More may open, and missed optima are looked for "
        f"in the end. Budget: {budget}."
    )


def rounded_time(seconds: float) -> str:
    """Time in words, with one or two digits: an estimate is no better."""
    if seconds < 90.0:
        return f"{max(5 * round(seconds / 5.0), 5)} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
