"""Harmonic balance of limit cycles through a gap: the harmonics that the describing function leaves out.

The position in a gap is no sine, and a light motor before the gap follows its harmonics. The harmonic balance (Mees
1972, doi:10.1093/imamat/9.1.25) therefore carries them round the loop, starting at the describing function's
prediction. Friction and torque limit keep their gains for the fundamental.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from brightgrey.arrays import Array, Complex

__all__ = ["GapLoop", "HarmonicBalance", "HarmonicBalanceOptions", "gap_harmonics", "harmonic_balance"]


@dataclass(frozen=True)
class HarmonicBalanceOptions:
    """Resolution and tolerances of the harmonic balance."""

    harmonics: tuple[int, ...] = (1, 3, 5, 7, 9)  #: Odd ones only, because the loop is odd.
    period_steps: int = 360  #: Steps in which the gap is followed over a period.
    transient_periods: int = 2  #: Periods before the one that is evaluated.
    gain_updates: int = 3  #: Solutions, each with the friction gain of the fundamental before it.
    max_evaluations: int = 40  #: Of the loop in each solution.
    tolerance: float = 1e-3  #: Largest residual over half the gap.
    #: Largest change of frequency and amplitude against the describing function, in the logarithm.
    max_shift: float = 0.5


HARMONIC_BALANCE = HarmonicBalanceOptions()


@dataclass(frozen=True)
class GapLoop:
    """A gap and the closed loop around it."""

    #: Half the width of the gap, and the feedback of the position in it to its rate, 1/s.
    half_width: float
    feedback: float
    port: Array  #: Row that gives the rate of the position from the other states, shape (n,).
    #: From angular frequencies (h,) and the fundamental of the states (n,) to the states (h, n) for a position of
    #: amplitude 1 in the gap.
    states_per_position: Callable[[Array, Complex], Complex]


class HarmonicBalance(NamedTuple):
    """Angular frequency in rad/s, and the fundamental of the states."""

    omega: float
    states: Complex


def gap_harmonics(
    half_width: float, feedback: float, omega: float, drive: Complex, options: HarmonicBalanceOptions = HARMONIC_BALANCE
) -> Complex:
    """Harmonics of an integrator kept within its limits, from those of its input; both shape (harmonics,)."""
    harmonics, steps = np.array(options.harmonics), options.period_steps
    h = 2.0 * np.pi / (omega * steps)
    decay = float(np.exp(feedback * h))
    gain = float(np.expm1(feedback * h)) / feedback if feedback else h
    angles = 2.0 * np.pi * (np.arange(steps) + 0.5) / steps
    increments = gain * np.real(np.exp(1j * np.outer(angles, harmonics)) @ drive)
    position, period = 0.0, np.empty(steps)
    for _ in range(options.transient_periods + 1):
        for k, increment in enumerate(increments.tolist()):
            position = min(max(decay * position + increment, -half_width), half_width)
            period[k] = position
    ends = 2.0 * np.pi * (np.arange(steps) + 1.0) / steps
    return np.asarray(2.0 / steps * np.exp(-1j * np.outer(harmonics, ends)) @ period, complex)


def harmonic_balance(
    gap: GapLoop, omega: float, states: Complex, options: HarmonicBalanceOptions = HARMONIC_BALANCE
) -> HarmonicBalance | None:
    """Refine a predicted oscillation by its harmonics; None where no balance is found near it.

    Parameters
    ----------
    gap : GapLoop
    omega : float
        Predicted angular frequency, rad/s.
    states : ndarray, shape (n,)
        Predicted fundamental of the states.
    options : HarmonicBalanceOptions
    """
    harmonics = np.array(options.harmonics)
    drive = np.zeros(len(harmonics), complex)
    drive[0] = complex(states @ gap.port)
    position = gap_harmonics(gap.half_width, gap.feedback, omega, drive, options)
    shift = np.exp(-1j * np.angle(position[0]) * harmonics)  # the time at which the fundamental is real
    fundamental = states * shift[0]

    def unpack(p: Array) -> tuple[float, Complex, Complex]:
        """Angular frequency, harmonics of the position in the gap, and those of the states."""
        w = omega * float(np.exp(p[0]))
        position: Complex = np.asarray(gap.half_width * np.append(p[1], p[2::2] + 1j * p[3::2]), complex)
        per_position = gap.states_per_position(w * harmonics, fundamental)
        return w, position, per_position * position[:, None]

    def residual(p: Array) -> Array:
        w, position, each = unpack(p)
        after = gap_harmonics(gap.half_width, gap.feedback, w, each @ gap.port, options)
        difference = (after - position) / gap.half_width
        return np.concatenate([difference.real, difference.imag])

    found = np.append(0.0, _to_real(position * shift / gap.half_width))
    for _ in range(options.gain_updates):
        diff_step = np.full(len(found), 1e-5)
        solution = least_squares(residual, found, diff_step=diff_step, x_scale=0.1, max_nfev=options.max_evaluations)
        found = solution.x
        fundamental = unpack(found)[2][0]
    ratio = max(float(np.linalg.norm(fundamental) / np.linalg.norm(states)), 1e-300)
    near = abs(found[0]) <= options.max_shift and abs(np.log(ratio)) <= options.max_shift
    if not near or np.abs(solution.fun).max() > options.tolerance:
        return None
    return HarmonicBalance(omega * float(np.exp(found[0])), fundamental)


def _to_real(position: Complex) -> Array:
    """Real numbers for the harmonics, the first of which is real."""
    rest = np.column_stack([position[1:].real, position[1:].imag]).ravel()
    return np.append(position[0].real, rest)
