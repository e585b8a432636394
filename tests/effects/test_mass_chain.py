"""Chains with fewer masses that behave alike."""

import numpy as np
import pytest

from brightgrey.effects import registry
from brightgrey.simulation.reference import reference

STIFF = 2e5


@pytest.mark.parametrize("rigid", [1, 2, 3])
def test_merge__rigid_shaft__moves_as_the_whole_did(rigid):
    """Wherever the rigid shaft is, one of the shorter chains moves as the whole did."""
    values = {"J1": 0.01, "J2": 0.008, "J3": 0.006, "J4": 0.004} | {f"d{k}": 0.05 for k in (1, 2, 3)}
    values |= {f"c{k}": STIFF if k == rigid else 100.0 + k for k in (1, 2, 3)}
    every = registry()["four_mass"].search.merge(values, 3)
    assert len(every) == 3
    fewer = every[rigid - 1]
    assert set(fewer) == {q.symbol for q in registry()["three_mass"].parameters}
    torque = np.sin(2.0 * np.pi * 4.0 * 0.001 * np.arange(400))
    whole, left = (
        reference(name, parameters, torque, 0.001, f_tanh=4.0)[0]
        for name, parameters in (("four_mass", values), ("three_mass", fewer))
    )
    np.testing.assert_allclose(left, whole, atol=2e-3 * np.abs(whole).max())


def test_merge__down_to_one_mass__keeps_the_inertia():
    values = {"J1": 1.0, "J2": 2.0, "J3": 4.0, "c1": 1.0, "c2": 1.0, "d1": 1.0, "d2": 1.0}
    assert registry()["three_mass"].search.merge(values, 1) == [{"J1": 7.0}]
    assert registry()["one_mass"].search.merge is None
