"""State-space form into which every structure is assembled (paper figure 4, eq. 17 and 18)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Element, State

__all__ = ["Linear", "StateSpace"]


class Linear(NamedTuple):
    """Linearisation x' = A x + B u, y = C x + D u of deviations from an operating point."""

    A: Array
    B: Array
    C: Array
    D: Array


@dataclass(frozen=True)
class StateSpace:
    """``x' = A x + B u + f(x, u)``, ``y = C x + D u + g(x, u)``, with dead time on u.

    Matrices may carry one trailing axis over K parameter sets; the methods are for a single set.

    Attributes
    ----------
    A : ndarray, shape (n, n) or (n, n, K)
    B : ndarray, shape (n, 1) or (n, 1, K)
    C, D : ndarray, shape (outputs, n), (outputs, 1), or with K
        Linear part of the outputs. Acceleration outputs are rows of x'.
    elements : tuple of Element
        Non-linearities in feedback, f = sum of G phi(H x + K u).
    dead_time : float or ndarray, shape () or (K,)
        Delay of u in s.
    states : tuple of State
        Names and dimensions of x.
    outputs : tuple of str
        ``position``, ``velocity`` or ``acceleration`` of mass 1; of another mass as ``velocity@2``.
    derivative_rows : tuple of int
        For each output its row of x', or -1 if it is a row of x.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    elements: tuple[Element, ...]
    dead_time: float | Array
    states: tuple[State, ...]
    outputs: tuple[str, ...]
    derivative_rows: tuple[int, ...]

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states, in the order q, q', lambda, T."""
        return tuple(state.name for state in self.states)

    @property
    def batch(self) -> tuple[int, ...]:
        """() for one parameter set, (K,) for K of them."""
        return self.A.shape[2:]

    def f(self, x: Array, u: float) -> Array:
        """Non-linear part of x', shape (n,) (eq. 17)."""
        total = np.zeros(len(self.states))
        for e in self.elements:
            phi, _ = e.law.value(tuple(e.H @ x + e.K * u), e.p)
            total += e.G * phi
        return total

    def g(self, x: Array, u: float) -> Array:
        """Non-linear part of the outputs, shape (outputs,) (eq. 18): rows of f where an output is a row of x'."""
        if max(self.derivative_rows, default=-1) < 0:
            return np.zeros(len(self.derivative_rows))
        f = self.f(x, u)
        return np.array([f[row] if row >= 0 else 0.0 for row in self.derivative_rows])

    def derivative(self, x: Array, u: float) -> Array:
        """f_sys: x' for state `x`, shape (n,), and delayed input `u` (eq. 17)."""
        return np.asarray(self.A @ x + self.B[:, 0] * u + self.f(x, u))

    def output(self, x: Array, u: float) -> Array:
        """f_out: y for state `x`, shape (n,), and delayed input `u` (eq. 18)."""
        return np.asarray(self.C @ x + self.D[:, 0] * u + self.g(x, u))

    def linearise(self, x: Array, u: float = 0.0) -> Linear:
        """Exact linearisation at (x, u): A + sum of G phi' H, and likewise B, C and D."""
        A, B = self.A.copy(), self.B.copy()
        for e in self.elements:
            _, slopes = e.law.value(tuple(e.H @ x + e.K * u), e.p)
            for port, slope in enumerate(slopes):
                A += slope * np.outer(e.G, e.H[port])
                B[:, 0] += slope * e.G * e.K[port]
        C, D = self.C.copy(), self.D.copy()
        for out, row in enumerate(self.derivative_rows):
            if row >= 0:
                C[out], D[out] = A[row], B[row]
        return Linear(A, B, C, D)

    def rest(self, position: float = 0.0, speed: float = 0.0, u: float = 0.0) -> Array:
        """State, shape (n,), with all masses at `position`, moving at `speed`, and T = `u`."""
        values = {"position": position, "speed": speed, "zero": 0.0, "input": u}
        return np.array([values[state.at_rest] for state in self.states])
