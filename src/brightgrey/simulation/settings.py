"""Settings of a simulation: level of accuracy, hold of the input, and the tolerances behind them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

from brightgrey.errors import SettingsError, one_of
from brightgrey.recordings.recording import HOLDS, Hold

__all__ = ["Level", "Settings", "Stepping", "Tolerances", "stepping_of", "tolerances"]

Level = Literal["accurate", "fast", "euler"]


@dataclass(frozen=True)
class Settings:
    """Everything that is needed to repeat a simulation, beside model, input and initial state.

    Attributes
    ----------
    f_tanh : float
        Gain of the paper's eq. (2) in s/rad (s/m): 1/f_tanh is the speed within which friction reverses. With
        ``math.inf``, friction has an exact sign, and what rests stays at rest up to its breakaway torque.
    speed_scale : float
        Largest expected speed in rad/s (m/s); the tolerances are relative to it.
    level : {'accurate', 'fast', 'euler'}
        ``accurate`` for reported results, ``fast`` for searches, ``euler`` for the paper's explicit method.
    hold : {'linear', 'zoh'}
        Input between samples: interpolated linearly, or held.
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
            if not 0.0 < value < float("inf") and not (name == "f_tanh" and value == float("inf")):
                raise SettingsError(f"{name} is {value}; it has to be a positive number")
        one_of("level", self.level, get_args(Level))
        one_of("hold", self.hold, HOLDS)
        if self.level == "euler" and self.f_tanh == float("inf"):
            raise SettingsError("level 'euler' needs a finite f_tanh: it cannot stop a mass")
        if self.substeps < 1:
            raise SettingsError(f"substeps is {self.substeps}; at least 1 is needed")


class Tolerances(NamedTuple):
    """Accuracy of a level, and the steps that it takes."""

    error: float  #: Tolerated estimate of a step's error, relative to the speed scale.
    newton: int  #: Iterations of Newton's method per step.
    change: float  #: Tolerated last change of Newton's method, relative to the speed scale.
    ticks: int  #: A part of a sample may be cut into 2^ticks pieces.
    #: With limits, largest angle in rad by which the fastest oscillation may advance in a part of a sample.
    max_angle: float
    max_parts: int  #: A sample is cut into no more parts than this.
    #: A base step may cover all parts of a sample, with limits watched at points within, and a failed step may be
    #: followed by a much shorter one. Otherwise every part is a step, and a failed step is halved, as the exported
    #: programs do.
    long_steps: bool
    diverged: float = 1e9  #: A simulation has diverged when its states are this many times larger than input and speed.


_ACCURATE = Tolerances(error=5e-7, newton=2, change=1e-4, ticks=7, max_angle=0.5, max_parts=64, long_steps=False)
_FAST = Tolerances(error=1e-4, newton=1, change=1e-3, ticks=5, max_angle=1.0, max_parts=8, long_steps=True)


def tolerances(level: Level, limits: bool = False) -> Tolerances:
    """Tolerances of the levels ``accurate`` and ``fast``; bench/accuracy.py measures what they achieve.

    Each contact with a limit multiplies the error made before it, and two grazing contacts within one base step look
    like none. With `limits`, both levels therefore step finer.
    """
    if level == "fast":
        return _FAST._replace(error=1e-6) if limits else _FAST
    return _ACCURATE._replace(error=1e-8) if limits else _ACCURATE


class Stepping(NamedTuple):
    """Grid of steps: base steps per sample, 2^ticks pieces of each, and points within one that watch the limits."""

    base_steps: int
    ticks: int
    points: int


def stepping_of(tolerance: Tolerances, parts: int) -> Stepping:
    """Grid of steps of a simulation in which a sample has `parts` parts, a power of two.

    A long step watches the limits at two points per part. A parabola then represents one part, as it does where every
    part is a step.
    """
    if parts > 1 and tolerance.long_steps:
        return Stepping(1, tolerance.ticks + parts.bit_length() - 1, 2 * parts - 1)
    return Stepping(parts, tolerance.ticks, 1)
