"""Intervals of estimates."""

import numpy as np
import pytest

from brightgrey.estimation import fit
from brightgrey.kit import Structure
from support.drives import recorded, values_of

TEXT = "one_mass+coulomb+viscous+stribeck"


def test_estimates__size_that_may_be_zero__has_an_interval_from_zero_to_its_reach():
    """The logarithm of a size that noise drowns may be anything; the size is not."""
    truth = values_of(TEXT, f_v=2e-4)
    found = fit(Structure.parse(TEXT), [recorded(TEXT, 5, noise=1.0, f_v=2e-4)], starts=2, patience=0)
    drowned = {n: e for n, e in found.estimates.items() if e.at_bound is None and e.std > 0.6 * abs(e.value)}
    assert drowned
    for name, estimate in drowned.items():
        assert estimate.ci95[0] == 0.0
        assert estimate.value + 1.5 * estimate.std < estimate.ci95[1] < estimate.value + 5.0 * estimate.std
        assert truth[name] < 1.5 * estimate.ci95[1]


@pytest.mark.parametrize("name", ["J1", "M_C"])
def test_estimates__well_known_parameter__has_an_interval_of_its_logarithm(name):
    found = fit(Structure.parse(TEXT), [recorded(TEXT, 5)], starts=2, patience=0).estimates[name]
    low, high = found.ci95
    assert low > 0.0
    assert np.sqrt(low * high) == pytest.approx(found.value)
