"""Outliers among siblings: rarely where there are none, surely where one is far off."""

import numpy as np
import pytest

from brightgrey.api.fleet.outliers import OUTLIERS, compare

FAMILIES = 30


def family(rng, size, spread, error, quantities=4):
    """Normal siblings with estimates of different quality."""
    out = {}
    for q in range(quantities):
        s = error * np.exp(0.3 * rng.standard_normal(size))
        out[str(q)] = (rng.standard_normal(size) * np.hypot(spread, s), s)
    return out


@pytest.mark.parametrize(("size", "spread", "error"), [(6, 0.03, 0.01), (6, 0.0, 0.05)])
def test_a_healthy_family_is_rarely_suspected(size, spread, error):
    alarms = 0
    for seed in range(FAMILIES):
        found = compare(family(np.random.default_rng(seed), size, spread, error), seed=seed)
        alarms += any(c.different.any() for c in found.values())
    # More than 6 of 30 have a probability of 6e-4 at a rate of 5 %.
    assert OUTLIERS.chance == 0.05
    assert alarms <= 6


def test_an_outlier_is_found_and_others_are_not():
    found = family(np.random.default_rng(1), 20, 0.03, 0.01)
    values, stds = found["2"]
    values[7] += 1.0
    compared = compare(found)
    assert np.flatnonzero(compared["2"].different).tolist() == [7]
    assert not any(compared[q].different.any() for q in "013")
    again = compare({"2": (values + 5.0, stds)} | {q: found[q] for q in "013"})
    assert again["2"].deviation == pytest.approx(compared["2"].deviation, rel=1e-9)


def test_an_uncertain_estimate_is_no_outlier():
    values, stds = np.zeros(20), np.full(20, 0.01)
    values[:] = 0.01 * np.random.default_rng(0).standard_normal(20)
    values[3], stds[3] = 1.0, 0.6
    assert not compare({"a": (values, stds)})["a"].different.any()
    stds[3] = 0.01
    assert compare({"a": (values, stds)})["a"].different[3]


def test_missing_values_and_few_siblings():
    values = np.array([1.0, 1.1, np.nan, 0.9, 1.0])
    found = compare({"a": (values, np.full(5, 0.1)), "b": (values[:4], np.full(4, 0.1))})
    assert np.isnan(found["a"].deviation[2])
    assert not found["a"].different[2]
    assert "b" not in found
