"""Slow passes and reversals: a slow oscillation that grows or fades."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.planning.families.family import (
    CommandedMotion,
    Family,
    Setting,
    from_position,
    log_between,
    rest_window,
)

__all__ = ["FAMILY"]


def _slow_reversals_motion(x: Array, s: Setting) -> CommandedMotion:
    cycles = log_between(0.8, 8.0, x[0])
    phase = np.clip(s.t / (0.9 * s.duration), 0.0, 1.0)
    swing = np.sin(2.0 * np.pi * cycles * phase) * np.exp(4.0 * (x[1] - 0.5) * phase)
    bump = x[2] * np.sin(2.0 * np.pi * 3.0 * cycles * phase + 2.0 * np.pi * x[3]) / 3.0
    motion = from_position(s, (swing + bump) * rest_window(s), log_between(0.01, 1.3, x[4]))
    return CommandedMotion(motion, np.zeros(s.samples), float(x[5]))


FAMILY = Family("slow passes and reversals", 6, _slow_reversals_motion)
