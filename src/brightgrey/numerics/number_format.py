"""Numbers for people: as many digits as the uncertainty justifies, and no more."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["is_drowned", "significant", "with_uncertainty"]


@dataclass(frozen=True)
class NumberStyle:
    """Digits of the numbers in report, terminal and notebook."""

    plain: tuple[float, float] = (1e-3, 1e6)  #: Magnitudes that are written without an exponent.
    drowned: float = 10.0  #: Half width over value beyond which the cut may leave no digit of the value.
    #: Most significant digits of a value; beyond them only the end of double precision would show.
    max_digits: int = 10


NUMBER_STYLE = NumberStyle()


def significant(value: float, digits: int = 4) -> str:
    """`value` with `digits` significant digits, ``2.597`` or ``1.3e-07``."""
    if not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    exponent = _exponent(value, digits)
    return _decimal(value, exponent, digits - 1 - exponent)


def is_drowned(value: float, half_width: float | None) -> bool:
    """True if the half width of the interval is more than ten times the value, as in ``32 ± 9100``."""
    if half_width is None or not math.isfinite(half_width) or not math.isfinite(value) or value == 0.0:
        return False
    return half_width > NUMBER_STYLE.drowned * abs(value)


def with_uncertainty(value: float, half_width: float | None, digits: int = 5) -> tuple[str, str]:
    """`value` and the half width of its interval, both cut at the second digit of the latter.

    Where the interval drowns the value, so that this cut would leave nothing of it, both have two significant digits.
    Without a half width (fixed, or unknown) the value has up to `digits` significant digits and the second text is
    empty.
    """
    if half_width is None or not math.isfinite(half_width) or half_width <= 0.0 or not math.isfinite(value):
        return (f"{value:.{digits}g}" if math.isfinite(value) else "-"), ""
    if is_drowned(value, half_width):
        return significant(value, 2), significant(half_width, 2)
    last = _exponent(half_width, 2) - 1  # decimal place of the second digit
    exponent = max(_exponent(value, 6) if value else last, last)
    if exponent - last >= NUMBER_STYLE.max_digits:
        return _decimal(value, exponent, NUMBER_STYLE.max_digits - 1 - exponent), significant(half_width, 2)
    return _decimal(value, exponent, -last), _decimal(half_width, exponent, -last)


def _exponent(value: float, digits: int) -> int:
    """Decimal exponent of `value` after rounding to `digits` digits, so that 0.99999 counts as 1."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def _decimal(value: float, exponent: int, places: int) -> str:
    """`value` with `places` decimal places, by an exponent where the magnitude is out of the plain range."""
    if NUMBER_STYLE.plain[0] <= 10.0**exponent < NUMBER_STYLE.plain[1]:
        return f"{round(value, places):.{max(places, 0)}f}"
    text = f"{value / 10.0**exponent:.{max(places + exponent, 0)}f}"
    return f"{text}e{exponent:+03d}"
