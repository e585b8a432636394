"""Linear loops: controllers, frequency responses with exact dead time, and margins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from brightgrey.arrays import Array, Complex
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear

__all__ = [
    "Compensator",
    "Margins",
    "closed_loop_poles",
    "frequency_grid",
    "frequency_response",
    "open_loop",
    "stability_margins",
]

POINTS_PER_DECADE = 200
PADE_ORDER = 6


@dataclass(frozen=True)
class Compensator:
    """Linear controller from one control error to the input of the drive: ``k' = A k + B e``, ``u = C k + D e``.

    Attributes
    ----------
    A, B, C, D : ndarray, shape (n, n), (n, 1), (1, n), (1, 1)
    """

    A: Array
    B: Array
    C: Array
    D: Array

    @classmethod
    def of(cls, numerator: Sequence[float], denominator: Sequence[float]) -> Compensator:
        """Controller from its transfer function, coefficients of falling powers of s.

        Raises
        ------
        SettingsError
            If it is not proper.
        """
        top, bottom = (np.trim_zeros(np.atleast_1d(np.asarray(c, float)), "f") for c in (numerator, denominator))
        if not len(bottom) or not len(top) or len(top) > len(bottom):
            raise SettingsError(
                f"controller {list(numerator)}/{list(denominator)}: the numerator has to be there "
                "and its degree must not exceed the denominator's"
            )
        if len(bottom) == 1:
            return cls(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[top[0] / bottom[0]]]))
        from scipy.signal import tf2ss  # slow to import, and only compensators of a user need it

        return cls(*(np.atleast_2d(part) for part in tf2ss(top, bottom)))

    def response(self, omega: Array) -> Complex:
        """Frequency response, shape (frequencies,), at angular frequencies in rad/s."""
        return np.asarray(frequency_response(Linear(self.A, self.B, self.C, self.D), omega)[0])

    def discretise(self, dt: float) -> Compensator:
        """Sampled every `dt` seconds, by the trapezoidal rule (Tustin)."""
        n = len(self.A)
        left = np.linalg.inv(np.eye(n) - 0.5 * dt * self.A)
        A = left @ (np.eye(n) + 0.5 * dt * self.A)
        B = left @ self.B * dt
        return Compensator(A, B, self.C @ left, self.D + 0.5 * self.C @ B)


@dataclass(frozen=True)
class Margins:
    """How far a closed loop is from instability.

    Attributes
    ----------
    stable : bool
        All poles of the closed loop on the left (dead time by a Padé approximation of order 6).
    gain : float
        Smallest factor above 1 on the loop's gain that reaches the limit of stability; inf if there is none.
    gain_down : float
        Largest factor below 1 that does; 0 if there is none.
    phase : float
        Smallest phase lag in degrees that does; inf if the gain never crosses 1.
    delay : float
        Smallest additional dead time in s that does.
    sensitivity : float
        Peak of ``1/|1 + L|``; a ratio; below 2 is a well damped loop.
    crossover : float
        Highest angular frequency in rad/s at which ``|L| = 1``; 0 if there is none.
    """

    stable: bool
    gain: float
    gain_down: float
    phase: float
    delay: float
    sensitivity: float
    crossover: float


def frequency_grid(roots: Sequence[complex], top: float | None = None) -> Array:
    """Grid in rad/s around poles and zeros, finer at each of them: three decades below the slowest to `top`.

    Without `top` it ends two decades above the fastest.
    """
    sizes = [abs(r) for r in roots if abs(r) > 1e-9]
    low, high = (min(sizes) * 1e-3, max(sizes) * 1e2) if sizes else (1e-2, 1e4)
    high = top or high
    low = min(low, high * 1e-4)
    grid = [np.geomspace(low, high, int(POINTS_PER_DECADE * math.log10(high / low)))]
    for r in roots:
        center, width = abs(r.imag), max(abs(r.real), 1e-6 * abs(r.imag))
        if center > 0.0:
            around = center + width * np.linspace(-6.0, 6.0, 121)
            grid.append(around[(around > low) & (around < high)])
    return np.unique(np.concatenate(grid))


def frequency_response(linear: Linear, omega: Array, dead_time: float = 0.0) -> Complex:
    """Response from u to every output, shape (outputs, frequencies), dead time exact."""
    A, B, C, D = linear
    n = len(A)
    s = 1j * np.asarray(omega, float)
    if n == 0:
        H = np.broadcast_to(D[:, 0, None], (len(D), len(s))).astype(complex)
    else:
        X = np.linalg.solve(s[:, None, None] * np.eye(n) - A, np.broadcast_to(B, (len(s), *B.shape)))[:, :, 0]
        H = (X @ C.T + D[:, 0]).T
    return np.asarray(H * np.exp(-s * dead_time))


def stability_margins(linear: Linear, compensator: Compensator, *, output: int = 0, dead_time: float = 0.0) -> Margins:
    """Margins of the loop ``L = compensator * plant`` with negative feedback of one output.

    Parameters
    ----------
    linear : Linear
    compensator : Compensator
    output : int
        Which output is fed back.
    dead_time : float
        In s: of the drive, of the computer and half a sampling interval for its hold.
    """
    one = Linear(linear.A, linear.B, linear.C[output : output + 1], linear.D[output : output + 1])
    loop = open_loop(compensator, one)
    rates = [*np.linalg.eigvals(loop.A), *_poles_of_closed(loop, dead_time)]
    if dead_time > 0.0:
        rates.append(complex(1.0 / dead_time))
    omega = frequency_grid(rates)
    L = frequency_response(loop, omega, dead_time)[0]

    def at(w: float) -> complex:
        return complex(frequency_response(loop, np.array([w]), dead_time)[0, 0])

    gains, phases, delays, crossover = _crossings(omega, L, at)
    return Margins(
        stable=bool(np.all(_poles_of_closed(loop, dead_time).real < 0.0)),
        gain=min((g for g in gains if g > 1.0), default=math.inf),
        gain_down=max((g for g in gains if 0.0 < g < 1.0), default=0.0),
        phase=min(phases, default=math.inf),
        delay=min(delays, default=math.inf),
        sensitivity=float(np.max(1.0 / np.abs(1.0 + L))),
        crossover=crossover,
    )


def _crossings(
    omega: Array, L: Complex, at: Callable[[float], complex]
) -> tuple[list[float], list[float], list[float], float]:
    """Gains where L is real and negative; phases and delays where |L| = 1; the last such frequency."""
    from scipy.optimize import brentq  # slow to import, and an identification needs no margins

    gains, phases, delays, crossover = [], [], [], 0.0
    for i in np.flatnonzero(np.diff(np.sign(L.imag))):
        if L.real[i] < 0.0 and L.real[i + 1] < 0.0:
            w = brentq(lambda w: at(w).imag, omega[i], omega[i + 1])
            gains.append(-1.0 / at(w).real)
    for i in np.flatnonzero(np.diff(np.sign(np.abs(L) - 1.0))):
        w = brentq(lambda w: abs(at(w)) - 1.0, omega[i], omega[i + 1])
        lag = math.pi + math.atan2(at(w).imag, at(w).real)
        phases.append(math.degrees(min(lag % (2.0 * math.pi), 2.0 * math.pi - lag % (2.0 * math.pi))))
        delays.append((lag % (2.0 * math.pi)) / w)
        crossover = max(crossover, w)
    return gains, phases, delays, crossover


def open_loop(compensator: Compensator, plant: Linear) -> Linear:
    """Open loop: the compensator ahead of a plant with one output."""
    A = block_diag(compensator.A, plant.A)
    m = len(compensator.A)
    A[m:, :m] = plant.B @ compensator.C
    B = np.vstack([compensator.B, plant.B @ compensator.D])
    return Linear(A, B, np.hstack([plant.D @ compensator.C, plant.C]), plant.D @ compensator.D)


def closed_loop_poles(linear: Linear, compensator: Compensator, dead_time: float = 0.0) -> Complex:
    """Poles in 1/s of the loop closed over the first output; dead time by a Padé approximation."""
    return _poles_of_closed(open_loop(compensator, linear), dead_time)


def _poles_of_closed(loop: Linear, dead_time: float) -> Complex:
    if dead_time > 0.0:
        loop = open_loop(_pade(dead_time), loop)
    feedback = loop.B @ loop.C / (1.0 + loop.D[0, 0])
    return np.asarray(np.linalg.eigvals(loop.A - feedback))


def _pade(dead_time: float) -> Compensator:
    """Padé approximation of a dead time."""
    n = PADE_ORDER
    c = [
        math.factorial(2 * n - k) / (math.factorial(k) * math.factorial(n - k)) * dead_time**k for k in range(n, -1, -1)
    ]
    signs = [(-1.0) ** k for k in range(n, -1, -1)]
    return Compensator.of([a * b for a, b in zip(c, signs, strict=True)], c)
