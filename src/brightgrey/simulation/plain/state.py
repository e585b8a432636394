"""Memory of a plain simulation in progress: state, modes and forces."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from brightgrey.arrays import Array
from brightgrey.simulation.kernel.lowering import Lowered
from brightgrey.simulation.kernel.tolerances import TOLERANCES
from brightgrey.simulation.plain.dry_friction import DryFriction
from brightgrey.simulation.settings import Tolerances

__all__ = ["CLOSED", "FREE", "LOWER", "UPPER", "Simulation"]

FREE, UPPER, LOWER, CLOSED = 0, 1, -1, 2


@dataclass
class Simulation:
    """Memory of a simulation in progress. It is mutable, unlike other objects of the package."""

    low: Lowered
    tolerance: Tolerances
    scale: float
    hold: str
    tick: float
    ticks: int
    points: int
    x: Array
    force: Array
    slope: Array
    friction: DryFriction
    modes: list[int] = field(default_factory=list)
    propagators: dict[tuple[tuple[bool, ...], float], Array] = field(default_factory=dict)

    def matrix(self) -> Array:
        """System matrix of the present mode, in which free limited states move with their rate."""
        A = self.low.A[:, :, 0].copy()
        for element, mode in zip(self.low.limited, self.modes, strict=True):
            if mode == FREE:
                A += np.outer(element.G.reshape(-1), element.H[0].reshape(-1))
        return A

    def propagator(self, span: float) -> Array:
        """Top rows of the exponential: weights of x, u, its slope, 1, F at the start, its slope."""
        key = (tuple(mode == FREE for mode in self.modes), span)
        if key not in self.propagators:
            n, m = len(self.x), len(self.force)
            M = np.zeros((n + 3 + 2 * m, n + 3 + 2 * m))
            M[:n, :n] = self.matrix()
            M[:n, n], M[n, n + 1], M[:n, n + 2] = self.low.B[:, 0], 1.0, self.low.c[:, 0]
            M[:n, n + 3 : n + 3 + m] = self.low.G[:, :, 0].T
            M[n + 3 : n + 3 + m, n + 3 + m :] = np.eye(m)
            self.propagators[key] = expm(M * span)[:n]
        return self.propagators[key]

    def kink(self, span: float) -> Array:
        """State after a ramp of unit slope (held input: a unit jump) that began `span` ago."""
        column = len(self.x) + (1 if self.hold == "linear" else 0)
        return self.propagator(span)[:, column] if span > 0.0 else np.zeros_like(self.x)

    def laws(self, z: Array) -> tuple[Array, Array]:
        """Force and slope of every channel at its port."""
        force, slope = np.zeros_like(z), np.zeros_like(z)
        for element, k in self.low.smooth:
            if self.low.stopped[k] < 0 or element.law.amplitude is None:
                phi, slopes = element.law.value((z[k],), tuple(float(np.ravel(p)[0]) for p in element.p))
                force[k] += phi
                slope[k] += slopes[0]
        for k in self.friction.dry:
            phi, rise = self.friction.sliding(k, float(z[k]))
            force[k] += phi
            slope[k] += rise
        return force, slope

    def rates(self, value: float, force: Array) -> Array:
        """Rates of all states at input `value` under the forces of all channels."""
        rates = self.matrix() @ self.x + self.low.B[:, 0] * value + self.low.c[:, 0]
        return np.asarray(rates + self.low.G[:, :, 0].T @ force)

    def needed(self, k: int, value: float) -> float:
        """Friction that keeps the mass of channel k at rest."""
        force = self.laws(self.low.H[:, :, 0] @ self.x + self.low.through[:, 0] * value)[0]
        return self.friction.needed(k, self.rates(value, force), force)

    def forces(self, value: float) -> Array:
        """Force of every channel at the present state and input `value`."""
        force = self.laws(self.low.H[:, :, 0] @ self.x + self.low.through[:, 0] * value)[0]
        for k in self.friction.sticking:
            force[k] = self.needed(k, value)
        return force

    def watched(self, b: int, x: Array) -> float:
        """Limited state b if it is free, otherwise its rate."""
        element = self.low.limited[b]
        assert element.limits is not None
        row = element.H[0].reshape(-1)
        return float(x[element.limits.state] if self.modes[b] == FREE else row @ x)

    def interval(self, b: int) -> tuple[float, float]:
        """Interval in which the watched quantity has to stay; at a limit, rounding does not set it free."""
        element = self.low.limited[b]
        limits = element.limits
        assert limits is not None
        rounding = float(TOLERANCES.contact_rounding * np.abs(element.H[0].reshape(-1) * self.x).sum())
        return {
            FREE: (float(np.ravel(limits.lower)[0]), float(np.ravel(limits.upper)[0])),
            UPPER: (-rounding, np.inf),
            LOWER: (-np.inf, rounding),
            CLOSED: (-np.inf, np.inf),
        }[self.modes[b]]
