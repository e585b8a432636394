"""Pseudo-random binary torque that is clocked at the resonance or faster, on a slow motion."""

from __future__ import annotations

import numpy as np
from scipy.signal import max_len_seq

from brightgrey.arrays import Array
from brightgrey.planning.families.chirp import slow_motion
from brightgrey.planning.families.family import (
    CommandedMotion,
    Family,
    Setting,
    from_position,
    log_between,
    rest_window,
)

__all__ = ["FAMILY"]


def _pseudo_random_motion(x: Array, s: Setting) -> CommandedMotion:
    motion = from_position(s, slow_motion(1.0, log_between(1.0, 4.0, x[0]), s), log_between(0.02, 0.8, x[1]))
    clock = max(round(1.0 / (log_between(1.0, 8.0, x[2]) * s.resonance * s.dt)), 2)
    bits = 2.0 * max_len_seq(10)[0] - 1.0
    first = int(x[3] * (len(bits) - 1))
    levels = np.roll(bits, -first)[np.arange(s.samples) // clock % len(bits)]
    slope = s.limits.jerk * s.limits.torque / s.acceleration * s.dt
    size = (0.03 + 0.97 * x[4]) * s.limits.torque
    edge = min(max(int(np.ceil(2.0 * size / slope)), 1), s.samples)
    total = np.cumsum(np.concatenate([np.zeros(edge), levels]))
    torque = size * (total[edge:] - total[:-edge]) / edge * rest_window(s)
    return CommandedMotion(motion, torque, float(x[5]))


FAMILY = Family("pseudo-random binary torque", 6, _pseudo_random_motion)
