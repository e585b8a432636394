"""Directions of the parameter space that a Jacobian does not identify."""

import numpy as np
import pytest

from brightgrey.effects import Scales
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.uncertainty.identifiability import unidentifiable_directions
from brightgrey.kit import PAPER

SCALES = Scales(8.0, 40.0, 600.0, 14.0, 1e-3, 1.8, 0.02, 1.1, 0.007, 0.1)
SPACE = parameter_space(PAPER.parse("one_mass+coulomb+viscous"), SCALES, {}, {})
INSIDE = np.arange(3)


def test_unidentifiable_directions__parallel_columns__are_blind():
    a, b = np.random.default_rng(2).standard_normal((2, 1500))
    (found,) = unidentifiable_directions(np.stack([a, b, -1e3 * a], axis=1), np.eye(3), SPACE, INSIDE)
    assert found.blind
    assert found.indices == (0,)  # the third parameter needs a thousandth of the step only
    assert found.direction[0] != 0.0
    (found,) = unidentifiable_directions(np.stack([a, b, -a], axis=1), np.eye(3), SPACE, INSIDE)
    assert found.indices == (0, 2)
    assert found.direction[0] == pytest.approx(found.direction[1])


def test_unidentifiable_directions__column_of_zeros__is_blind():
    a, b = np.random.default_rng(2).standard_normal((2, 1500))
    (found,) = unidentifiable_directions(np.stack([a, 0.0 * a, b], axis=1), 1e-6 * np.eye(3), SPACE, INSIDE)
    assert (found.indices, found.direction, found.blind) == ((1,), (1.0,), True)


def test_unidentifiable_directions__large_variance__is_loose():
    J = np.linalg.qr(np.random.default_rng(2).standard_normal((1500, 3)))[0]
    (found,) = unidentifiable_directions(J, np.diag([1e-6, 4.0, 1e-6]), SPACE, INSIDE)
    assert (found.indices, found.blind) == ((1,), False)
