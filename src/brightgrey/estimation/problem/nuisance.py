"""Nuisance parameters: estimated with those of the structure, but no property of the drive that anybody asks for."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FRICTION_WIDTH", "FRICTION_WIDTH_RANGE", "FrictionWidthRange", "Nuisance", "friction_width_nuisance"]

FRICTION_WIDTH = "friction_width"
"""Name of the speed within which dry friction reverses: the inverse of f_tanh in eq. (2)."""


@dataclass(frozen=True)
class Nuisance:
    """A nuisance parameter in SI: part of an initial state, or the width of friction's reversal."""

    name: str
    #: Bounds and start value.
    low: float
    high: float
    start: float
    sampled: bool = True  #: False if all samples of a search have the start value.
    log: bool = False  #: True if it is always positive and searched on a logarithmic scale.


@dataclass(frozen=True)
class FrictionWidthRange:
    """Range of the width of friction's reversal, relative to the largest speed."""

    #: The kernel is nearly exact with it: 5e-5 of the peak off (docs/design/dry-friction.md).
    low: float = 1e-4
    high: float = 0.1
    #: Descents begin with a smooth reversal and sharpen it on their way: the cost has fewer local minima there.
    start: float = 1e-2


FRICTION_WIDTH_RANGE = FrictionWidthRange()


def friction_width_nuisance(speed: float) -> Nuisance:
    """Width of friction's reversal for recordings whose largest speed is `speed`, rad/s (m/s)."""
    r = FRICTION_WIDTH_RANGE
    return Nuisance(FRICTION_WIDTH, r.low * speed, r.high * speed, r.start * speed, sampled=False, log=True)
