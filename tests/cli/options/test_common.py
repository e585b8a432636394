"""Texts of options that have a grammar of their own."""

import pytest

from brightgrey.cli.options.common import bounds


@pytest.mark.parametrize(
    ("text", "pair"),
    [
        ("c1=10:20", (10.0, 20.0)),
        ("c1=50%:200% of 120", (60.0, 240.0)),
        ("c1= 50% : 200% of 1.2e2", (60.0, 240.0)),
        ("M_G=50%:200% of -2", (-4.0, -1.0)),
    ],
)
def test_a_bound_is_a_range_or_a_factor_around_an_assumed_value(text, pair):
    (name,) = {text.partition("=")[0]}
    assert bounds([text]) == {name: pytest.approx(pair)}
