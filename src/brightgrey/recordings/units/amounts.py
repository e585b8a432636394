"""Amounts for people: a few digits, with the prefix of the unit that suits them."""

from __future__ import annotations

import math

__all__ = ["amount", "rounded"]

THOUSANDTHS = {"s": "ms", "ms": "µs", "m": "mm", "mm": "µm", "rad": "mrad", "mrad": "µrad"}
"""A thousandth of each unit."""


def rounded(value: float, digits: int = 2) -> str:
    """`value` with at most so many significant digits, without zeros at its end."""
    return f"{float(f'{value:.{digits}g}'):g}"


def amount(value: float, unit: str, digits: int = 2) -> str:
    """`value` and its unit, in a thousandth of the unit where it is below one: ``0.14 mrad``, not ``0.00014 rad``.

    A value from a tenth on keeps its unit, so that 0.4 rad/s and 0.4 rad look alike.
    """
    scale = abs(value)
    while math.isfinite(scale) and 0.0 < scale < 0.1 and unit in THOUSANDTHS:
        value, scale, unit = 1e3 * value, 1e3 * scale, THOUSANDTHS[unit]
    return f"{rounded(value, digits)} {unit}".rstrip()
