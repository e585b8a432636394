"""Discretisation over one sampling interval, with derivatives, for many parameter sets or states side by side.

Each step is an exponential Rosenbrock step (exprb32, Hochbruck, Ostermann and Schweitzer 2009,
doi:10.1137/080717717). It is exact for the linear part and the ramp of the input, and of third order for the curvature
of the laws, however steep friction is. The same matrix exponential gives the transition matrix that an extended Kalman
filter needs. The compiled kernel is more accurate but gives no derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brightgrey.arrays import Array
from brightgrey.control.policy import ANALYSIS
from brightgrey.effects import Law
from brightgrey.kit import StateSpace

__all__ = [
    "DelayedInput",
    "ElementBatch",
    "Propagated",
    "StepOptions",
    "delay_input",
    "matrix_exponential",
    "propagate_states",
]


@dataclass(frozen=True)
class StepOptions:
    """Refinement of the steps."""

    #: Numbers of equal steps of an interval that are tried where one step is too coarse.
    substeps: tuple[int, ...] = (4, 16, 64)
    #: From this number of steps on the making or breaking of a contact asks for no smaller ones.
    contact_substeps: int = 16
    contact_lookahead: float = 0.1  #: Part of a step within which a contact that is about to close is taken as closed.


STEPS = StepOptions()


@dataclass(frozen=True)
class _BatchElement:
    """One element with the parameter set on the first axis; `state` is -1 if it has no limits."""

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
        """Row (K, n) of the position to which the limited state is pulled, and the rate in 1/s at which it follows."""
        rate = -self.H[:, 0, self.state]
        row = self.H[:, 0] / rate[:, None]
        row[:, self.state] = 0.0
        return row, rate


@dataclass(frozen=True)
class ElementBatch:
    """A system with the parameter sets on the first axis, as batched matrix products need it."""

    A: Array  #: Shape (K, n, n).
    B: Array  #: Shape (K, n).
    C: Array  #: Shape (K, outputs, n).
    elements: tuple[_BatchElement, ...]
    derivative_rows: tuple[int, ...]  #: As in ``StateSpace``.
    speeds: NDArray[np.int64]  #: Indices of the states that are speeds.

    @classmethod
    def of(cls, system: StateSpace, sets: int = 1) -> ElementBatch:
        """Take a batch of K sets as it is; repeat a single set `sets` times."""
        K = system.batch[0] if system.batch else sets

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
        """Batch of some of the sets; a set may be selected several times."""
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
        """Derivative of the states (K, n), and its own derivatives by z (K, n, n) and by u (K, n)."""
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

    def clip_to_limits(self, z: Array, u: Array | None = None, lookahead: Array | None = None) -> tuple[Array, Array]:
        """Clip limited states along the direction in which they act; also return the derivative (K, n, n).

        With inputs `u`, states that would reach a limit within the times `lookahead` are set to it, too. A state that
        a filter estimates slightly off a closed contact would otherwise run through it.
        """
        n = z.shape[1]
        change = np.broadcast_to(np.eye(n), (len(z), n, n)).copy()
        z = z.copy()
        for e in self.elements:
            if e.has_limits:
                target = z[:, e.state]
                if u is not None and lookahead is not None:
                    rate = np.einsum("kj,kj->k", e.H[:, 0], z) + e.K[:, 0] * u
                    target = target + rate * lookahead
                    target = np.where((target > e.low) & (target < e.high), z[:, e.state], target)
                miss = np.clip(target, e.low, e.high) - z[:, e.state]
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
    batch: ElementBatch,
    z: Array,
    u0: Array,
    u1: Array,
    dt: ArrayLike,
    tolerance: Array,
    options: StepOptions = STEPS,
) -> Propagated:
    """Propagate states over an interval, in as many steps as each parameter set needs.

    Parameters
    ----------
    batch : ElementBatch
    z : ndarray, shape (K, n)
    u0, u1 : ndarray, shape (K,)
        Input at begin and end of the interval, a straight line between.
    dt : float or ndarray, shape (K,)
        Interval in s; 0 leaves a set as it is.
    tolerance : ndarray, shape (K,)
        Largest difference between the steps of second and third order in any speed, rad/s (m/s).
    options : StepOptions
    """
    span = np.broadcast_to(np.asarray(dt, float), (len(z),))
    step, coarse = _equal_steps(batch, z, u0, u1, span, 1, tolerance, options)
    for count in options.substeps:
        if not coarse.any():
            break
        again = np.flatnonzero(coarse)
        finer, still = _equal_steps(
            batch.select(again), z[again], u0[again], u1[again], span[again], count, tolerance[again], options
        )
        for whole, part in zip(step, finer, strict=True):
            whole[again] = part
        coarse[again] = still
    return step


def _equal_steps(
    batch: ElementBatch,
    z: Array,
    u0: Array,
    u1: Array,
    dt: Array,
    count: int,
    tolerance: Array,
    options: StepOptions,
) -> tuple[Propagated, NDArray[np.bool_]]:
    """Result of `count` equal steps, and a mask of the sets that need smaller ones."""
    K, n = z.shape
    h = dt / count
    total = np.broadcast_to(np.eye(n), (K, n, n)).copy()
    by_input = np.zeros((K, n))
    slope = (u1 - u0) / np.where(dt > 0.0, dt, 1.0)
    coarse = np.zeros(K, bool)
    for i in range(count):
        u = u0 + slope * h * i
        z, clip = batch.clip_to_limits(z, u, options.contact_lookahead * h)
        total, by_input = clip @ total, np.einsum("kij,kj->ki", clip, by_input)
        rate, J, b = batch.linearise(z, u)
        M = np.zeros((K, n + 3, n + 3))  # increment of z, 1, t, held input
        M[:, :n, :n], M[:, :n, n], M[:, :n, n + 1], M[:, :n, n + 2] = J, rate, b * slope[:, None], b
        M[:, n + 1, n] = 1.0
        E = matrix_exponential(M * h[:, None, None])
        second_order = z + E[:, :n, n]
        after, _, _ = batch.linearise(second_order, u + slope * h)
        remainder = after - rate - np.einsum("kij,kj->ki", J, E[:, :n, n]) - b * (slope * h)[:, None]
        for e in batch.elements:
            if e.has_limits:  # the switch of a contact is no curvature: small steps go through it
                coarse |= (count < options.contact_substeps) & (np.abs(remainder[:, e.state]) * h > tolerance * dt)
                remainder -= e.G * remainder[:, e.state, None]
        correction = np.linalg.solve(np.eye(n) - 0.25 * h[:, None, None] * J, remainder[:, :, None])[:, :, 0]
        correction = correction * (h / 3.0)[:, None]
        coarse |= np.abs(correction[:, batch.speeds]).max(axis=1, initial=0.0) > tolerance
        z, clip = batch.clip_to_limits(second_order + correction)
        by_input = np.einsum("kij,kj->ki", clip, np.einsum("kij,kj->ki", E[:, :n, :n], by_input) + E[:, :n, n + 2])
        total = clip @ E[:, :n, :n] @ total
    return Propagated(z, total, by_input), coarse


def matrix_exponential(M: Array) -> Array:
    """Matrix exponentials, shape (K, m, m), by scaling, Taylor series and squaring; each matrix is scaled alone."""
    size = np.abs(M).sum(axis=2).max(axis=1)
    halvings = np.ceil(np.log2(np.maximum(size / ANALYSIS.taylor_norm, 1.0)))
    halvings = np.where(np.isfinite(halvings), halvings, 0.0).astype(int)
    scaled = M / 2.0 ** halvings[:, None, None]
    one = np.eye(M.shape[1])
    E = one + scaled / ANALYSIS.taylor_order
    for k in range(ANALYSIS.taylor_order - 1, 0, -1):
        E = one + scaled @ E / k
    for i in range(int(halvings.max(initial=0))):
        again = halvings > i
        E[again] = E[again] @ E[again]
    return np.asarray(E)


class DelayedInput(NamedTuple):
    """Delayed input. Within every interval it switches once, when the next sample of the input arrives."""

    #: At the sample and just before the switch, a straight line between, shape (samples, K).
    start: Array
    before_switch: Array
    #: Just after the switch and at the end of the interval, a straight line between, shape (samples, K).
    after_switch: Array
    end: Array
    #: Part of the interval before the switch, above 0; 1 for delays of whole samples, shape (K,).
    switch_fraction: Array

    def select(self, which: NDArray[np.int64]) -> DelayedInput:
        """Input of some of the sets; a set may be selected several times."""
        return DelayedInput(*(part[..., which] for part in self))


def delay_input(u: Array, dt: float, delay: Array, hold: str) -> DelayedInput:
    """Delay the input, exactly.

    Parameters
    ----------
    u : ndarray, shape (samples, K)
        Before the first sample the input has the value of the first sample.
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
