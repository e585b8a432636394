"""Starts with other resonances: at peaks of the residual, in another order, or in a chain that has grown."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.least_squares import fit_many
from brightgrey.estimation.optimisation.multistart import multistart
from brightgrey.estimation.optimisation.resonances import grown_starts, resonance_scan, starts_at_residual_peaks
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import PAPER, assemble
from brightgrey.recordings import read_recording
from brightgrey.simulation import Settings


@pytest.fixture(scope="module")
def demo():
    path = files("brightgrey.excitation").joinpath("data/demo.csv")
    return read_recording(str(path), input="torque", outputs=["velocity:velocity"], time="t")


def test_starts_at_residual_peaks__have_the_resonance_of_the_residual(demo):
    structure = PAPER.parse("two_mass")
    space, omega = parameter_space(structure, scales(demo), {}, {}), 2 * np.pi * 20.0
    settings = Settings(f_tanh=2.5, speed_scale=40.0, level="fast")
    values = np.array([0.008, 0.012, 250.0, 0.1])
    problem = SimulationErrorProblem.of(structure, [demo])
    simulated = problem.residuals(space.named(values[:, None]), settings)[:, 0] / problem.weights[0] + demo.y[0]
    disturbed = replace(demo, y=(simulated + np.sin(omega * demo.t))[None])
    problem = SimulationErrorProblem.of(structure, [disturbed])
    found = starts_at_residual_peaks(problem, space, settings, values, 200, np.random.default_rng(3))
    np.testing.assert_allclose(found[:2].sum(axis=0), values[:2].sum(), rtol=1e-9)
    resonances = [
        np.abs(np.linalg.eigvals(assemble(structure, dict(zip(space.names, v, strict=True)), 2.5).A)).max()
        for v in found.T
    ]
    resolution = 2 * np.pi / (demo.samples * demo.dt)
    assert np.mean(np.abs(np.array(resonances) - omega) < 2 * resolution) >= 0.95
    assert len(np.unique(found[0])) == 200


def test_resonance_scan__undamped_resonance__is_found_from_a_stiff_model(demo):
    structure = PAPER.parse("two_mass+viscous")
    space, settings = (
        parameter_space(structure, scales(demo), {}, {}),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    problem = SimulationErrorProblem.of(structure, [demo])
    true, stiff = np.array([0.019, 0.0009, 25.0, 1e-5, 0.01]), np.array([0.01, 0.0099, 2e5, 5.0, 0.01])
    made = problem.residuals(space.named(true[:, None]), settings)[:, 0] / problem.weights[0] + demo.y[0]
    disturbed = replace(demo, y=(made + 0.05 * np.random.default_rng(4).standard_normal(demo.samples))[None])
    problem = SimulationErrorProblem.of(structure, [disturbed])
    found, _ = resonance_scan(problem, space, settings, stiff, 24)
    assert found.shape[0] == 5
    assert 0 < found.shape[1] <= 24
    assert np.all((found >= space.low[:, None]) & (found <= space.high[:, None]))
    np.testing.assert_allclose(found[:2].sum(axis=0), stiff[:2].sum(), rtol=1e-9)
    wanted = np.sqrt(true[2] * (1 / true[0] + 1 / true[1]))
    resonances = np.sqrt(found[2, 0] * (1 / found[0, 0] + 1 / found[1, 0]))
    assert abs(resonances - wanted) < np.pi / (demo.samples * demo.dt)  # half a line
    end = fit_many(problem, space, settings, found[:, :1], limit=40)[0]
    assert end.cost <= 1.001 * problem.costs(space.named(true[:, None]), settings)[0]
    lone = fit_many(problem, space, settings, stiff[:, None], limit=40)[0]
    assert lone.cost > 1.5 * end.cost


def test_resonance_starts__no_parts_to_exchange__are_empty(demo):
    structure = PAPER.parse("one_mass+viscous")
    space = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    assert starts_at_residual_peaks(problem, space, settings, space.start, 10, np.random.default_rng(0)).shape == (
        2,
        0,
    )
    assert resonance_scan(problem, space, settings, space.start, 10)[0].shape == (2, 0)


@pytest.fixture(scope="module")
def light_mass(demo):
    """Recording of three masses, the last one light, its values, and the best fit of two masses."""
    settings = Settings(f_tanh=2.5, speed_scale=40.0, level="fast")
    true = {"J1": 0.008, "J2": 0.009, "J3": 0.0015, "c1": 60.0, "c2": 12.0, "d1": 0.02, "d2": 0.004, "f_v": 0.01}
    structure = PAPER.parse("three_mass+viscous")
    problem = SimulationErrorProblem.of(structure, [demo])
    space = parameter_space(structure, scales(demo), {}, {})
    made = problem.residuals(space.named(np.array([[true[n]] for n in space.names])), settings)[:, 0]
    y = made / problem.weights[0] + demo.y[0] + 0.02 * np.random.default_rng(4).standard_normal(demo.samples)
    recording = replace(demo, y=y[None])
    smaller = PAPER.parse("two_mass+viscous")
    coarse, few = SimulationErrorProblem.of(smaller, [recording]), parameter_space(smaller, scales(recording), {}, {})
    ends = multistart(coarse, few, settings, [true], starts=8, patience=2, seed=1).optima
    best = min(ends, key=lambda end: end.cost)
    return recording, settings, true, dict(zip(few.names, best.values.tolist(), strict=True)), best.cost


def test_grown_starts__chain_of_two__all_inertia_kept_and_most_no_better_before_they_descend(light_mass):
    recording, settings, _, smaller, cost = light_mass
    structure = PAPER.parse("three_mass+viscous")
    problem = SimulationErrorProblem.of(structure, [recording])
    space = parameter_space(structure, scales(recording), {}, {})
    starts, sets = grown_starts(problem, space, settings, smaller, 24)
    assert starts.shape == (len(space.names), 24)
    np.testing.assert_allclose(starts[:3].sum(axis=0), smaller["J1"] + smaller["J2"], rtol=1e-9)
    np.testing.assert_array_equal(starts[space.names.index("f_v")], smaller["f_v"])
    costs = problem.costs(space.named(starts), settings)
    assert np.all(np.diff(costs) >= 0.0)
    assert np.mean(costs < cost) < 0.5
    assert sets > 24


def test_multistart__grown_from_a_chain_of_two__finds_the_light_mass(light_mass):
    recording, settings, true, smaller, cost = light_mass
    structure = PAPER.parse("three_mass+viscous")
    problem = SimulationErrorProblem.of(structure, [recording])
    space = parameter_space(structure, scales(recording), {}, {})
    exact = problem.costs(space.named(np.array([[true[n]] for n in space.names])), settings)[0]
    assert cost > 1.2 * exact
    found = multistart(problem, space, settings, [], starts=2, patience=0, seed=1, smaller=smaller)
    best = min(found.optima, key=lambda end: end.cost)
    assert best.cost <= 1.01 * exact
    np.testing.assert_allclose(best.values[:3], [true[f"J{i}"] for i in (1, 2, 3)], rtol=0.1)


def test_grown_starts__one_mass__are_empty(demo):
    structure = PAPER.parse("one_mass+viscous")
    space = parameter_space(structure, scales(demo), {}, {})
    problem, settings = SimulationErrorProblem.of(structure, [demo]), Settings(2.5, 40.0, "fast")
    assert grown_starts(problem, space, settings, {"J1": 0.02, "f_v": 0.01}, 8)[0].shape == (2, 0)
