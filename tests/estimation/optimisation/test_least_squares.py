"""Fits from many starts at once, compared with single ones and with scipy."""

from importlib.resources import files

import numpy as np
import pytest
from scipy.optimize import least_squares

from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.least_squares import evaluate, fit_many, fit_to_convergence, normal_equations
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, function_set
from brightgrey.recordings import read_recording
from brightgrey.simulation import Settings
from support.searches import simulated_task

EVERYTHING = "four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"


@pytest.fixture(scope="module")
def demo():
    path = files("brightgrey.excitation").joinpath("data/demo.csv")
    return read_recording(str(path), input="torque", outputs=["velocity:velocity"], time="t", window=(0.0, 0.4))


def task(text, recording, bounds=None, fixed=None):
    structure = PAPER.parse(text)
    known = scales(recording)
    space = parameter_space(structure, known, bounds or {}, fixed or {})
    settings = Settings(f_tanh=2.5, speed_scale=known.speed, level="fast")
    return SimulationErrorProblem.of(structure, [recording]), space, settings


@pytest.mark.parametrize("text", ["one_mass", "one_mass+coulomb+viscous", "two_mass+delay+gravity", EVERYTHING])
def test_normal_equations__are_those_of_residual_and_jacobian(demo, text):
    problem, space, settings = task(text, demo)
    starts = space.to_scaled(np.column_stack([space.start, space.sample(2, np.random.default_rng(1))])).T
    found = normal_equations(problem, space, settings, starts)
    for k, theta in enumerate(starts):
        r, J = evaluate(problem, space, settings, theta)
        np.testing.assert_allclose(found.cost[k], r @ r, rtol=1e-9)
        np.testing.assert_allclose(found.gradient[k], J.T @ r, atol=1e-9 * np.abs(J.T @ r).max())
        np.testing.assert_allclose(found.curvature[k], J.T @ J, atol=1e-9 * np.abs(J.T @ J).max())


def test_fit_to_convergence__ends_at_the_optimum_of_scipy(demo):
    problem, space, settings = task("one_mass+coulomb+viscous", demo)
    low, high = space.to_scaled(space.low), space.to_scaled(space.high)

    def part(i):
        return lambda theta: evaluate(problem, space, settings, theta)[i]

    plain = least_squares(part(0), space.to_scaled(space.start), part(1), bounds=(low, high), x_scale="jac")
    found = fit_to_convergence(problem, space, settings, space.start)
    assert found.converged
    assert found.cost <= 2.0 * plain.cost * (1 + 1e-6)
    np.testing.assert_allclose(space.to_scaled(found.values), plain.x, atol=1e-3)


def test_fit_many__angle_begins_at_its_bound__is_found_beyond():
    """An angle has no bounds: from 2 pi on it goes on at 0."""
    structure = function_set().parse("one_mass+viscous+pendulum")
    values = {"J1": 0.02, "f_v": 0.03, "G": 0.5, "k": 1.0, "phi_0": 1.0}
    task = simulated_task(str(structure), values, PAPER_EXPERIMENT.torque()[:600], 1e-3, dt=1e-3, f_tanh=200.0)
    problem, space = task.problem_and_space(structure)
    starts = np.array([[values[name] for name in space.names]] * 2).T
    starts[space.names.index("phi_0")] = (2.0 * np.pi, -2.0 * np.pi)
    for end in fit_many(problem, space, task.settings, starts):
        assert end.values[space.names.index("phi_0")] == pytest.approx(1.0, abs=0.01)


def test_fit_many__without_competition__starts_are_independent(demo):
    problem, space, settings = task("two_mass+coulomb+viscous", demo)
    starts = space.sample(4, np.random.default_rng(3))
    together = fit_many(problem, space, settings, starts, limit=6)
    for k, end in enumerate(together):
        (alone,) = fit_many(problem, space, settings, starts[:, [k]], limit=6)
        np.testing.assert_array_equal(alone.values, end.values)
        assert alone.cost == end.cost


def test_fit_many__optimum_outside__stops_at_the_bounds(demo):
    problem, space, settings = task("one_mass+coulomb", demo, bounds={"J1": (0.05, 0.06)})
    ends = fit_many(problem, space, settings, space.sample(4, np.random.default_rng(0)))
    for end in ends:
        assert np.all((end.values >= space.low) & (end.values <= space.high))
    assert min(ends, key=lambda e: e.cost).values[0] == pytest.approx(0.05)  # the drive has 0.02


def test_fit_many__competing_starts__keep_the_best(demo):
    problem, space, settings = task("one_mass+viscous", demo)
    starts = space.sample(8, np.random.default_rng(2))
    alone = fit_many(problem, space, settings, starts)
    compete = fit_many(problem, space, settings, starts, cost_to_beat=np.inf)
    assert min(e.cost for e in compete) == pytest.approx(min(e.cost for e in alone), rel=1e-3)
    assert sum(e.evaluations for e in compete) <= sum(e.evaluations for e in alone)


def test_fit_to_convergence__all_fixed__converges(demo):
    problem, space, settings = task("one_mass+viscous", demo, fixed={"J1": 0.02, "f_v": 0.02})
    found = fit_to_convergence(problem, space, settings, np.zeros(0))
    assert found.converged
    assert found.jacobian.shape == (demo.samples, 0)


def test_stop_when__is_asked_only_if_enough_starts_agree(demo):
    problem, space, settings = task("one_mass+coulomb+viscous", demo)
    starts = space.sample(4, np.random.default_rng(3))
    asked = []

    def is_good(residual):
        asked.append(float(residual @ residual))
        return True

    ends = fit_many(problem, space, settings, starts, stop_when=is_good, min_agreeing=2)
    least = min(end.cost for end in ends)
    assert asked == pytest.approx([least])  # once: all others were ended
    assert sum(end.cost <= 1.005 * least for end in ends) >= 2
    asked.clear()
    fit_many(problem, space, settings, starts, stop_when=is_good, min_agreeing=5)
    assert asked == []
