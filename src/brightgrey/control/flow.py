"""One sampling interval ahead, with its derivative, for many parameter sets or states side by side.

An exponential Rosenbrock step (exprb32, Hochbruck, Ostermann, Schweitzer 2009, doi:10.1137/080717717): linear part
and ramp of the input exact, the bend of the laws to third order, whatever the slope of friction. The same matrix
exponential gives the transition matrix of the linearisation, which is what an extended Kalman filter asks for. The
compiled kernel is more accurate but gives no derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brightgrey.effects import Law
from brightgrey.kit import StateSpace

__all__ = ["Ahead", "Lanes", "ahead", "delayed_input", "exponential"]

Array = NDArray[np.float64]
_TAYLOR = 8
_SMALL = 0.3
_PIECES = (4, 16, 64)


@dataclass(frozen=True)
class _Wired:
    """One element with the lane on the first axis; low and high are None if it has no limits."""

    law: Law
    H: Array
    K: Array
    G: Array
    p: tuple[Array, ...]
    state: int
    low: Array
    high: Array

    @property
    def limited(self) -> bool:
        return self.state >= 0


@dataclass(frozen=True)
class Lanes:
    """A system with the parameter sets on the first axis, as batched matrix products want it.

    Attributes
    ----------
    A : ndarray, shape (K, n, n)
    B : ndarray, shape (K, n)
    C : ndarray, shape (K, outputs, n)
    elements : tuple
    rows : tuple of int
        ``StateSpace.derivative_rows``.
    speeds : ndarray of int
        Which states are speeds.
    """

    A: Array
    B: Array
    C: Array
    elements: tuple[_Wired, ...]
    rows: tuple[int, ...]
    speeds: NDArray[np.int64]

    @classmethod
    def of(cls, system: StateSpace, lanes: int = 1) -> Lanes:
        """Take a batch of K sets as it is; repeat one set `lanes` times."""
        K = system.batch[0] if system.batch else lanes

        def first(array: ArrayLike, rank: int) -> Array:
            a = np.asarray(array, float)
            a = np.moveaxis(a, -1, 0) if a.ndim > rank else a
            return np.ascontiguousarray(np.broadcast_to(a, (K, *(a.shape[-rank:] if rank else ()))))

        elements = tuple(
            _Wired(
                e.law,
                first(e.H, 2),
                first(e.K, 1),
                first(e.G, 1),
                tuple(first(p, 0) for p in e.p),
                e.limits.state if e.limits else -1,
                first(e.limits.lower if e.limits else 0.0, 0),
                first(e.limits.upper if e.limits else 0.0, 0),
            )
            for e in system.elements
        )
        speeds = np.array([i for i, state in enumerate(system.states) if state.at_rest == "speed"])
        A, B, C = first(system.A, 2), first(system.B, 2)[:, :, 0], first(system.C, 2)
        return cls(A, B, C, elements, system.derivative_rows, speeds)

    def picked(self, which: NDArray[np.int64]) -> Lanes:
        """Some of the lanes; one may come several times."""
        elements = tuple(
            replace(
                e,
                H=e.H[which],
                K=e.K[which],
                G=e.G[which],
                p=tuple(p[which] for p in e.p),
                low=e.low[which],
                high=e.high[which],
            )
            for e in self.elements
        )
        return replace(self, A=self.A[which], B=self.B[which], C=self.C[which], elements=elements)

    def field(self, z: Array, u: Array) -> tuple[Array, Array, Array]:
        """Z' (K, n), its derivative by z (K, n, n) and by u (K, n) at states (K, n) and inputs (K,)."""
        J, b = self.A.copy(), self.B.copy()
        rate = np.einsum("kij,kj->ki", self.A, z) + self.B * u[:, None]
        for e in self.elements:
            ports = np.einsum("kpj,kj->kp", e.H, z) + e.K * u[:, None]
            phi, slopes = e.law.value(tuple(ports.T), e.p)
            rate += e.G * np.broadcast_to(phi, u.shape)[:, None]
            for port, slope in enumerate(slopes):
                s = np.broadcast_to(slope, u.shape)[:, None]
                J += (s * e.G)[:, :, None] * e.H[:, port, None, :]
                b += s * e.G * e.K[:, port, None]
        return rate, J, b

    def measured(self, z: Array, u: Array) -> tuple[Array, Array]:
        """Outputs (K, outputs) and their derivative by z (K, outputs, n)."""
        C = self.C.copy()
        y = np.einsum("koj,kj->ko", self.C, z)
        if any(row >= 0 for row in self.rows):
            rate, J, _ = self.field(z, u)
            for out, row in enumerate(self.rows):
                if row >= 0:
                    C[:, out], y[:, out] = J[:, row], rate[:, row]
        return y, C

    def inside(self, z: Array) -> tuple[Array, Array]:
        """Put limited states back into their limits, along the way they act; the derivative of doing so."""
        n = z.shape[1]
        change = np.broadcast_to(np.eye(n), (len(z), n, n)).copy()
        z = z.copy()
        for e in self.elements:
            if e.limited:
                miss = np.clip(z[:, e.state], e.low, e.high) - z[:, e.state]
                out = miss != 0.0
                z += e.G * miss[:, None]
                z[:, e.state] = np.clip(z[:, e.state], e.low, e.high)
                change[out, :, e.state] -= e.G[out]
        return z, change


class Ahead(NamedTuple):
    """State after an interval (K, n), its derivative by the state before (K, n, n) and by a held input (K, n)."""

    z: Array
    by_state: Array
    by_input: Array


def ahead(lanes: Lanes, z: Array, u0: Array, u1: Array, dt: float, tolerance: Array) -> Ahead:
    """Carry states over one sampling interval, in as many steps as each lane needs.

    Parameters
    ----------
    lanes : Lanes
    z : ndarray, shape (K, n)
    u0, u1 : ndarray, shape (K,)
        Input at begin and end; a straight line between.
    dt : float
        Interval in s.
    tolerance : ndarray, shape (K,)
        How much the steps of second and third order may differ in any speed, rad/s (m/s). Where a gap closes or opens
        within an interval the steps are at most a sixteenth of it.
    """
    step, coarse = _steps(lanes, z, u0, u1, dt, 1, tolerance)
    for pieces in _PIECES:
        if not coarse.any():
            break
        again = np.flatnonzero(coarse)
        finer, still = _steps(lanes.picked(again), z[again], u0[again], u1[again], dt, pieces, tolerance[again])
        for whole, part in zip(step, finer, strict=True):
            whole[again] = part
        coarse[again] = still
    return step


def _steps(
    lanes: Lanes, z: Array, u0: Array, u1: Array, dt: float, pieces: int, tolerance: Array
) -> tuple[Ahead, NDArray[np.bool_]]:
    """Equal steps, and which lanes need smaller ones."""
    K, n = z.shape
    h = dt / pieces
    total = np.broadcast_to(np.eye(n), (K, n, n)).copy()
    by_input = np.zeros((K, n))
    slope = (u1 - u0) / dt
    coarse = np.zeros(K, bool)
    for part in range(pieces):
        u = u0 + slope * h * part
        rate, J, b = lanes.field(z, u)
        M = np.zeros((K, n + 3, n + 3))  # dz, 1, t, held input
        M[:, :n, :n], M[:, :n, n], M[:, :n, n + 1], M[:, :n, n + 2] = J, rate, b * slope[:, None], b
        M[:, n + 1, n] = 1.0
        E = exponential(M * h)
        moved = z + E[:, :n, n]
        after, _, _ = lanes.field(moved, u + slope * h)
        bend = after - rate - np.einsum("kij,kj->ki", J, E[:, :n, n]) - b * (slope * h)[:, None]
        for e in lanes.elements:
            if e.limited:  # a contact that is made or lost is no bend; it is gone through in small steps
                coarse |= (pieces < _PIECES[1]) & (np.abs(bend[:, e.state]) * h > tolerance * dt)
                bend -= e.G * bend[:, e.state, None]
        better = np.linalg.solve(np.eye(n) - 0.25 * h * J, bend[:, :, None])[:, :, 0] * (h / 3.0)
        coarse |= np.abs(better[:, lanes.speeds]).max(axis=1, initial=0.0) > tolerance
        z, put = lanes.inside(moved + better)
        by_input = np.einsum("kij,kj->ki", put, np.einsum("kij,kj->ki", E[:, :n, :n], by_input) + E[:, :n, n + 2])
        total = put @ E[:, :n, :n] @ total
    return Ahead(z, total, by_input), coarse


def exponential(M: Array) -> Array:
    """Matrix exponentials, shape (K, m, m), by Taylor series and squaring, each matrix for itself."""
    size = np.abs(M).sum(axis=2).max(axis=1)
    halvings = np.ceil(np.log2(np.maximum(size / _SMALL, 1.0)))
    halvings = np.where(np.isfinite(halvings), halvings, 0.0).astype(int)
    scaled = M / 2.0 ** halvings[:, None, None]
    one = np.eye(M.shape[1])
    E = one + scaled / _TAYLOR
    for k in range(_TAYLOR - 1, 0, -1):
        E = one + scaled @ E / k
    for i in range(int(halvings.max(initial=0))):
        again = halvings > i
        E[again] = E[again] @ E[again]
    return np.asarray(E)


def delayed_input(u: Array, dt: float, delay: Array, hold: str) -> tuple[Array, Array]:
    """Delayed input at begin and end of every interval, both shape (samples - 1, K).

    A held input is replaced by its mean over the interval, a straight line between samples by the one through the
    delayed values there: exact for delays of whole samples.

    Parameters
    ----------
    u : ndarray, shape (samples, K)
    dt : float
    delay : ndarray, shape (K,)
        In s.
    hold : {'linear', 'zoh'}
    """
    samples, K = u.shape
    whole = np.floor(delay / dt + 1e-9).astype(int)
    part = delay / dt - whole
    k = np.arange(samples)[:, None]
    lane = np.arange(K)
    near, far = u[np.maximum(k - whole, 0), lane], u[np.maximum(k - whole - 1, 0), lane]
    mixed = (1.0 - part) * near + part * far
    return (mixed[:-1], mixed[1:]) if hold == "linear" else (mixed[:-1], mixed[:-1])
