"""Descents side by side, against the plain ones."""

from importlib.resources import files

import numpy as np
import pytest
from scipy.optimize import least_squares

from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.least_squares import evaluate, fit_many, fit_to_convergence, normal_equations
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import PAPER
from brightgrey.recordings import read_recording
from brightgrey.simulation import Settings

EVERYTHING = "four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"


@pytest.fixture(scope="module")
def demo():
    path = files("brightgrey.excitation").joinpath("data/demo.csv")
    return read_recording(str(path), input="torque", outputs=["velocity:velocity"], time="t", window=(0.0, 0.4))


def task(text, recording, bounds=None, fixed=None):
    structure = PAPER.parse(text)
    known = scales(recording)
    search = parameter_space(structure, known, bounds or {}, fixed or {})
    settings = Settings(f_tanh=2.5, speed_scale=known.speed, level="fast")
    return SimulationErrorProblem.of(structure, [recording]), search, settings


@pytest.mark.parametrize("text", ["one_mass", "one_mass+coulomb+viscous", "two_mass+delay+gravity", EVERYTHING])
def test_normal_equations_are_those_of_residual_and_jacobian(demo, text):
    problem, search, settings = task(text, demo)
    begins = search.to_scaled(np.column_stack([search.start, search.sample(2, np.random.default_rng(1))])).T
    found = normal_equations(problem, search, settings, begins)
    for k, theta in enumerate(begins):
        r, J = evaluate(problem, search, settings, theta)
        np.testing.assert_allclose(found.cost[k], r @ r, rtol=1e-9)
        np.testing.assert_allclose(found.gradient[k], J.T @ r, atol=1e-9 * np.abs(J.T @ r).max())
        np.testing.assert_allclose(found.curvature[k], J.T @ J, atol=1e-9 * np.abs(J.T @ J).max())


def test_a_descent_ends_where_scipy_ends(demo):
    problem, search, settings = task("one_mass+coulomb+viscous", demo)
    low, high = search.to_scaled(search.low), search.to_scaled(search.high)

    def part(i):
        return lambda theta: evaluate(problem, search, settings, theta)[i]

    plain = least_squares(part(0), search.to_scaled(search.start), part(1), bounds=(low, high), x_scale="jac")
    found = fit_to_convergence(problem, search, settings, search.start)
    assert found.converged
    assert found.cost <= 2.0 * plain.cost * (1 + 1e-6)
    np.testing.assert_allclose(search.to_scaled(found.values), plain.x, atol=1e-3)


def test_a_start_does_not_depend_on_its_neighbours_unless_they_compete(demo):
    problem, search, settings = task("two_mass+coulomb+viscous", demo)
    begins = search.sample(4, np.random.default_rng(3))
    together = fit_many(problem, search, settings, begins, limit=6)
    for k, end in enumerate(together):
        (alone,) = fit_many(problem, search, settings, begins[:, [k]], limit=6)
        np.testing.assert_array_equal(alone.values, end.values)
        assert alone.cost == end.cost


def test_parameters_stay_in_the_box_and_stop_at_its_walls(demo):
    problem, search, settings = task("one_mass+coulomb", demo, bounds={"J1": (0.05, 0.06)})
    ends = fit_many(problem, search, settings, search.sample(4, np.random.default_rng(0)))
    for end in ends:
        assert np.all((end.values >= search.low) & (end.values <= search.high))
    assert min(ends, key=lambda e: e.cost).values[0] == pytest.approx(0.05)  # the drive has 0.02


def test_competing_starts_that_meet_are_ended_but_the_best_is_not(demo):
    problem, search, settings = task("one_mass+viscous", demo)
    begins = search.sample(8, np.random.default_rng(2))
    alone = fit_many(problem, search, settings, begins)
    compete = fit_many(problem, search, settings, begins, cost_to_beat=np.inf)
    assert min(e.cost for e in compete) == pytest.approx(min(e.cost for e in alone), rel=1e-3)
    assert sum(e.evaluations for e in compete) <= sum(e.evaluations for e in alone)


def test_nothing_to_search_is_a_descent_too(demo):
    problem, search, settings = task("one_mass+viscous", demo, fixed={"J1": 0.02, "f_v": 0.02})
    found = fit_to_convergence(problem, search, settings, np.zeros(0))
    assert found.converged
    assert found.jacobian.shape == (demo.samples, 0)


def test_contentment_is_asked_only_where_enough_starts_have_come_to_the_same_cost(demo):
    problem, search, settings = task("one_mass+coulomb+viscous", demo)
    begins = search.sample(4, np.random.default_rng(3))
    asked = []

    def content(residual):
        asked.append(float(residual @ residual))
        return True

    ends = fit_many(problem, search, settings, begins, stop_when=content, min_agreeing=2)
    least = min(end.cost for end in ends)
    assert asked == pytest.approx([least])  # once: all others were ended
    assert sum(end.cost <= 1.005 * least for end in ends) >= 2
    asked.clear()
    fit_many(problem, search, settings, begins, stop_when=content, min_agreeing=5)
    assert asked == []
