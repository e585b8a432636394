"""Describing functions, and the limit cycles that they predict.

Every element of the model is replaced by its gain for the fundamental of an oscillation (Gelb and Vander Velde 1968).
The gain of an element with limits is found by following it over a period, so that a gap needs no formula. With the
loop ``L(j w, a)`` for an oscillation of the torque with amplitude a, a limit cycle is a solution of ``1 + L = 0``.

The method fails for oscillations far from a sine, such as hunting by stick-slip with long rests. It holds around
standstill and for odd laws only. A constant torque is held by the controller's integral and is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from brightgrey.arrays import Array, Complex
from brightgrey.control.dry_friction import sliding
from brightgrey.control.limit_cycles.harmonic_balance import GapLoop, HarmonicBalanceOptions, harmonic_balance
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.twist_coordinates import to_twist_coordinates
from brightgrey.control.policy import ANALYSIS
from brightgrey.effects import Element
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace

__all__ = ["LimitCycle", "LimitCycleOptions", "describing_function", "predict_limit_cycles", "saturation_gain"]


@dataclass(frozen=True)
class LimitCycleOptions:
    """Resolution and tolerances of the prediction."""

    #: Points of the grid; twice as many amplitudes with a gap.
    amplitudes: int = 36
    frequencies: int = 120
    #: Range of amplitudes with a gap, over the amplitude at which the gap is just crossed.
    gap_amplitudes: tuple[float, float] = (1e-3, 1e4)
    period_steps: int = 128  #: Steps in which a gap is followed over a period.
    max_iterations: int = 40  #: For the gains of the elements, which depend on the amplitudes they are fed with.
    gain_tolerance: float = 1e-5  #: Relative change at which these iterations end.
    #: Largest distance of a solution from its grid cell, in the logarithms of amplitude and frequency.
    max_shift: float = 0.5
    tolerance: float = 1e-3  #: Largest absolute value of ``1 + L`` of a solution.
    #: Solutions nearer than both, in the logarithm, are the same.
    same_frequency: float = 0.02
    same_torque: float = 0.05
    balance: HarmonicBalanceOptions = field(default_factory=HarmonicBalanceOptions)  #: Of the refinement with a gap.


LIMIT_CYCLES = LimitCycleOptions()


@dataclass(frozen=True)
class LimitCycle:
    """A predicted self-sustained oscillation."""

    frequency: float  #: Hz.
    torque: float  #: Amplitude of the commanded torque, before the limit, N m (N).
    outputs: Array  #: Amplitude of each output, SI, shape (outputs,).
    #: True if neighbouring oscillations converge to it. An unstable one separates those that decay from those that
    #: grow.
    stable: bool


def describing_function(element: Element, amplitude: Array) -> Array:
    """Describing function of a law without memory: its gain for a sine of `amplitude` at the port.

    Parameters
    ----------
    element : Element
        One port, odd law.
    amplitude : ndarray
        Above 0, any shape.
    """
    element = sliding(element)
    points = ANALYSIS.quadrature_points
    angle = (np.arange(points) + 0.5) * (0.5 * np.pi / points)  # a quarter of the period, because the law is odd
    # Denser at the zero crossing, where friction reverses within a small part of the period.
    angle = 0.5 * np.pi * (1.0 - (1.0 - angle / (0.5 * np.pi)) ** 3)
    edges = np.concatenate([[0.0], 0.5 * (angle[1:] + angle[:-1]), [0.5 * np.pi]])
    a = np.asarray(amplitude, float)
    phi, _ = element.law.value((a[..., None] * np.cos(angle),), element.p)
    return np.asarray(np.sum(phi * np.cos(angle) * np.diff(edges), axis=-1) * 4.0 / (np.pi * a))


def saturation_gain(amplitude: float, limit: float) -> float:
    """Describing function of a torque limit for a sine of `amplitude`."""
    if amplitude <= limit:
        return 1.0
    ratio = limit / amplitude
    return float(2.0 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2)))


def gap_describing_function(
    half_width: float, feedback: float, omega: Array, amplitude: Array, steps: int = LIMIT_CYCLES.period_steps
) -> Complex:
    """Describing function of an integrator with limits, for each pair of `omega` and `amplitude`.

    The integrator ``lambda' = amplitude cos(omega t) + feedback lambda`` is kept within ``[-half_width, half_width]``.
    """
    h = 2.0 * np.pi / (omega * steps)
    decay = np.exp(feedback * h)
    gain = np.where(np.abs(feedback * h) > 1e-6, np.expm1(feedback * h) / feedback if feedback else h, h)
    state = np.zeros_like(omega)
    total = np.zeros(omega.shape, complex)
    for k in range(3 * steps // 2):
        state = np.clip(
            decay * state + gain * amplitude * np.cos(2.0 * np.pi * (k + 0.5) / steps), -half_width, half_width
        )
        if k >= steps // 2:
            total += state * np.exp(-2j * np.pi * (k + 1) / steps)
    return np.asarray(total * 2.0 / steps / amplitude, complex)


@dataclass(frozen=True)
class _HarmonicLoop:
    """The loop without the oscillation.

    With a gap an oscillation is parametrised by its amplitude at the gap's port, because several oscillations may have
    the same torque. Without a gap it is parametrised by the amplitude of the torque.
    """

    system: StateSpace
    compensator: Compensator
    output: int
    delay: float
    limit: float
    options: LimitCycleOptions

    @property
    def gap(self) -> Element | None:
        """The first element with limits."""
        return next((e for e in self.system.elements if e.limits is not None), None)

    def amplitudes(self, torque: tuple[float, float]) -> Array:
        """Amplitudes of the grid: of the torque, or relative to the gap."""
        if self.gap is None:
            return np.geomspace(*torque, self.options.amplitudes)
        half, _, feedback = _gap_parameters(self.gap)
        return np.geomspace(*self.options.gap_amplitudes, 2 * self.options.amplitudes) * half * abs(feedback)

    def oscillation(self, omega: Array, level: float) -> tuple[Complex, Array]:
        """States, shape (frequencies, n), and amplitudes of the applied torque, at each frequency."""
        s = self.system
        n = len(s.states)
        start = 1j * omega[:, None, None] * np.eye(n) - s.A
        size = np.full(len(omega), level)
        if self.gap is not None:
            half, port, feedback = _gap_parameters(self.gap)
            gap_rate = 1j * omega * gap_describing_function(half, feedback, omega, size, self.options.period_steps)
            start = start - gap_rate[:, None, None] * np.outer(self.gap.G, port)
        smooth = [e for e in s.elements if e.limits is None and e.law.ports]
        gains = [np.zeros(len(omega)) for _ in smooth]
        for iteration in range(self.options.max_iterations):
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
                mixed = new if iteration == 0 else 0.5 * (new + gains[i])
                change = max(change, float(np.max(np.abs(mixed - gains[i]) / (np.abs(mixed) + 1e-300))))
                gains[i] = mixed
            if change < self.options.gain_tolerance:
                break
        return np.asarray(X, complex), np.asarray(torque, float)

    def states_per_gap_position(self, omega: Array, fundamental: Complex) -> Complex:
        """States, shape (frequencies, n), for a position of amplitude 1 in the gap, with the loop closed.

        Friction and torque limit have the gains of the `fundamental` of the states, shape (n,).
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
        commanded = abs(complex(self.compensator.response(omega[:1])[0] * (fundamental @ s.C[self.output])))
        M = M + (control * saturation_gain(commanded, self.limit))[:, None, None] * np.outer(
            s.B[:, 0], s.C[self.output]
        )
        return np.asarray(np.linalg.solve(M, (1j * omega[:, None] * self.gap.G)[:, :, None])[:, :, 0], complex)

    def gain(self, omega: Array, level: float) -> tuple[Complex, Complex, Array]:
        """Loop gain L at each frequency, the states, and the amplitude of the commanded torque."""
        if self.gap is None:
            commanded = np.full(len(omega), level)
            X, _ = self.oscillation(omega, level * saturation_gain(level, self.limit))
        else:
            X, torque = self.oscillation(omega, level)
            commanded = np.array([_unlimited_amplitude(a, self.limit) for a in torque])
        y = X @ self.system.C[self.output].astype(complex)
        return self.compensator.response(omega) * y * np.exp(-1j * omega * self.delay) / commanded, X, commanded


def _gap_parameters(gap: Element) -> tuple[float, Array, float]:
    """Half the width, the port without the gap's own state, and the feedback of that state to its rate."""
    assert gap.limits is not None
    port = gap.H[0].copy()
    port[gap.limits.state] = 0.0
    return 0.5 * float(gap.limits.upper - gap.limits.lower), port, float(gap.H[0][gap.limits.state])


def _unlimited_amplitude(applied: float, limit: float) -> float:
    """Amplitude before the torque limit for the amplitude `applied` behind it; inf if the limit allows less."""
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
    options: LimitCycleOptions = LIMIT_CYCLES,
) -> tuple[LimitCycle, ...]:
    """Predict the limit cycles of a controller around a non-linear drive at standstill.

    Parameters
    ----------
    system : StateSpace
        One parameter set.
    compensator : Compensator
        From the control error of one output to torque.
    torque : (low, high)
        Range of torque amplitudes, N m (N). With a gap it only selects among the limit cycles found.
    omega : (low, high)
        Range of angular frequencies, rad/s.
    output : int
        Index of the controlled output.
    delay : float
        Delay of the computer and half a sampling interval for its hold, s, in addition to the drive's dead time.
    limit : float
        Largest torque, N m (N).
    options : LimitCycleOptions

    Returns
    -------
    tuple of LimitCycle
        Smallest torque first; empty if there is none.

    Raises
    ------
    SettingsError
        For laws that are not odd, or an acceleration as the output.
    """
    transformed = to_twist_coordinates(system).system
    for e in transformed.elements:
        if e.law.ports and e.limits is None and not e.law.odd:
            raise SettingsError(f"limit cycles need odd laws; the law of '{e.name}' is not odd")
    if any(row >= 0 for row in transformed.derivative_rows):
        raise SettingsError("limit cycles are predicted for outputs position and velocity, not for acceleration")
    total = delay + float(np.asarray(system.dead_time))
    loop = _HarmonicLoop(transformed, compensator, output, total, limit, options)
    grid = np.geomspace(*omega, options.frequencies)
    levels = loop.amplitudes(torque)
    loop_gains: Complex = np.array([loop.gain(grid, a)[0] for a in levels], complex)
    found: list[LimitCycle] = []
    for i, k in _cells_around_zero(np.asarray(1.0 + loop_gains, complex)):
        cycle = _refine(loop, np.log([levels[i], grid[k]]))
        if (
            cycle
            and torque[0] <= cycle.torque <= torque[1]
            and not any(_is_same_cycle(cycle, c, options) for c in found)
        ):
            found.append(cycle)
    return tuple(sorted(found, key=lambda c: c.torque))


def _cells_around_zero(values: Complex) -> list[tuple[int, int]]:
    """Grid cells whose corners surround 0."""

    def spans(part: Array) -> NDArray[np.bool_]:
        corners = np.stack([part[:-1, :-1], part[1:, :-1], part[:-1, 1:], part[1:, 1:]])
        return np.asarray((corners.min(axis=0) <= 0.0) & (corners.max(axis=0) >= 0.0))

    near = np.abs(values[:-1, :-1]) < 1.0
    return [(int(i), int(k)) for i, k in np.argwhere(spans(values.real) & spans(values.imag) & near)]


def _refine(loop: _HarmonicLoop, start: Array) -> LimitCycle | None:
    def miss(p: Array) -> Array:
        L = loop.gain(np.exp(p[1:]), float(np.exp(p[0])))[0][0]
        return np.array([1.0 + L.real, L.imag])

    near = loop.options.max_shift
    solution = least_squares(miss, start, bounds=(start - near, start + near), diff_step=np.full(2, 1e-4))
    if np.abs(solution.fun).max() > loop.options.tolerance:
        return None
    level, w = (float(v) for v in np.exp(solution.x))
    _, X, commanded = loop.gain(np.array([w]), level)
    # Loeb's criterion: a growing oscillation must move the locus past the critical point to the stable side.
    step = 1e-3
    by_a, by_w = ((miss(solution.x + d) - miss(solution.x - d)) / (2.0 * step) for d in step * np.eye(2))
    determinant = float(by_a[0] * by_w[1] - by_a[1] * by_w[0])
    if loop.gap is not None:
        half, port, feedback = _gap_parameters(loop.gap)
        gap = GapLoop(half, feedback, port, loop.states_per_gap_position)
        refined = harmonic_balance(gap, w, X[0], loop.options.balance)
        if refined is not None:
            w, X = refined.omega, refined.states[None]
            commanded = np.abs(loop.compensator.response(np.array([w])) * (X @ loop.system.C[loop.output]))
    return LimitCycle(w / (2.0 * np.pi), float(commanded[0]), np.abs(loop.system.C @ X[0]), determinant > 0.0)


def _is_same_cycle(a: LimitCycle, b: LimitCycle, options: LimitCycleOptions) -> bool:
    frequency, torque = abs(math.log(a.frequency / b.frequency)), abs(math.log(a.torque / b.torque))
    return frequency < options.same_frequency and torque < options.same_torque
