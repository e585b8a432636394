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

from brightgrey.arrays import Array
from brightgrey.effects import Law
from brightgrey.kit import StateSpace

__all__ = ["DelayedInput", "ElementBatch", "Propagated", "delay_input", "matrix_exponential", "propagate_states"]

TAYLOR_ORDER = 8
TAYLOR_MAX_NORM = 0.3
_PIECES = (4, 16, 64)
_SOON = 0.1  # of a step


@dataclass(frozen=True)
class _BatchElement:
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
    def has_limits(self) -> bool:
        return self.state >= 0

    def contact_condition(self) -> tuple[Array, Array]:
        """Row (K, n) of the state that decides a contact against the limits, and how fast the limited state follows."""
        pull = -self.H[:, 0, self.state]
        row = self.H[:, 0] / pull[:, None]
        row[:, self.state] = 0.0
        return row, pull


@dataclass(frozen=True)
class ElementBatch:
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
    elements: tuple[_BatchElement, ...]
    derivative_rows: tuple[int, ...]
    speeds: NDArray[np.int64]

    @classmethod
    def of(cls, system: StateSpace, lanes: int = 1) -> ElementBatch:
        """Take a batch of K sets as it is; repeat one set `lanes` times."""
        K = system.batch[0] if system.batch else lanes

        def first(array: ArrayLike, rank: int) -> Array:
            a = np.asarray(array, float)
            a = np.moveaxis(a, -1, 0) if a.ndim > rank else a
            return np.ascontiguousarray(np.broadcast_to(a, (K, *(a.shape[-rank:] if rank else ()))))

        elements = tuple(
            _BatchElement(
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

    def select(self, which: NDArray[np.int64]) -> ElementBatch:
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

    def linearise(self, z: Array, u: Array) -> tuple[Array, Array, Array]:
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

    def outputs(self, z: Array, u: Array) -> tuple[Array, Array, Array]:
        """Outputs (K, outputs) and their derivatives by z (K, outputs, n) and by u (K, outputs)."""
        C = self.C.copy()
        y = np.einsum("koj,kj->ko", self.C, z)
        D = np.zeros(y.shape)
        if any(row >= 0 for row in self.derivative_rows):
            rate, J, b = self.linearise(z, u)
            for out, row in enumerate(self.derivative_rows):
                if row >= 0:
                    C[:, out], y[:, out], D[:, out] = J[:, row], rate[:, row], b[:, row]
        return y, C, D

    def clip_to_limits(self, z: Array, u: Array | None = None, soon: Array | None = None) -> tuple[Array, Array]:
        """Put limited states into their limits, along the way they act; the derivative of doing so.

        With inputs `u`, those that would reach a limit within the times `soon` are put there, too: a state that a
        filter has found a hair's breadth off a closed contact would else run through it.
        """
        n = z.shape[1]
        change = np.broadcast_to(np.eye(n), (len(z), n, n)).copy()
        z = z.copy()
        for e in self.elements:
            if e.has_limits:
                wanted = z[:, e.state]
                if u is not None and soon is not None:
                    rate = np.einsum("kj,kj->k", e.H[:, 0], z) + e.K[:, 0] * u
                    wanted = wanted + rate * soon
                    wanted = np.where((wanted > e.low) & (wanted < e.high), z[:, e.state], wanted)
                miss = np.clip(wanted, e.low, e.high) - z[:, e.state]
                out = miss != 0.0
                z += e.G * miss[:, None]
                z[:, e.state] = np.clip(z[:, e.state], e.low, e.high)
                change[out, :, e.state] -= e.G[out]
        return z, change


class Propagated(NamedTuple):
    """State after an interval (K, n), its derivative by the state before (K, n, n) and by a held input (K, n)."""

    z: Array
    by_state: Array
    by_input: Array


def propagate_states(
    batch: ElementBatch, z: Array, u0: Array, u1: Array, dt: ArrayLike, tolerance: Array
) -> Propagated:
    """Carry states over an interval, in as many steps as each lane needs.

    Parameters
    ----------
    lanes : Lanes
    z : ndarray, shape (K, n)
    u0, u1 : ndarray, shape (K,)
        Input at begin and end; a straight line between.
    dt : float or ndarray, shape (K,)
        Interval in s; 0 leaves a lane as it is.
    tolerance : ndarray, shape (K,)
        How much the steps of second and third order may differ in any speed, rad/s (m/s). Where a gap closes or opens
        within an interval the steps are at most a sixteenth of it.
    """
    span = np.broadcast_to(np.asarray(dt, float), (len(z),))
    step, coarse = _equal_steps(batch, z, u0, u1, span, 1, tolerance)
    for pieces in _PIECES:
        if not coarse.any():
            break
        again = np.flatnonzero(coarse)
        finer, still = _equal_steps(
            batch.select(again), z[again], u0[again], u1[again], span[again], pieces, tolerance[again]
        )
        for whole, part in zip(step, finer, strict=True):
            whole[again] = part
        coarse[again] = still
    return step


def _equal_steps(
    lanes: ElementBatch, z: Array, u0: Array, u1: Array, dt: Array, pieces: int, tolerance: Array
) -> tuple[Propagated, NDArray[np.bool_]]:
    """Equal steps, and which lanes need smaller ones."""
    K, n = z.shape
    h = dt / pieces
    total = np.broadcast_to(np.eye(n), (K, n, n)).copy()
    by_input = np.zeros((K, n))
    slope = (u1 - u0) / np.where(dt > 0.0, dt, 1.0)
    coarse = np.zeros(K, bool)
    for part in range(pieces):
        u = u0 + slope * h * part
        z, put = lanes.clip_to_limits(z, u, _SOON * h)
        total, by_input = put @ total, np.einsum("kij,kj->ki", put, by_input)
        rate, J, b = lanes.linearise(z, u)
        M = np.zeros((K, n + 3, n + 3))  # dz, 1, t, held input
        M[:, :n, :n], M[:, :n, n], M[:, :n, n + 1], M[:, :n, n + 2] = J, rate, b * slope[:, None], b
        M[:, n + 1, n] = 1.0
        E = matrix_exponential(M * h[:, None, None])
        moved = z + E[:, :n, n]
        after, _, _ = lanes.linearise(moved, u + slope * h)
        bend = after - rate - np.einsum("kij,kj->ki", J, E[:, :n, n]) - b * (slope * h)[:, None]
        for e in lanes.elements:
            if e.has_limits:  # a contact that is made or lost is no bend; it is gone through in small steps
                coarse |= (pieces < _PIECES[1]) & (np.abs(bend[:, e.state]) * h > tolerance * dt)
                bend -= e.G * bend[:, e.state, None]
        better = (
            np.linalg.solve(np.eye(n) - 0.25 * h[:, None, None] * J, bend[:, :, None])[:, :, 0] * (h / 3.0)[:, None]
        )
        coarse |= np.abs(better[:, lanes.speeds]).max(axis=1, initial=0.0) > tolerance
        z, put = lanes.clip_to_limits(moved + better)
        by_input = np.einsum("kij,kj->ki", put, np.einsum("kij,kj->ki", E[:, :n, :n], by_input) + E[:, :n, n + 2])
        total = put @ E[:, :n, :n] @ total
    return Propagated(z, total, by_input), coarse


def matrix_exponential(M: Array) -> Array:
    """Matrix exponentials, shape (K, m, m), by Taylor series and squaring, each matrix for itself."""
    size = np.abs(M).sum(axis=2).max(axis=1)
    halvings = np.ceil(np.log2(np.maximum(size / TAYLOR_MAX_NORM, 1.0)))
    halvings = np.where(np.isfinite(halvings), halvings, 0.0).astype(int)
    scaled = M / 2.0 ** halvings[:, None, None]
    one = np.eye(M.shape[1])
    E = one + scaled / TAYLOR_ORDER
    for k in range(TAYLOR_ORDER - 1, 0, -1):
        E = one + scaled @ E / k
    for i in range(int(halvings.max(initial=0))):
        again = halvings > i
        E[again] = E[again] @ E[again]
    return np.asarray(E)


class DelayedInput(NamedTuple):
    """Delayed input, which bends once within every interval: where the next sample of what was asked for arrives.

    Attributes
    ----------
    first, knee : ndarray, shape (samples, K)
        At the sample and just before the bend; a straight line between.
    after, last : ndarray, shape (samples, K)
        Just after the bend and at the end of the interval.
    share : ndarray, shape (K,)
        Part of the interval before the bend, above 0; 1 for delays of whole samples.
    """

    start: Array
    before_switch: Array
    after_switch: Array
    end: Array
    switch_fraction: Array

    def select(self, which: NDArray[np.int64]) -> DelayedInput:
        """Some of the lanes; one may come several times."""
        return DelayedInput(*(part[..., which] for part in self))


def delay_input(u: Array, dt: float, delay: Array, hold: str) -> DelayedInput:
    """Delay the input, exactly.

    Parameters
    ----------
    u : ndarray, shape (samples, K)
        Before the first sample it was as there.
    dt : float
    delay : ndarray, shape (K,)
        In s.
    hold : {'linear', 'zoh'}
    """
    whole = np.maximum(np.ceil(delay / dt - 1e-9).astype(int) - 1, -1)
    share = np.minimum(delay / dt - whole, 1.0)
    k = np.arange(len(u))[:, None]
    lane = np.arange(u.shape[1])

    def at(sample: NDArray[np.int64]) -> Array:
        return np.asarray(u[np.clip(sample, 0, len(u) - 1), lane])

    old, near, new = at(k - whole - 1), at(k - whole), at(k - whole + 1)
    if hold == "zoh":
        return DelayedInput(old, old, near, near, share)
    return DelayedInput(share * old + (1.0 - share) * near, near, near, share * near + (1.0 - share) * new, share)
