"""What it matters for control which of several models is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array, Complex
from brightgrey.control.linear.analysis import OscillatoryMode, analyse_system
from brightgrey.control.linear.margins import frequency_response
from brightgrey.control.linear.operating_point import contact_mode, trim_point
from brightgrey.control.linear.twist_coordinates import TwistModel, to_twist_coordinates
from brightgrey.kit import StateSpace

__all__ = ["FrequencyBand", "ModelFigures", "excited_band", "model_figures"]

_ENERGY = 0.99  # of the input, that the band holds
_POINTS = 400
_NEAR_STANDSTILL = 3.0  # over f_tanh: there the smoothed sign of speed is 0.995


class FrequencyBand(NamedTuple):
    """Frequencies in Hz."""

    low: float
    high: float


def excited_band(inputs: Sequence[Array], dt: float) -> FrequencyBand:
    """Band that the inputs excite: from one period in the longest of them to where 99 % of the energy is below.

    Parameters
    ----------
    inputs : sequence of ndarray, shape (samples,)
    dt : float
    """
    tops = []
    for u in inputs:
        power = np.square(np.abs(np.fft.rfft((u - u.mean()) * np.hanning(len(u)))))
        total = np.cumsum(power)
        top = int(np.searchsorted(total, _ENERGY * total[-1])) if total[-1] > 0.0 else 1
        tops.append(max(top, 2) / (len(u) * dt))
    return FrequencyBand(1.0 / (max(len(u) for u in inputs) * dt), max(tops))


@dataclass(frozen=True)
class ModelFigures:
    """What one model says to a control engineer, SI.

    Attributes
    ----------
    response : ndarray, shape (m,)
        From the input to the first output, over the band, at half of the largest speed, dead time included.
    ratio, phase : float
        Largest difference from the first model over the band: ratio of magnitudes in dB, angle in degrees.
    at : float
        Where the ratio is largest, Hz.
    poles : tuple of complex
        In 1/s, the slowest first.
    resonances : tuple of OscillatoryMode
    lag : float
        Dead time in s; other lags are among the poles.
    friction, constant : float
        Input against friction just before standstill, and constant part of the input there.
    """

    response: Complex
    gain_difference: float
    phase_difference: float
    frequency: float
    poles: tuple[complex, ...]
    resonances: tuple[OscillatoryMode, ...]
    dead_time: float
    standstill_friction: float
    constant_input: float


def model_figures(
    systems: Sequence[StateSpace], speed: float, f_tanh: float, band: FrequencyBand
) -> list[ModelFigures]:
    """Numbers of several models of one drive; the first is what the others are compared with.

    Parameters
    ----------
    systems : sequence of StateSpace
        One parameter set each.
    speed : float
        Of the operating point, rad/s (m/s).
    f_tanh : float
        Gain of the smoothed sign of speed that they were assembled with.
    over : Band

    Raises
    ------
    SettingsError
        Where no steady motion exists.
    """
    omega = 2.0 * np.pi * np.geomspace(band.low, band.high, _POINTS)
    found: list[ModelFigures] = []
    for system in systems:
        transformed = to_twist_coordinates(system)
        point = analyse_system(transformed, speed=speed)
        response = frequency_response(point.linear, omega, point.dead_time)[0]
        ratio, phase, at = _largest_difference(response, found[0].response if found else response, omega)
        friction, constant = _standstill_input(transformed, _NEAR_STANDSTILL / f_tanh)
        poles = tuple(complex(p) for p in point.poles)
        found.append(
            ModelFigures(response, ratio, phase, at, poles, point.resonances, point.dead_time, friction, constant)
        )
    return found


def _largest_difference(one: Complex, other: Complex, omega: Array) -> tuple[float, float, float]:
    """Largest ratio in dB, largest angle in degrees, and where in Hz the ratio is largest."""
    quotient = one / np.where(np.abs(other) > 0.0, other, np.finfo(float).tiny)
    ratio = 20.0 * np.log10(np.maximum(np.abs(quotient), np.finfo(float).tiny))
    k = int(np.argmax(np.abs(ratio)))
    angle = np.degrees(np.abs(np.angle(quotient)))
    return float(ratio[k]), float(angle.max()), float(omega[k] / (2.0 * np.pi))


def _standstill_input(transformed: TwistModel, speed: float) -> tuple[float, float]:
    """Input that keeps up a creeping motion: the part that turns with the motion, and the rest."""
    forth = trim_point(contact_mode(transformed, "forward"), speed).u
    back = trim_point(contact_mode(transformed, "backward"), -speed).u
    return 0.5 * (forth - back), 0.5 * (forth + back)
