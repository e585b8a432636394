"""Jerk-limited moves back and forth, with rests between them."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.excitation.motion import Motion, MotionLimits, moves
from brightgrey.planning.families.family import CommandedMotion, Family, Setting, log_between

__all__ = ["FAMILY"]

MOST_MOVES = 8
LEAST_DISTANCE = 1e-12  # a move of no length has no direction


def _point_to_point_motion(x: Array, s: Setting) -> CommandedMotion:
    count = 2 * (1 + int(x[0] * (MOST_MOVES // 2 - 1e-9)))
    speed = log_between(0.05, 1.5, x[1]) * s.limits.speed
    acceleration = log_between(0.1, 1.2, x[2]) * s.acceleration
    jerk = log_between(0.05, 1.0, x[3]) * s.limits.jerk
    rest = 0.25 * x[4] * s.duration / count
    before, room = 0.03 * s.duration, (0.9 * s.duration - rest * (count - 1)) / count
    distance = min(_distance_within(room, speed, acceleration, jerk), 1.3 * s.limits.travel) * log_between(
        0.1, 0.98, x[5]
    )
    targets = [distance if k % 2 == 0 else 0.0 for k in range(count)]
    motion = moves(
        targets, MotionLimits(speed, acceleration, jerk), dt=s.dt, samples=s.samples, before=before, between=rest
    )
    centred = -1.0 if x[6] > 0.5 else 1.0
    motion = Motion(motion.t, centred * motion.position, centred * motion.velocity, centred * motion.acceleration)
    return CommandedMotion(motion, np.zeros(s.samples), float(x[7]))


def _distance_within(time: float, speed: float, acceleration: float, jerk: float) -> float:
    """Distance of a move from rest to rest in a time, no more than the limits allow."""
    top = min(acceleration, 0.25 * jerk * time)
    if top <= 0.0:
        return LEAST_DISTANCE
    v = min(speed, top * max(0.5 * time - top / jerk, 0.0))
    phase = v / top + top / jerk  # of acceleration
    return max(0.98 * v * (phase + max(time - 2.0 * phase, 0.0)), LEAST_DISTANCE)


FAMILY = Family("point-to-point moves with rests", 8, _point_to_point_motion)
