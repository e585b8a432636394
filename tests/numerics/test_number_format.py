"""Digits follow the uncertainty."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from brightgrey.numerics.number_format import significant, with_uncertainty


@pytest.mark.parametrize(
    ("value", "half_width", "expected"),
    [
        (91.0234, 0.51, ("91.02", "0.51")),
        (0.99999, 0.0001, ("0.99999", "0.00010")),
        (0.9996, 0.0099, ("0.9996", "0.0099")),
        (9.996, 0.0996, ("10.00", "0.10")),
        (123456.7, 234.0, ("123460", "230")),
        (2.66e-4, 1e-6, ("2.660e-04", "0.010e-04")),
        (-3.36, 0.034, ("-3.360", "0.034")),
        (3.0, 500.0, ("3.0", "500")),
        (32.4, 9100.0, ("32", "9100")),
        (3.0, 29.0, ("3", "29")),
        (6.2e4, 3e300, ("62000", "3.0e+300")),
        (94.1, None, ("94.1", "")),
        (94.1, math.nan, ("94.1", "")),
        (94.1, math.inf, ("94.1", "")),
        (94.1, 0.0, ("94.1", "")),
        (math.nan, 1.0, ("-", "")),
        (20.0, 1e-14, ("20.00000000", "1.0e-14")),
    ],
)
def test_with_uncertainty__is_cut_at_the_second_digit_of_the_half_width(value, half_width, expected):
    assert with_uncertainty(value, half_width) == expected


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (2.5968, "2.597"), (1.23449e-7, "1.234e-07"), (-99.996, "-100.0"), (math.inf, "-")],
)
def test_significant__has_four_digits(value, text):
    assert significant(value) == text


magnitudes = st.floats(1e-12, 1e12)


@given(value=magnitudes, sign=st.sampled_from((-1.0, 1.0)), relative=st.floats(1e-7, 1e3))
def test_with_uncertainty__rounds_by_a_twentieth_of_it_at_most(value, sign, relative):
    half_width = relative * value
    shown, shown_half = with_uncertainty(sign * value, half_width)
    # Cut at the second digit of the half width: at most half a unit there, and that unit is at most a tenth.
    assert abs(float(shown) - sign * value) <= 0.0501 * half_width
    assert float(shown_half) == pytest.approx(half_width, rel=0.051)
