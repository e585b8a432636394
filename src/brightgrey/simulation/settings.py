"""How to simulate: variants are data, the engine is written once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

from brightgrey.errors import SettingsError, unknown_name

__all__ = ["Hold", "Level", "Settings", "Stepping", "Tolerances", "stepping_of", "tolerances"]

Level = Literal["accurate", "fast", "euler"]
Hold = Literal["linear", "zoh"]


@dataclass(frozen=True)
class Settings:
    """All that is needed to simulate again, beside model, input and initial state.

    Attributes
    ----------
    f_tanh : float
        Gain of the paper's eq. (2) in s/rad (s/m): 1/f_tanh is the speed at which friction has turned.
    speed_scale : float
        Largest speed to be expected in rad/s (m/s); the tolerances are relative to it.
    level : {'accurate', 'fast', 'euler'}
        ``accurate`` for all that is reported, ``fast`` for searches, ``euler`` is the paper's explicit method.
    hold : {'linear', 'zoh'}
        Input between samples: linear interpolation or held.
    substeps : int
        Steps per sample of ``euler``; the other levels choose their steps themselves.
    """

    f_tanh: float
    speed_scale: float
    level: Level = "accurate"
    hold: Hold = "linear"
    substeps: int = 1

    def __post_init__(self) -> None:
        for name in ("f_tanh", "speed_scale"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise SettingsError(f"{name} is {value}; it has to be a positive number")
        for name, value, allowed in (
            ("level", self.level, get_args(Level)),
            ("hold", self.hold, get_args(Hold)),
        ):
            if value not in allowed:
                raise SettingsError(unknown_name(name, str(value), allowed))
        if self.substeps < 1:
            raise SettingsError(f"substeps is {self.substeps}; at least 1 is needed")


class Tolerances(NamedTuple):
    """What a level stands for.

    Attributes
    ----------
    error : float
        Tolerated estimate of a step's error, relative to the speed scale.
    newton : int
        Newton iterations per step.
    change : float
        Tolerated last change of Newton, relative to the speed scale.
    ticks : int
        A part of a sample may be cut into 2^ticks pieces.
    turn : float
        Largest angle in rad by which the fastest oscillation may turn in a part when there are limits.
    most : int
        ... which then is no smaller than a sample over this.
    looks : bool
        Whether a base step may take in all parts of a sample, looking at limits within, and a failed step be followed
        by a much shorter one. Else every part is a step, and the half follows: so do the exported programs.
    """

    error: float
    newton: int
    change: float
    ticks: int
    turn: float
    most: int
    looks: bool


class Stepping(NamedTuple):
    """Grid of steps: base steps per sample, 2^ticks pieces of each, and points within one at which limits are seen."""

    base_steps: int
    ticks: int
    points: int


def stepping_of(tolerance: Tolerances, parts: int) -> Stepping:
    """Grid of steps of a simulation in which a sample has `parts` parts, a power of two.

    Two looks per part: a parabola then stands for one part, as it does if every part is a step.
    """
    if parts > 1 and tolerance.looks:
        return Stepping(1, tolerance.ticks + parts.bit_length() - 1, 2 * parts - 1)
    return Stepping(parts, tolerance.ticks, 1)


def tolerances(level: Level, limits: bool = False) -> Tolerances:
    """Numbers behind ``accurate`` and ``fast``; measured by bench/accuracy.py.

    Each contact multiplies the error made before it, and two contacts that graze within one base step look like none:
    with `limits` both step finer.
    """
    if level == "fast":
        return Tolerances(error=1e-6 if limits else 1e-4, newton=1, change=1e-3, ticks=5, turn=1.0, most=8, looks=True)
    return Tolerances(error=1e-8 if limits else 5e-7, newton=2, change=1e-4, ticks=7, turn=0.5, most=64, looks=False)
