"""How to simulate: variants are data, the engine is written once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

from brightgrey.errors import SettingsError, unknown_name

__all__ = ["Hold", "Level", "Settings", "Tolerances", "tolerances"]

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
        A base step may be cut into 2^ticks pieces.
    turn : float
        Largest angle in rad by which the fastest oscillation may turn in a base step when there are limits.
    most : int
        ... which then is no smaller than a sample over this.
    """

    error: float
    newton: int
    change: float
    ticks: int
    turn: float
    most: int


def tolerances(level: Level, limits: bool = False) -> Tolerances:
    """Numbers behind ``accurate`` and ``fast``; measured by bench/accuracy.py.

    Each contact multiplies the error made before it, and two contacts that graze within one base step look like none:
    with `limits` both step finer.
    """
    if level == "fast":
        return Tolerances(error=1e-6 if limits else 1e-4, newton=1, change=1e-3, ticks=5, turn=1.0, most=8)
    return Tolerances(error=1e-8 if limits else 5e-7, newton=2, change=1e-4, ticks=7, turn=0.5, most=64)
