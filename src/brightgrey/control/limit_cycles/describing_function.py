"""Describing functions, and the limit cycles they predict.

Every element of the model is replaced by what it does to the fundamental of an oscillation (Gelb, Vander Velde 1968).
An
element with limits is followed over a period, so a gap needs no formula of its own. The loop ``L(j w, a)`` for an
oscillation of the torque with amplitude a keeps itself up where ``1 + L = 0``.

Not for oscillations far from a sine, such as hunting by stick-slip with long rests, and only around standstill with
laws that are odd; a constant torque is held by the controller's integral and left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from brightgrey.arrays import Array, Complex
from brightgrey.control.limit_cycles.harmonic_balance import GapLoop, harmonic_balance
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.twist_coordinates import to_twist_coordinates
from brightgrey.effects import Element
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace

__all__ = ["LimitCycle", "describing_function", "predict_limit_cycles", "saturation_gain"]

_QUADRATURE = 128
_PERIOD = 128  # steps in which a gap is followed over a period
_ITERATIONS = 40
_SETTLED = 1e-5
_NEAR = 0.5  # of a cell's corner, in the logarithm of torque and frequency
_MET = 1e-3  # what 1 + L may be off by
_AMPLITUDES = 36
_FREQUENCIES = 120


@dataclass(frozen=True)
class LimitCycle:
    """A predicted oscillation that keeps itself up.

    Attributes
    ----------
    frequency : float
        Hz.
    torque : float
        Amplitude of the wanted torque, before the limit, N m (N).
    outputs : ndarray, shape (outputs,)
        Amplitude of each output.
    stable : bool
        Neighbouring oscillations run into it; if not, it parts those that die from those that grow.
    """

    frequency: float
    torque: float
    outputs: Array
    stable: bool


def describing_function(element: Element, amplitude: Array) -> Array:
    """Gain of a law without memory for the fundamental of a sine of `amplitude` at its port.

    Parameters
    ----------
    element : Element
        One port, odd law.
    amplitude : ndarray
        Above 0, any shape.
    """
    angle = (np.arange(_QUADRATURE) + 0.5) * (0.5 * np.pi / _QUADRATURE)  # a quarter will do: the law is odd
    # Stretched to the zero crossing, where friction turns within a small part of the period.
    angle = 0.5 * np.pi * (1.0 - (1.0 - angle / (0.5 * np.pi)) ** 3)
    edges = np.concatenate([[0.0], 0.5 * (angle[1:] + angle[:-1]), [0.5 * np.pi]])
    a = np.asarray(amplitude, float)
    phi, _ = element.law.value((a[..., None] * np.cos(angle),), element.p)
    return np.asarray(np.sum(phi * np.cos(angle) * np.diff(edges), axis=-1) * 4.0 / (np.pi * a))


def saturation_gain(amplitude: float, limit: float) -> float:
    """Gain of a torque limit for the fundamental of a sine of `amplitude`."""
    if amplitude <= limit:
        return 1.0
    share = limit / amplitude
    return float(2.0 / np.pi * (np.arcsin(share) + share * np.sqrt(1.0 - share**2)))


def gap_describing_function(half: float, feedback: float, omega: Array, amplitude: Array) -> Complex:
    """Fundamental of an integrator kept in [-half, half] over the sine that drives it, for each (omega, amplitude).

    ``lambda' = amplitude cos(omega t) + feedback lambda`` where it is not at its limit and pushed outward.
    """
    h = 2.0 * np.pi / (omega * _PERIOD)
    decay = np.exp(feedback * h)
    gain = np.where(np.abs(feedback * h) > 1e-6, np.expm1(feedback * h) / feedback if feedback else h, h)
    state = np.zeros_like(omega)
    total = np.zeros(omega.shape, complex)
    for k in range(3 * _PERIOD // 2):
        state = np.clip(decay * state + gain * amplitude * np.cos(2.0 * np.pi * (k + 0.5) / _PERIOD), -half, half)
        if k >= _PERIOD // 2:
            total += state * np.exp(-2j * np.pi * (k + 1) / _PERIOD)
    return np.asarray(total * 2.0 / _PERIOD / amplitude, complex)


@dataclass(frozen=True)
class _HarmonicLoop:
    """Everything in the loop but the oscillation.

    The size of an oscillation is told by the amplitude at the port of a gap, where there is one: the same torque may
    keep up several oscillations through it. Else by the amplitude of the torque.
    """

    system: StateSpace
    compensator: Compensator
    output: int
    delay: float
    limit: float

    @property
    def gap(self) -> Element | None:
        """The element that tells the size of an oscillation."""
        return next((e for e in self.system.elements if e.limits is not None), None)

    def amplitudes(self, torque: tuple[float, float]) -> Array:
        """Sizes to look at: from a gap that is just not crossed to one that is hardly felt, or of the torque."""
        if self.gap is None:
            return np.geomspace(*torque, _AMPLITUDES)
        half, _, feedback = _gap_parameters(self.gap)
        return np.geomspace(1e-3, 1e4, 2 * _AMPLITUDES) * half * abs(feedback)

    def oscillation(self, omega: Array, level: float) -> tuple[Complex, Array]:
        """States, shape (frequencies, n), and amplitudes of the applied torque, at each frequency."""
        s = self.system
        n = len(s.states)
        start = 1j * omega[:, None, None] * np.eye(n) - s.A
        size = np.full(len(omega), level)
        if self.gap is not None:
            half, port, feedback = _gap_parameters(self.gap)
            carried = 1j * omega * gap_describing_function(half, feedback, omega, size)
            start = start - carried[:, None, None] * np.outer(self.gap.G, port)
        smooth = [e for e in s.elements if e.limits is None and e.law.ports]
        gains = [np.zeros(len(omega)) for _ in smooth]
        for turn in range(_ITERATIONS):
            M = start - sum(
                (gain[:, None, None] * np.outer(e.G, e.H[0]) for e, gain in zip(smooth, gains, strict=True)),
                start=np.zeros((1, n, n)),
            )
            X = np.linalg.solve(M, np.broadcast_to(s.B, (len(omega), n, 1)))[:, :, 0]
            torque = size if self.gap is None else size / np.abs(X @ port)
            X = X * torque[:, None]
            change = 0.0
            for i, e in enumerate(smooth):
                new = describing_function(e, np.maximum(np.abs(X @ e.H[0]), 1e-300))
                mixed = new if turn == 0 else 0.5 * (new + gains[i])
                change = max(change, float(np.max(np.abs(mixed - gains[i]) / (np.abs(mixed) + 1e-300))))
                gains[i] = mixed
            if change < _SETTLED:
                break
        return np.asarray(X, complex), np.asarray(torque, float)

    def states_per_gap_position(self, omega: Array, fundamental: Complex) -> Complex:
        """States, shape (frequencies, n), for a position of amplitude 1 in the gap, with the loop closed.

        Friction and torque limit have their gains for the `fundamental` of the states, shape (n,).
        """
        s = self.system
        assert self.gap is not None
        n = len(s.states)
        M = 1j * omega[:, None, None] * np.eye(n) - s.A
        for e in s.elements:
            if e.limits is None and e.law.ports:
                gain = float(describing_function(e, np.maximum(np.abs(fundamental @ e.H[0]), 1e-300)))
                M = M - gain * np.outer(e.G, e.H[0])
        control = self.compensator.response(omega) * np.exp(-1j * omega * self.delay)
        wanted = abs(complex(self.compensator.response(omega[:1])[0] * (fundamental @ s.C[self.output])))
        M = M + (control * saturation_gain(wanted, self.limit))[:, None, None] * np.outer(s.B[:, 0], s.C[self.output])
        return np.asarray(np.linalg.solve(M, (1j * omega[:, None] * self.gap.G)[:, :, None])[:, :, 0], complex)

    def gain(self, omega: Array, level: float) -> tuple[Complex, Complex, Array]:
        """Loop gain L at each frequency, the states, and the amplitude of the wanted torque."""
        if self.gap is None:
            wanted = np.full(len(omega), level)
            X, _ = self.oscillation(omega, level * saturation_gain(level, self.limit))
        else:
            X, torque = self.oscillation(omega, level)
            wanted = np.array([_unlimited_amplitude(a, self.limit) for a in torque])
        y = X @ self.system.C[self.output].astype(complex)
        return self.compensator.response(omega) * y * np.exp(-1j * omega * self.delay) / wanted, X, wanted


def _gap_parameters(gap: Element) -> tuple[float, Array, float]:
    """Half the gap, the port without the gap's own state, and how that state feeds back to its rate."""
    assert gap.limits is not None
    port = gap.H[0].copy()
    port[gap.limits.state] = 0.0
    return 0.5 * float(gap.limits.upper - gap.limits.lower), port, float(gap.H[0][gap.limits.state])


def _unlimited_amplitude(applied: float, limit: float) -> float:
    """Amplitude before the torque limit that leaves `applied` behind it; inf where the limit leaves less."""
    if applied <= limit:
        return applied
    if applied >= 4.0 / np.pi * limit * (1.0 - 1e-9):
        return np.inf
    return float(brentq(lambda a: a * saturation_gain(a, limit) - applied, limit, 1e6 * limit))


def predict_limit_cycles(
    system: StateSpace,
    compensator: Compensator,
    *,
    torque: tuple[float, float],
    omega: tuple[float, float],
    output: int = 0,
    delay: float = 0.0,
    limit: float = np.inf,
) -> tuple[LimitCycle, ...]:
    """Predict the limit cycles of a controller around a non-linear drive at standstill.

    Parameters
    ----------
    system : StateSpace
        One parameter set.
    compensator : Compensator
        From the control error of one output to torque.
    torque : (low, high)
        Amplitudes of torque to look at, N m (N). With a gap the amplitudes follow from it, and this only picks.
    omega : (low, high)
        Angular frequencies to look at, rad/s.
    output : int
    delay : float
        Of the computer and half a sampling interval for its hold, s, on top of the drive's dead time.
    limit : float
        Of the torque.

    Returns
    -------
    tuple of LimitCycle
        The smallest first; empty if there is none.

    Raises
    ------
    SettingsError
        For laws that are not odd, or an acceleration as the output.
    """
    transformed = to_twist_coordinates(system).system
    for e in transformed.elements:
        if e.law.ports and e.limits is None and not e.law.odd:
            raise SettingsError(f"'{e.name}' is not odd: its oscillations have no mean of 0")
    if any(row >= 0 for row in transformed.derivative_rows):
        raise SettingsError("limit cycles are predicted for position and velocity, not for acceleration")
    total = delay + float(np.asarray(system.dead_time))
    loop = _HarmonicLoop(transformed, compensator, output, total, limit)
    grid = np.geomspace(*omega, _FREQUENCIES)
    levels = loop.amplitudes(torque)
    map_of: Complex = np.array([loop.gain(grid, a)[0] for a in levels], complex)
    found: list[LimitCycle] = []
    for i, k in _cells_around_zero(np.asarray(1.0 + map_of, complex)):
        cycle = _refine(loop, np.log([levels[i], grid[k]]))
        if (
            cycle
            and torque[0] <= cycle.torque <= torque[1]
            and not any(_is_same_cycle(cycle, other) for other in found)
        ):
            found.append(cycle)
    return tuple(sorted(found, key=lambda c: c.torque))


def _cells_around_zero(values: Complex) -> list[tuple[int, int]]:
    """Cells of the grid whose corners lie around 0."""

    def spans(part: Array) -> NDArray[np.bool_]:
        corners = np.stack([part[:-1, :-1], part[1:, :-1], part[:-1, 1:], part[1:, 1:]])
        return np.asarray((corners.min(axis=0) <= 0.0) & (corners.max(axis=0) >= 0.0))

    near = np.abs(values[:-1, :-1]) < 1.0
    return [(int(i), int(k)) for i, k in np.argwhere(spans(values.real) & spans(values.imag) & near)]


def _refine(loop: _HarmonicLoop, start: Array) -> LimitCycle | None:
    def miss(p: Array) -> Array:
        L = loop.gain(np.exp(p[1:]), float(np.exp(p[0])))[0][0]
        return np.array([1.0 + L.real, L.imag])

    solution = least_squares(miss, start, bounds=(start - _NEAR, start + _NEAR), diff_step=np.full(2, 1e-4))
    if np.abs(solution.fun).max() > _MET:
        return None
    level, w = (float(v) for v in np.exp(solution.x))
    _, X, wanted = loop.gain(np.array([w]), level)
    # Loeb's criterion: growing oscillations must come to lie outside of the critical point.
    step = 1e-3
    by_a, by_w = ((miss(solution.x + d) - miss(solution.x - d)) / (2.0 * step) for d in step * np.eye(2))
    turn = float(by_a[0] * by_w[1] - by_a[1] * by_w[0])
    if loop.gap is not None:
        half, port, feedback = _gap_parameters(loop.gap)
        better = harmonic_balance(GapLoop(half, feedback, port, loop.states_per_gap_position), w, X[0])
        if better is not None:
            w, X = better.omega, better.states[None]
            wanted = np.abs(loop.compensator.response(np.array([w])) * (X @ loop.system.C[loop.output]))
    return LimitCycle(w / (2.0 * np.pi), float(wanted[0]), np.abs(loop.system.C @ X[0]), turn > 0.0)


def _is_same_cycle(a: LimitCycle, b: LimitCycle) -> bool:
    return abs(math.log(a.frequency / b.frequency)) < 0.02 and abs(math.log(a.torque / b.torque)) < 0.05
