"""Torques that no effect describes but that a residual may follow, each with the symptom it means.

A new symptom of this kind is one more entry of `TORQUE_PATTERNS`; CONTRIBUTING.md shows an example.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales

__all__ = ["TORQUE_PATTERNS", "SimulatedMotion", "TorquePattern"]


@dataclass(frozen=True)
class SimulatedMotion:
    """Simulated motion of mass 1 in one recording, rad/s and rad (m/s, m), shape (samples,)."""

    speed: Array
    position: Array

    def relative_position(self) -> Array:
        """Position between -1 and 1 over the travel of the recording."""
        middle = 0.5 * (self.position.max() + self.position.min())
        return np.asarray((self.position - middle) / max(0.5 * float(np.ptp(self.position)), np.finfo(float).tiny))


@dataclass(frozen=True)
class TorquePattern:
    """Torque that may be missing in a model, and the symptom if the residual follows it.

    Attributes
    ----------
    name : str
        Unique name; no effect may have it.
    torques : callable
        ``torques(motion, sign, scales)`` gives one or more arrays of shape (samples,), 1 at most in size. `sign` is
        the smoothed sign of the speed, `scales` holds the largest speed of the recordings.
    title : str
        Title of the symptom, a few words.
    follows : str
        What the residual follows then; it completes "the residual follows".
    advice : str
        What to try; one sentence without its full stop.
    """

    name: str
    torques: Callable[[SimulatedMotion, Array, Scales], tuple[Array, ...]]
    title: str
    follows: str
    advice: str


TORQUE_PATTERNS = (
    TorquePattern(
        "direction",
        lambda m, sign, scales: (sign**2, sign * m.speed / scales.speed),
        "Friction depends on the direction",
        "a torque that acts in motion only and in one direction",
        "no effect describes it; constant torque takes a part of it, and friction near standstill is uncertain",
    ),
    TorquePattern(
        "square of speed",
        lambda m, sign, scales: (sign * (m.speed / scales.speed) ** 2,),
        "Friction grows with the square of speed",
        "the square of speed against the motion",
        "no effect describes it (air, churning oil); use the model within the speeds of the recording",
    ),
    TorquePattern(
        "position",
        lambda m, sign, scales: (sign * m.relative_position(), sign**2 * m.relative_position()),
        "Torque or friction depends on the position",
        "the position",
        "no effect describes it (cables, springs, a misaligned guide); record only the part of the travel in use",
    ),
)
"""All patterns that are tried, in the order in which symptoms are named."""
