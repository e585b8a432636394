"""Family of motions: from numbers between 0 and 1 to a motion and a torque on top of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.excitation.motion import Motion
from brightgrey.planning.limits import MachineLimits

__all__ = ["CommandedMotion", "Family", "Setting", "at_rest", "from_position", "log_between", "rest_window"]


@dataclass(frozen=True)
class Setting:
    """Drive, limits and time that a motion is made for."""

    dt: float  #: Sampling time in s.
    samples: int
    limits: MachineLimits
    #: Slowest resonance of the drive in Hz; a hundredth of the sampling rate if it has a single mass.
    resonance: float
    breakaway: float  #: Friction near standstill in N m (N).
    #: Largest acceleration of the rigid drive within the limits of torque and acceleration, rad/s² (m/s²).
    acceleration: float

    @property
    def t(self) -> Array:
        """Time in s, shape (samples,)."""
        return np.asarray(self.dt * np.arange(self.samples), float)

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.dt * self.samples


class CommandedMotion(NamedTuple):
    """A motion that the rigid drive is to make, and torque that is added to what it needs."""

    motion: Motion
    torque: Array  #: N m (N), shape (samples,).
    #: Part of the friction that the torque compensates: with less, the drive coasts to standstill.
    compensation: float


@dataclass(frozen=True)
class Family:
    """A family of motions.

    Attributes
    ----------
    name : str
        For a sentence: "slow passes and reversals".
    numbers : int
        Numbers between 0 and 1 that a motion is made of.
    make : callable
        ``make(numbers, setting)`` gives the motion.
    """

    name: str
    numbers: int
    make: Callable[[Array, Setting], CommandedMotion]


def log_between(low: float, high: float, share: float) -> float:
    """Number between two positive ones, evenly in the logarithm."""
    return float(low * (high / low) ** share)


def rest_window(setting: Setting, ramp: float = 0.05, rest: float = 0.1) -> Array:
    """Smooth window, shape (samples,): zero at the begin and for the last part `rest` of the time."""
    x = setting.t / setting.duration
    rise, fall = (np.clip(a, 0.0, 1.0) for a in ((x - 0.02) / ramp, (1.0 - rest - x) / ramp))
    return np.asarray((rise**2 * (3.0 - 2.0 * rise)) * (fall**2 * (3.0 - 2.0 * fall)))


def at_rest(setting: Setting) -> Motion:
    """Motion that stays where it is."""
    zero = np.zeros(setting.samples)
    return Motion(setting.t, zero, zero, zero)


def from_position(setting: Setting, position: Array, size: float) -> Motion:
    """Motion along a smooth course of the position, as large as the part `size` of what the limits allow."""
    v = np.gradient(position, setting.dt)
    a = np.gradient(v, setting.dt)
    limits = setting.limits
    allowed = [
        high / max(float(np.abs(x).max()), 1e-300)
        for x, high in ((v, limits.speed), (a, setting.acceleration), (position, 0.5 * limits.travel))
    ]
    scale = size * min(allowed)
    return Motion(setting.t, scale * position, scale * v, scale * a)
