"""Nuisance parameters: estimated with those of the structure, but no property of the drive that anybody asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array

__all__ = [
    "FRICTION_WIDTH",
    "FRICTION_WIDTH_RANGE",
    "FrictionWidthRange",
    "Nuisance",
    "friction_gain",
    "friction_width_nuisance",
]

FRICTION_WIDTH = "friction_width"
"""Name of the speed within which dry friction reverses: the inverse of f_tanh in eq. (2). It is 0 for an exact sign."""


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


def friction_gain(values: Mapping[str, Array | float], otherwise: float) -> Array | float:
    """Gain of the sign of dry friction, f_tanh in eq. (2): infinite for a width of 0, `otherwise` without a width."""
    if FRICTION_WIDTH not in values:
        return otherwise
    width = np.asarray(values[FRICTION_WIDTH], float)
    gain: Array = np.divide(1.0, width, out=np.full_like(width, np.inf), where=width > 0.0)
    return gain
