"""Physical quantities of a drive: their dimensions, and how large they are in a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

__all__ = [
    "ANGLE",
    "DAMPING",
    "INERTIA",
    "PER_POSITION",
    "PER_SPEED",
    "POSITION",
    "SPEED",
    "STIFFNESS",
    "TIME",
    "TORQUE",
    "Dimension",
    "Scales",
]


class Dimension(NamedTuple):
    """Unit of a quantity as powers of the input's unit (N m, N), the unit of motion (rad, m) and the second."""

    input: int
    motion: int
    time: int


TORQUE = Dimension(input=1, motion=0, time=0)
POSITION = Dimension(input=0, motion=1, time=0)
SPEED = Dimension(input=0, motion=1, time=-1)
PER_POSITION = Dimension(input=0, motion=-1, time=0)
PER_SPEED = Dimension(input=0, motion=-1, time=1)
ANGLE = Dimension(input=0, motion=0, time=0)
"""Of a phase in rad; it has no unit of the recording."""
TIME = Dimension(input=0, motion=0, time=1)
INERTIA = Dimension(input=1, motion=-1, time=2)
STIFFNESS = Dimension(input=1, motion=-1, time=0)
DAMPING = Dimension(input=1, motion=-1, time=1)
"""Of a damper, and of viscous friction."""


@dataclass(frozen=True)
class Scales:
    """Sizes of the quantities in a recording, in SI units. Effects declare bounds and starts as multiples of them.

    Attributes
    ----------
    torque, speed, acceleration, travel : float
        Largest magnitudes of the input, the speed and the acceleration, and the range of the position, in N m (N),
        rad/s (m/s), rad/s² (m/s²) and rad (m).
    interval, duration : float
        Sampling time and length of the recording in s.
    inertia, friction, viscous, offset : float
        Coefficients of a linear regression of the input on acceleration, sign of speed, speed and a constant:
        total inertia, Coulomb friction, viscous friction, and the constant torque that moves nothing.
    inertia_factor : float
        Factor by which the total inertia may be smaller: where the regression does not hold, it is an upper limit.
    """

    torque: float
    speed: float
    acceleration: float
    travel: float
    interval: float
    duration: float
    inertia: float
    friction: float
    viscous: float
    offset: float
    inertia_factor: float = 1.0
