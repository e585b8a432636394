"""Limit cycles through a gap with their harmonics: what the describing function leaves out.

The position in a gap is no sine, and a light motor in front of it follows its harmonics. They are therefore followed
round the loop (harmonic balance, Mees 1972, doi:10.1093/imamat/9.1.25), from the describing function's prediction on.
Friction and torque limit keep their gains for the fundamental.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from brightgrey.arrays import Array, Complex

__all__ = ["GapLoop", "HarmonicBalance", "gap_harmonics", "harmonic_balance"]

_HARMONICS = np.array([1, 3, 5, 7, 9])  # odd: the loop is odd
_STEPS = 360  # in a period
_SETTLED = 2  # periods before the one that counts
_MET = 1e-3  # of half the gap
_NEAR = 0.5  # of the describing function's frequency and size, in the logarithm


@dataclass(frozen=True)
class GapLoop:
    """A gap and the closed loop around it.

    Attributes
    ----------
    half, feedback : float
        Half its width, and how its position feeds back to its rate, 1/s.
    port : ndarray, shape (n,)
        Row of the states that drives it.
    states : callable
        From angular frequencies (h,) and the fundamental's states (n,) to the states (h, n) that a position of
        amplitude 1 in the gap leaves at each frequency.
    """

    half_width: float
    feedback: float
    port: Array
    states_per_position: Callable[[Array, Complex], Complex]


class HarmonicBalance(NamedTuple):
    """Angular frequency in rad/s, and the fundamental of the states."""

    omega: float
    states: Complex


def gap_harmonics(half: float, feedback: float, omega: float, drive: Complex) -> Complex:
    """Harmonics of an integrator kept in [-half, half], from those of what drives it; both shape (harmonics,)."""
    h = 2.0 * np.pi / (omega * _STEPS)
    decay = float(np.exp(feedback * h))
    gain = float(np.expm1(feedback * h)) / feedback if feedback else h
    angles = 2.0 * np.pi * (np.arange(_STEPS) + 0.5) / _STEPS
    pushes = gain * np.real(np.exp(1j * np.outer(angles, _HARMONICS)) @ drive)
    at, course = 0.0, np.empty(_STEPS)
    for _ in range(_SETTLED + 1):
        for k, push in enumerate(pushes.tolist()):
            at = min(max(decay * at + push, -half), half)
            course[k] = at
    ends = 2.0 * np.pi * (np.arange(_STEPS) + 1.0) / _STEPS
    return np.asarray(2.0 / _STEPS * np.exp(-1j * np.outer(_HARMONICS, ends)) @ course, complex)


def harmonic_balance(gap: GapLoop, omega: float, states: Complex) -> HarmonicBalance | None:
    """Improve a predicted oscillation; None where no balance is found near it.

    Parameters
    ----------
    gap : GapLoop
    omega : float
        rad/s.
    states : ndarray, shape (n,)
        Fundamental of the states as predicted.
    """
    first = gap_harmonics(gap.half_width, gap.feedback, omega, _fundamental_only(complex(states @ gap.port)))
    turn = np.exp(-1j * np.angle(first[0]) * _HARMONICS)
    start = _to_real(first * turn / gap.half_width)
    known = states * turn[0]

    def at(p: Array) -> tuple[float, Complex, Complex]:
        w = omega * float(np.exp(p[0]))
        position: Complex = np.asarray(gap.half_width * np.append(p[1], p[2::2] + 1j * p[3::2]), complex)
        per_position = gap.states_per_position(w * _HARMONICS, known)
        return w, position, per_position * position[:, None]

    def miss(p: Array) -> Array:
        w, position, each = at(p)
        new = gap_harmonics(gap.half_width, gap.feedback, w, each @ gap.port)
        wrong = (new - position) / gap.half_width
        return np.concatenate([wrong.real, wrong.imag])

    begin = np.concatenate([[0.0], start])
    found = begin
    for _ in range(3):  # friction's gain follows the fundamental
        solution = least_squares(miss, found, diff_step=np.full(len(found), 1e-5), x_scale=0.1, max_nfev=40)
        found = solution.x
        known = at(found)[2][0]
    size = max(float(np.linalg.norm(known) / np.linalg.norm(states)), 1e-300)
    if np.abs(solution.fun).max() > _MET or abs(found[0]) > _NEAR or abs(np.log(size)) > _NEAR:
        return None
    return HarmonicBalance(omega * float(np.exp(found[0])), known)


def _fundamental_only(fundamental: complex) -> Complex:
    drive = np.zeros(len(_HARMONICS), complex)
    drive[0] = fundamental
    return drive


def _to_real(position: Complex) -> Array:
    """Real numbers for the harmonics, the first of which is real."""
    rest = np.column_stack([position[1:].real, position[1:].imag]).ravel()
    return np.append(position[0].real, rest)
