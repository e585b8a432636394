"""Torque ramps from standstill to beyond breakaway, in both directions."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.planning.families.family import CommandedMotion, Family, Setting, at_rest, log_between, rest_window

__all__ = ["FAMILY"]


def _torque_ramps_motion(x: Array, s: Setting) -> CommandedMotion:
    cycles = log_between(1.0, 12.0, x[0])
    phase = cycles * s.t / (0.9 * s.duration)
    triangle = 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * phase))
    size = log_between(0.8, 5.0, x[1]) * max(s.breakaway, 0.01 * s.limits.torque)
    bias = 0.3 * (x[2] - 0.5)
    return CommandedMotion(at_rest(s), size * (triangle + bias) * (1.0 + x[3] * (phase / cycles)) * rest_window(s), 0.0)


FAMILY = Family("torque ramps from standstill", 4, _torque_ramps_motion)
