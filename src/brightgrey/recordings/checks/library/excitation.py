"""Motion: is it rich enough to show inertia and friction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.recordings.checks.check import Check, CheckResult, note, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.checks.force_balance import balances


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    clear: float = 3.0
    """Standard errors from which a part of the input shows."""
    moving: float = 0.05
    """Part of the largest speed from which the drive moves in a direction."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Look at the standard error of the inertia, and at the directions of the motion."""
    if not (found := balances(examined)):
        return
    motion = found[0].motion
    shows = max(abs(balance.deviations("inertia")) for balance in found)
    figure = f"the inertia is {shows:.1f} standard errors from zero"
    if shows < POLICY.clear:
        yield note(
            figure,
            "the acceleration hardly shows in the input beside friction and gravity: inertia, elasticity and gaps are"
            " uncertain. Record faster changes of speed, or more of them",
            f"{POLICY.clear:g} standard errors",
        )
    else:
        yield passed(figure, f"{POLICY.clear:g} standard errors")
    largest = float(np.abs(motion.velocity).max())
    ways = [float(np.mean(sign * motion.velocity > POLICY.moving * largest)) for sign in (1.0, -1.0)]
    figure = f"{100 * ways[0]:.0f} % of the time forwards, {100 * ways[1]:.0f} % backwards"
    if min(ways) == 0.0:
        yield note(
            figure,
            "the drive moves in one direction only: Coulomb friction and gravity act alike there. Record both"
            " directions to tell them apart",
        )
    else:
        yield passed(figure)


CHECK = Check("motion", "Does the motion show inertia, and friction in both directions?", run)
