"""Differences between models of one drive that matter for control."""

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


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of the comparison of models."""

    energy: float = 0.99  #: Part of the inputs' energy that the band holds.
    points: int = 400  #: Frequencies of the band.
    #: Speed near standstill, over the speed scale of the smoothed sign of speed. The sign is 0.995 there. An exact sign
    #: has none, and any speed will do.
    creep: float = 3.0


COMPARISON = ComparisonOptions()


class FrequencyBand(NamedTuple):
    """Lowest and highest frequency in Hz."""

    low: float
    high: float


def excited_band(inputs: Sequence[Array], dt: float, options: ComparisonOptions = COMPARISON) -> FrequencyBand:
    """Band that the inputs excite: from one period in the longest of them to 99 % of their energy.

    Parameters
    ----------
    inputs : sequence of ndarray, shape (samples,)
    dt : float
        Sampling interval, s.
    options : ComparisonOptions
    """
    tops = []
    for u in inputs:
        power = np.square(np.abs(np.fft.rfft((u - u.mean()) * np.hanning(len(u)))))
        total = np.cumsum(power)
        top = int(np.searchsorted(total, options.energy * total[-1])) if total[-1] > 0.0 else 1
        tops.append(max(top, 2) / (len(u) * dt))
    return FrequencyBand(1.0 / (max(len(u) for u in inputs) * dt), max(tops))


@dataclass(frozen=True)
class ModelFigures:
    """Properties of one model that matter for control, SI."""

    #: From the input to the first output, over the band, at half of the largest speed, dead time included, shape (m,).
    response: Complex
    #: Largest differences from the first model over the band, dB and degrees.
    gain_difference: float
    phase_difference: float
    frequency: float  #: Of the largest difference of the gain, Hz.
    poles: tuple[complex, ...]  #: In 1/s, slowest first.
    resonances: tuple[OscillatoryMode, ...]
    dead_time: float  #: Of the input, s; other lags are among the poles.
    #: Input against friction near standstill, and the constant part of the input there, N m (N).
    standstill_friction: float
    constant_input: float


def model_figures(
    systems: Sequence[StateSpace],
    speed: float,
    f_tanh: float,
    band: FrequencyBand,
    options: ComparisonOptions = COMPARISON,
) -> list[ModelFigures]:
    """Compare several models of one drive with the first of them.

    Parameters
    ----------
    systems : sequence of StateSpace
        One parameter set each.
    speed : float
        Of the operating point, rad/s (m/s).
    f_tanh : float
        Gain of the sign of speed that they were assembled with, may be infinite.
    band : FrequencyBand
    options : ComparisonOptions

    Raises
    ------
    SettingsError
        If a model has no steady motion.
    """
    omega = 2.0 * np.pi * np.geomspace(band.low, band.high, options.points)
    found: list[ModelFigures] = []
    for system in systems:
        transformed = to_twist_coordinates(system)
        point = analyse_system(transformed, speed=speed)
        response = frequency_response(point.linear, omega, point.dead_time)[0]
        ratio, phase, at = _largest_difference(response, found[0].response if found else response, omega)
        friction, constant = _standstill_input(transformed, options.creep / f_tanh or np.finfo(float).tiny)
        poles = tuple(complex(p) for p in point.poles)
        found.append(
            ModelFigures(response, ratio, phase, at, poles, point.resonances, point.dead_time, friction, constant)
        )
    return found


def _largest_difference(one: Complex, other: Complex, omega: Array) -> tuple[float, float, float]:
    """Largest ratio in dB, largest angle in degrees, and the frequency in Hz of the largest ratio."""
    quotient = one / np.where(np.abs(other) > 0.0, other, np.finfo(float).tiny)
    ratio = 20.0 * np.log10(np.maximum(np.abs(quotient), np.finfo(float).tiny))
    k = int(np.argmax(np.abs(ratio)))
    angle = np.degrees(np.abs(np.angle(quotient)))
    return float(ratio[k]), float(angle.max()), float(omega[k] / (2.0 * np.pi))


def _standstill_input(transformed: TwistModel, speed: float) -> tuple[float, float]:
    """Input of a creeping motion: the part that reverses with the motion, and the constant part."""
    forth = trim_point(contact_mode(transformed, "forward"), speed).u
    back = trim_point(contact_mode(transformed, "backward"), -speed).u
    return 0.5 * (forth - back), 0.5 * (forth + back)
