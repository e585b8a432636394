"""Dry friction with an exact sign, as linear analysis and describing functions take it: in sliding.

With ``f_tanh = inf`` the law has no slope at standstill, because the drive sticks there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from brightgrey.effects import Element, Law
from brightgrey.kit import StateSpace

__all__ = ["breakaway_torque", "sliding"]


def sliding(element: Element) -> Element:
    """Return dry friction as it is in sliding, any other element as it is.

    At standstill it has the slope of the sliding drive, and the mean of both directions, 0.
    """
    amplitude = element.law.amplitude
    if amplitude is None or not element.has_exact_sign:
        return element

    def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
        a, slope = amplitude(np.abs(z[0]), p)
        return -np.sign(z[0]) * a, (-slope,)

    law = Law(element.law.parameters[:-1], value, odd=True, dissipative=True)
    return replace(element, law=law, p=element.p[:-1])


def breakaway_torque(system: StateSpace) -> float:
    """Torque, N m (N), that exact dry friction of all masses withstands at rest; 0 where friction is smooth."""
    total = 0.0
    for e in system.elements:
        if e.law.amplitude is not None and e.has_exact_sign:
            total += float(e.law.amplitude(0.0, e.p[:-1])[0])
    return total
