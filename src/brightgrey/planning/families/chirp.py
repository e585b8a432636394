"""Torque chirp from below the slowest resonance to above it, on a slow motion that keeps friction sliding."""

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

__all__ = ["FAMILY", "slow_motion"]


def slow_motion(share: float, cycles: float, s: Setting) -> Array:
    """Course of a slow motion out and back."""
    return np.asarray((1.0 - np.cos(2.0 * np.pi * cycles * s.t / s.duration)) * rest_window(s) * share)


def _chirp_motion(x: Array, s: Setting) -> CommandedMotion:
    motion = from_position(s, slow_motion(1.0, log_between(1.0, 4.0, x[0]), s), log_between(0.02, 0.8, x[1]))
    low = log_between(min(1.0 / s.duration, s.resonance), s.resonance, x[2])
    high = log_between(s.resonance, max(0.25 / s.dt, s.resonance), x[3])
    rate = np.log(max(high / low, 1.01)) / s.duration
    phase = 2.0 * np.pi * low * np.expm1(rate * s.t) / rate
    torque = (0.03 + 0.97 * x[4]) * s.limits.torque * np.sin(phase) * rest_window(s)
    return CommandedMotion(motion, torque, float(x[5]))


FAMILY = Family("torque chirp", 6, _chirp_motion)
