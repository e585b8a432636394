"""Trees without recordings: parameters drawn from (0, 1), and an estimator that knows the answer at once."""

import numpy as np
import pytest

from brightgrey.kit import PAPER
from brightgrey.search import Evaluated, Misfit
from brightgrey.search.genetic.rules import Rules

TRUTH = "two_mass+coulomb+viscous+stribeck"


def draw_unit(placed, rng):
    return tuple((q.symbol, float(rng.random())) for q in placed.effect.parameters)


def distance(structure):
    """How far a structure is from the truth: effects and masses that differ."""
    truth = PAPER.parse(TRUTH)
    apart = {p for p in structure.placed if not p.effect.masses} ^ {p for p in truth.placed if not p.effect.masses}
    return len(apart) + abs(structure.masses - truth.masses)


def know(structure, starts):
    """RSS by distance; the estimate is the start, halved, so that starts change from generation to generation."""
    rss = 1.0 + distance(structure)
    return [
        Evaluated(tuple((n, 0.5 * v) for n, v in start), Misfit((rss,), (1e-3,), 100, (100.0,)), len(start), 10)
        for start in starts
    ]


@pytest.fixture(scope="session")
def rules():
    return Rules(PAPER)


@pytest.fixture(scope="session")
def draw():
    return draw_unit


@pytest.fixture(scope="session")
def estimate():
    return know


@pytest.fixture
def rng():
    return np.random.default_rng(7)
