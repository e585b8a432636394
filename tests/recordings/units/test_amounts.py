"""Amounts with few digits and a prefix that suits them."""

import pytest

from brightgrey.recordings.units.amounts import amount, rounded


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.4e-4, "rad", "0.14 mrad"),
        (5e-5, "s", "50 µs"),
        (0.4, "rad", "0.4 rad"),  # from a tenth on, the unit stays
        (-0.002, "m", "-2 mm"),
        (0.0, "s", "0 s"),
        (3e-9, "mm", "3e-06 µm"),  # there is no smaller unit
        (0.00123, "N m s/rad", "0.0012 N m s/rad"),  # no prefix within a product
        (2.0, "", "2"),
        (float("inf"), "s", "inf s"),
    ],
)
def test_amount__small_value__has_the_prefix_that_suits_it(value, unit, text):
    assert amount(value, unit) == text


def test_rounded__keeps_significant_digits_and_drops_zeros():
    assert (rounded(1.999), rounded(19.84, 3), rounded(100.0)) == ("2", "19.8", "100")
