"""Sums of squares against those of the response, with and without limits."""

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response, squares

SETS = 21  # a full row of lanes and an incomplete one
OUTPUTS = ("position", "velocity", "acceleration")


@pytest.fixture(
    scope="module",
    params=[
        "one_mass+coulomb+viscous",
        "two_mass+coulomb+viscous+stribeck+backlash",
        "three_mass+viscous+gravity+backlash+current_control+delay",
    ],
)
def case(request):
    e, rng = PAPER_EXPERIMENT, np.random.default_rng(11)
    structure, u = PAPER.parse(request.param), e.torque()[150:550]
    drawn = [random_values(structure.parameters, rng) for _ in range(SETS)]
    system = assemble(structure, {n: np.array([d[n] for d in drawn]) for n in structure.parameters}, e.f_tanh, OUTPUTS)
    x0 = np.zeros((len(system.states), SETS))
    how = Settings(e.f_tanh, e.speed, "fast")
    y = response(system, u, e.dt, x0, how).y
    target, weights = 0.9 * y[:, :, 0], np.array([1.0, 0.5, 1e-4])
    course = np.einsum("o,osk->sk", weights, np.square(y - target[:, :, None])).cumsum(axis=0)
    return (system, u, e.dt, x0, how, target, weights), course


def test_squares__no_limit__sums_of_the_response(case):
    arguments, course = case
    found = squares(*arguments, sums=np.zeros(SETS), upper_limits=np.full(SETS, np.inf))
    np.testing.assert_allclose(found, np.where(np.isfinite(course[-1]), course[-1], np.inf), rtol=1e-12)
    further = squares(*arguments, sums=np.full(SETS, 7.0), upper_limits=np.full(SETS, np.inf))
    np.testing.assert_allclose(further, found + 7.0, rtol=1e-12)


def test_squares__sum_below_its_limit__does_not_depend_on_it(case):
    arguments, _ = case
    found = squares(*arguments, sums=np.zeros(SETS), upper_limits=np.full(SETS, np.inf))
    most = np.random.default_rng(2).uniform(0.2, 3.0, SETS) * found
    limited = squares(*arguments, sums=np.zeros(SETS), upper_limits=most)
    np.testing.assert_array_equal(limited, np.where(found < most, found, np.inf))
    assert np.isinf(
        squares(*arguments, sums=np.zeros(SETS), upper_limits=found)
    ).all()  # a limit that is reached counts
    assert np.isinf(squares(*arguments, sums=np.zeros(SETS), upper_limits=np.full(SETS, -np.inf))).all()
