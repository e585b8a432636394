"""Linear control loops: controllers, frequency responses with exact dead time, and stability margins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag

from brightgrey.arrays import Array, Complex
from brightgrey.control.policy import ANALYSIS
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


@dataclass(frozen=True)
class Compensator:
    """Linear controller from a control error e to the input u: ``k' = A k + B e``, ``u = C k + D e``.

    Attributes
    ----------
    A, B, C, D : ndarray, shape (n, n), (n, 1), (1, n), (1, 1)
    """

    A: Array
    B: Array
    C: Array
    D: Array

    largest: ClassVar[float] = 1e30
    """Largest coefficient, over the first one of the denominator, whose products a computer can hold."""

    @classmethod
    def of(cls, numerator: Sequence[float], denominator: Sequence[float]) -> Compensator:
        """Controller from its transfer function, coefficients in falling powers of s.

        Raises
        ------
        SettingsError
            If a coefficient is no finite number, the transfer function is not proper, or its coefficients differ
            beyond all measure.
        """
        try:
            top, bottom = (np.trim_zeros(np.atleast_1d(np.asarray(c, float)), "f") for c in (numerator, denominator))
        except (TypeError, ValueError):
            top = bottom = np.full((1, 1), np.nan)
        if not (top.ndim == bottom.ndim == 1 and np.isfinite(top).all() and np.isfinite(bottom).all()):
            raise SettingsError(f"controller {numerator}/{denominator}: expected are two lists of finite numbers")
        numerator, denominator = top.tolist(), bottom.tolist()
        if not len(bottom) or not len(top) or len(top) > len(bottom):
            raise SettingsError(
                f"controller {list(numerator)}/{list(denominator)} is not proper: both polynomials need a coefficient "
                "other than 0, and the degree of the numerator must not exceed that of the denominator"
            )
        size = float(np.abs(np.concatenate([top, bottom])).max()) / abs(float(bottom[0]))
        if not size < cls.largest:
            raise SettingsError(
                f"controller {list(numerator)}/{list(denominator)}: a coefficient reaches {size:.3g} times the first "
                f"one of the denominator; allowed is {cls.largest:g}"
            )
        if len(bottom) == 1:
            return cls(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[top[0] / bottom[0]]]))

        n = len(bottom) - 1
        b, a = np.append(np.zeros(n + 1 - len(top)), top / bottom[0]), bottom / bottom[0]
        return cls(np.vstack([-a[1:], np.eye(n - 1, n)]), np.eye(n, 1), (b[1:] - b[0] * a[1:])[None], b[:1, None])

    def response(self, omega: Array) -> Complex:
        """Frequency response, shape (frequencies,), at angular frequencies in rad/s."""
        return np.asarray(frequency_response(Linear(self.A, self.B, self.C, self.D), omega)[0])

    def discretise(self, dt: float) -> Compensator:
        """Discretise with the sampling interval `dt` in s, by the trapezoidal rule (Tustin)."""
        n = len(self.A)
        left = np.linalg.inv(np.eye(n) - 0.5 * dt * self.A)
        A = left @ (np.eye(n) + 0.5 * dt * self.A)
        B = left @ self.B * dt
        return Compensator(A, B, self.C @ left, self.D + 0.5 * self.C @ B)


@dataclass(frozen=True)
class Margins:
    """Stability margins of a closed loop.

    Attributes
    ----------
    stable : bool
        All poles of the closed loop have a negative real part (dead time by a Padé approximation of order 6).
    gain : float
        Gain margin: smallest factor above 1 on the loop gain at the limit of stability; inf if there is none.
    gain_down : float
        Gain reduction margin: largest factor below 1 at the limit of stability; 0 if there is none.
    phase : float
        Phase margin, degrees; inf if the loop gain never crosses 1.
    delay : float
        Delay margin: smallest additional dead time at the limit of stability, s.
    sensitivity : float
        Peak of the sensitivity ``1/|1 + L|``, a ratio. Below 2 the loop is well damped.
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
    """Grid in rad/s that is denser around the given poles and zeros.

    It begins three decades below the slowest of them and ends at `top`, or two decades above the fastest. A root more
    than nine decades below the fastest one is taken for the rounding error of a multiple one at 0.
    """
    sizes = [abs(r) for r in roots if abs(r) > 1e-9]
    low, high = (max(min(sizes) * 1e-3, 1e-9 * max(sizes)), max(sizes) * 1e2) if sizes else (1e-2, 1e4)
    high = top or high
    low = min(low, high * 1e-4)
    grid = [np.geomspace(low, high, int(ANALYSIS.points_per_decade * math.log10(high / low)))]
    for r in roots:
        center, width = abs(r.imag), max(abs(r.real), 1e-6 * abs(r.imag))
        if center > 0.0:
            around = center + width * np.linspace(-6.0, 6.0, 120)  # an even number: an undamped pole is between two
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
    """Stability margins of the loop ``L = compensator * plant`` with negative feedback of one output.

    An integral part whose pole the plant cancels by a zero at 0 does not count. With a speed controller and a load that
    depends on the position that is so: the position stays wherever it is.

    Parameters
    ----------
    linear : Linear
    compensator : Compensator
    output : int
        Index of the output that is fed back.
    dead_time : float
        Of the drive and the computer, and half a sampling interval for the hold, s.
    """
    one = Linear(linear.A, linear.B, linear.C[output : output + 1], linear.D[output : output + 1])
    loop = open_loop(compensator, one)
    roots = [*np.linalg.eigvals(loop.A), *_poles_of_closed(loop, dead_time)]
    if dead_time > 0.0:
        roots.append(complex(1.0 / dead_time))
    omega = frequency_grid(roots)
    L = frequency_response(loop, omega, dead_time)[0]

    def at(w: float) -> complex:
        return complex(frequency_response(loop, np.array([w]), dead_time)[0, 0])

    gains, phases, delays, crossover = _crossings(omega, L, at)
    poles = _poles_of_closed(loop, dead_time)
    if _cancels_integral(compensator, one):
        poles = np.delete(poles, np.argmin(np.abs(poles)))
    return Margins(
        stable=bool(np.all(poles.real < 0.0)),
        gain=min((g for g in gains if g > 1.0), default=math.inf),
        gain_down=max((g for g in gains if 0.0 < g < 1.0), default=0.0),
        phase=min(phases, default=math.inf),
        delay=min(delays, default=math.inf),
        sensitivity=float(np.max(1.0 / np.abs(1.0 + L))),
        crossover=crossover,
    )


def _cancels_integral(compensator: Compensator, one: Linear) -> bool:
    """True if a controller has an integral part, and the plant a zero at 0 and no pole there."""
    rounding = ANALYSIS.axis_tolerance
    of_controller, of_plant = (np.abs(np.linalg.eigvals(A)) for A in (compensator.A, one.A))
    if not (of_controller <= rounding * of_controller.max(initial=1.0)).any():
        return False
    if not of_plant.size or of_plant.min() <= rounding * of_plant.max():
        return False
    at_zero = np.linalg.solve(one.A, one.B)[:, 0]
    gain, terms = one.D[0, 0] - one.C[0] @ at_zero, np.abs(one.C[0]) @ np.abs(at_zero) + abs(one.D[0, 0])
    return bool(
        abs(gain) <= rounding * np.linalg.cond(one.A) * max(terms, np.linalg.norm(one.C) * np.abs(at_zero).max())
    )


def _crossings(
    omega: Array, L: Complex, at: Callable[[float], complex]
) -> tuple[list[float], list[float], list[float], float]:
    """Gain margins where L is real and negative; phase and delay margins, and crossover, where ``|L| = 1``."""
    from scipy.optimize import brentq  # imported here: it takes long, and most analyses ask for no margins

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
    """Series connection of the compensator and a plant with one output."""
    A = block_diag(compensator.A, plant.A)
    m = len(compensator.A)
    A[m:, :m] = plant.B @ compensator.C
    B = np.vstack([compensator.B, plant.B @ compensator.D])
    return Linear(A, B, np.hstack([plant.D @ compensator.C, plant.C]), plant.D @ compensator.D)


def closed_loop_poles(linear: Linear, compensator: Compensator, dead_time: float = 0.0) -> Complex:
    """Poles in 1/s of the loop closed over the first output, dead time by a Padé approximation."""
    return _poles_of_closed(open_loop(compensator, linear), dead_time)


def _poles_of_closed(loop: Linear, dead_time: float) -> Complex:
    if dead_time > 0.0:
        loop = open_loop(_pade(dead_time), loop)
    feedback = loop.B @ loop.C / (1.0 + loop.D[0, 0])
    return np.asarray(np.linalg.eigvals(loop.A - feedback))


def _pade(dead_time: float) -> Compensator:
    """Padé approximation of a dead time."""
    n = ANALYSIS.pade_order
    c = [
        math.factorial(2 * n - k) / (math.factorial(k) * math.factorial(n - k)) * dead_time**k for k in range(n, -1, -1)
    ]
    signs = [(-1.0) ** k for k in range(n, -1, -1)]
    return Compensator.of([a * b for a, b in zip(c, signs, strict=True)], c)
