"""Optima from which descents go on: the best ones, but none twice."""

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.choice_of_optima import best_different, finalists
from brightgrey.estimation.optimisation.least_squares import Optimum
from brightgrey.estimation.optimisation.options import FitOptions
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.kit import Structure
from support.recordings import make_recording


@pytest.fixture(scope="module")
def space():
    u = np.sin(0.1 * np.arange(200))
    return parameter_space(Structure.parse("one_mass"), scales(make_recording(u, np.cumsum(u))), {}, {}, ())


def optimum(space, cost, share):
    """Optimum at a share of the range of the inertia."""
    low, high = space.box
    return Optimum(space.from_scaled(low + share * (high - low)), cost, True, 1, 1, np.zeros((1, 1)))


@pytest.mark.parametrize(
    ("ends", "kept"),
    [
        ([(1.06, 0.5), (1.0, 0.2), (1.08, 0.8), (1.2, 0.3)], [1.0, 1.06, 1.08]),  # the best ones first
        ([(1.0, 0.2), (1.0001, 0.2), (1.05, 0.2)], [1.0, 1.05]),  # the second is the first one again
        ([(1.0, 0.2), (1.0001, 0.9)], [1.0, 1.0001]),  # as good, elsewhere
        ([(np.inf, 0.2), (np.inf, 0.2)], [np.inf]),
    ],
)
def test_best_different__ends_of_descents__none_twice(space, ends, kept):
    optima = [(optimum(space, cost, share), np.ones(1)) for cost, share in ends]
    assert [o.cost for o, _ in best_different(space, optima, FitOptions())] == kept


def test_best_different__many__as_many_as_go_on(space):
    optima = [(optimum(space, 1.0 + 0.0055 * k, 0.5), np.ones(1)) for k in range(10)]
    assert len(best_different(space, optima, FitOptions(continued=5))) == 5


def test_finalists__as_good_and_elsewhere__are_fitted_again(space):
    optima = [optimum(space, *end) for end in [(1.0, 0.2), (1.001, 0.2), (1.002, 0.9), (2.0, 0.5)]]
    assert [o.cost for o in finalists(space, optima, FitOptions())] == [1.0, 1.002]
