"""Relay motion: small torque steps back and forth, which let the first mass cross a gap while the load rests."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.planning.families.family import CommandedMotion, Family, Setting, at_rest, log_between, rest_window

__all__ = ["FAMILY"]


def _relay_motion(x: Array, s: Setting) -> CommandedMotion:
    cycles = log_between(2.0, 40.0, x[0])
    growth = np.exp(2.0 * (x[1] - 0.5) * s.t / s.duration)
    size = log_between(0.5, 4.0, x[2]) * max(s.breakaway, 0.01 * s.limits.torque)
    sharp = log_between(1.0, 30.0, x[3])
    wave = np.tanh(sharp * np.sin(2.0 * np.pi * cycles * s.t / s.duration)) / np.tanh(sharp)
    return CommandedMotion(at_rest(s), size * growth * wave * rest_window(s), 0.0)


FAMILY = Family("relay motion", 4, _relay_motion)
