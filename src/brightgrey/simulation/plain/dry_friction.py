"""Dry friction with an exact sign in the plain twin: which masses slide, and which ones stick.

Friction of one mass acts on no other, so each has a mode of its own. A mass that slides to side s = 1 or -1 feels
-s A(|v|). A mass that sticks has v = 0, and feels the force that this needs, up to the breakaway torque A(0).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from brightgrey.arrays import Array
from brightgrey.simulation.kernel.lowering import Lowered

__all__ = ["DryFriction"]


@dataclass
class DryFriction:
    """Modes of all channels: side 1 or -1 of the one that slides, 0 of the one that sticks."""

    low: Lowered
    sides: list[float] = field(default_factory=list)

    @property
    def dry(self) -> list[int]:
        """Channels with dry friction."""
        return [k for k, state in enumerate(self.low.stopped) if state >= 0]

    @property
    def sticking(self) -> list[int]:
        """Channels whose mass sticks."""
        return [k for k in self.dry if self.sides[k] == 0.0]

    def sliding(self, k: int, z: float) -> tuple[float, float]:
        """Force and slope at speed z in the present mode; on the wrong side of zero, the tangent continues the law."""
        side = self.sides[k]
        if side == 0.0:
            return 0.0, 0.0
        speed = max(side * z, 0.0)
        a, rise = self._amplitude(k, speed)
        return -side * (a + rise * (side * z - speed)), -rise

    def breakaway(self, k: int) -> float:
        """Largest friction at rest."""
        return self._amplitude(k, 0.0)[0]

    def _amplitude(self, k: int, speed: float) -> tuple[float, float]:
        total, slope = 0.0, 0.0
        for element, channel in self.low.smooth:
            if channel == k and element.law.amplitude is not None:
                a, rise = element.law.amplitude(speed, tuple(float(np.ravel(p)[0]) for p in element.p[:-1]))
                total, slope = total + float(a), slope + float(rise)
        return total, slope

    def needed(self, k: int, rates: Array, force: Array) -> float:
        """Friction that keeps the mass of channel k at rest, for the rates of the states under all forces `force`."""
        state = self.low.stopped[k]
        by_force = self.low.G[k, state, 0]
        return float(force[k] - rates[state] / by_force)

    def rate_at_rest(self, k: int, rates: Array, force: Array) -> float:
        """Acceleration of a mass at rest: friction takes what it can, so that only an excess accelerates."""
        needed, most = self.needed(k, rates, force), self.breakaway(k)
        return float(self.low.G[k, self.low.stopped[k], 0] * (np.clip(needed, -most, most) - needed))

    def side_of(self, k: int, needed: float) -> float:
        """Mode of a mass at rest: it sticks if friction can hold it, else it follows what drives it."""
        return 0.0 if abs(needed) <= self.breakaway(k) else -float(np.sign(needed))

    def interval(self, k: int) -> tuple[float, float]:
        """Interval of the watched quantity: side times speed of a mass that slides, friction of one that sticks."""
        return (0.0, np.inf) if self.sides[k] else (-self.breakaway(k), self.breakaway(k))

    def stop(self, x: Array, before: Array) -> None:
        """Hold masses that stick exactly, where `before` was the state."""
        for k in self.sticking:
            x[self.low.stopped[k]] = 0.0
            if self.low.held[k] >= 0:
                x[self.low.held[k]] = before[self.low.held[k]]
