"""A population that follows growing parts of a recording."""

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.growing_parts import follow_growing_parts, growing_horizons, growing_parts
from brightgrey.estimation.optimisation.least_squares import fit_many
from brightgrey.estimation.optimisation.options import MULTISTART_DEFAULTS
from brightgrey.estimation.optimisation.start_points import best_diverse
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording, Signal
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference

STRUCTURE = "two_mass+viscous+backlash"
TRUTH = {"J1": 0.01, "J2": 0.02, "c1": 400.0, "d1": 0.1, "f_v": 0.05, "alpha": 0.3}


@pytest.fixture(scope="module")
def gap():
    """Problem, space and settings: a wide gap that is crossed when the torque first reverses."""
    u = np.round(PAPER_EXPERIMENT.torque(), 3)
    y = reference(STRUCTURE, TRUTH, u, PAPER_EXPERIMENT.dt, f_tanh=100.0)[:1]
    y = y + 1e-3 * np.random.default_rng(4).standard_normal(y.shape) * y.std()
    t = PAPER_EXPERIMENT.dt * np.arange(u.size)
    outputs = (Signal("velocity", "velocity", "rad/s", mass=1),)
    recording = Recording("gap", t, u, y, Signal("torque", "input", "N m"), outputs, hold="linear")
    structure = PAPER.parse(STRUCTURE)
    problem = SimulationErrorProblem.of(structure, [recording])
    return problem, parameter_space(structure, scales(recording), {}, {}), Settings(f_tanh=100.0, speed_scale=1.0)


def test_growing_parts__each_longer_than_the_last__none_the_whole(gap):
    problem, _, _ = gap
    lengths = [part.samples for part in growing_parts(problem, growing_horizons(0.05))]
    assert lengths == sorted(set(lengths))
    assert lengths[-1] < problem.samples


@pytest.fixture(scope="module")
def population(gap):
    problem, space, settings = gap
    parts = growing_parts(problem, growing_horizons(0.05))
    rng = np.random.default_rng(1)
    starts = np.stack(best_diverse(parts[0], space, settings, space.sample(256, rng), 24), axis=1)
    return parts, starts, follow_growing_parts(parts, space, settings, starts, rng)


def test_population__finds_a_gap_that_the_first_part_does_not_show(gap, population):
    problem, space, settings = gap
    _, _, (followed, simulations) = population
    best = fit_many(problem, space, settings, np.stack(followed, axis=1))
    values = dict(zip(space.names, min(best, key=lambda o: o.cost).values.tolist(), strict=True))
    assert values["alpha"] == pytest.approx(TRUTH["alpha"], rel=0.02)
    assert values["J2"] == pytest.approx(TRUTH["J2"], rel=0.02)
    assert simulations.sets > 0


def test_population__best_first__within_bounds__different(gap, population):
    _, space, settings = gap
    parts, _, (followed, _) = population
    cost = parts[-1].costs(space.named(np.stack(followed, axis=1)), settings)
    assert 1 <= len(followed) <= MULTISTART_DEFAULTS.population.ends
    np.testing.assert_array_equal(cost, np.sort(cost))
    assert all(np.array_equal(space.clip(values), values) for values in followed)
    assert len({values.tobytes() for values in followed}) == len(followed)


def test_population__same_draws__same_fits(gap, population):
    _, space, settings = gap
    parts, starts, _ = population
    found = [follow_growing_parts(parts[:6], space, settings, starts, np.random.default_rng(3))[0] for _ in range(2)]
    np.testing.assert_array_equal(*[np.stack(values) for values in found])
