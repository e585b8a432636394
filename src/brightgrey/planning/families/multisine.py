"""Multisine: a sum of sines with chosen amplitudes and phases as the course of the position (Swevers et al. 1997)."""

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

HARMONICS = np.array([1.0, 2.0, 3.0, 5.0, 8.0])  # of the base frequency: close ones add up


def _multisine_motion(x: Array, s: Setting) -> CommandedMotion:
    base = log_between(1.0, 6.0, x[0]) / s.duration
    tilt = -2.0 + 2.0 * x[1]  # of the amplitudes of position; -2 gives an even acceleration
    k, phase = HARMONICS[:, None], 2.0 * np.pi * x[2 : 2 + HARMONICS.size, None]
    position = np.sum(k**tilt * np.sin(2.0 * np.pi * base * k * s.t + phase), axis=0)
    motion = from_position(s, position * rest_window(s), log_between(0.1, 1.5, x[7]))
    return CommandedMotion(motion, np.zeros(s.samples), float(x[8]))


FAMILY = Family("multisine", 9, _multisine_motion)
