"""Residuals and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation import predict, scales
from brightgrey.estimation.optimisation.least_squares import evaluate, normal_equations
from brightgrey.estimation.problem import simulation_error
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many, systems
from brightgrey.kit import PAPER
from brightgrey.simulation import Settings, response
from support.recordings import make_recording

STRUCTURE = PAPER.parse("two_mass+coulomb+viscous+gravity")
VALUES = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "M_C": 0.9, "f_v": 0.015, "M_G": 0.2}
SETTINGS = Settings(f_tanh=2.5, speed_scale=40.0, level="accurate")
DT, SAMPLES = 1e-3, 500
UNITS = {"position": "rad", "acceleration": "rad/s²"}


def recording(*kinds, y=None):
    t = DT * np.arange(SAMPLES)
    u = 6.0 * np.sign(np.sin(2 * np.pi * 4 * t)) * np.minimum(1.0, t / 0.05)
    y = np.zeros((len(kinds), SAMPLES)) if y is None else y
    return make_recording(u, y, dt=DT, kind=kinds, names=("u", "y"))


def test_differenced_velocity__is_the_backward_difference_of_position():
    both = predict(STRUCTURE, VALUES, recording("position", "velocity-differenced"), SETTINGS)
    np.testing.assert_allclose(both[1, 1:], np.diff(both[0]) / DT, rtol=1e-9, atol=1e-9)
    assert both[1, 0] == 0.0  # at rest before the first sample


def test_differenced_velocity__lags_half_a_sample():
    r = recording("velocity", "velocity-differenced")
    y = predict(STRUCTURE, VALUES, r, SETTINGS)
    between = 0.5 * (y[0, 1:] + y[0, :-1])
    # Where acceleration changes by da within a sample, the trapezoid is off by dt da / 12. It does so where the
    # input steps and friction turns at once; the spring and damper change little in a sample.
    jump = (np.abs(np.diff(r.u)).max() + 2 * VALUES["M_C"]) / VALUES["J1"]
    assert np.abs(y[1, 1:] - between).max() < 1.1 * DT * jump / 12
    assert np.abs(y[1, 1:] - y[0, 1:]).max() > 3 * DT * jump / 12  # half a sample more is another matter


def test_differenced_velocity__rattling_load__derivatives_do_not_jump():
    """A difference of positions that is forgotten from one sample to the next is no speed."""
    structure = PAPER.parse("two_mass+viscous+backlash")
    names = {"J1": 4.5e-3, "J2": 1e-4, "c1": 1e4, "d1": 3e-3, "f_v": 2e-2, "alpha": 1e-3}
    values = {n: np.array([v, *(v * (1.0 + 1e-6 * (m == n)) for m in names)]) for n, v in names.items()}
    kinds = ("velocity", "velocity-differenced")
    made = recording(*kinds)
    made = replace(made, u=np.sin(2.0 * np.pi * 8.0 * DT * np.arange(SAMPLES)))
    system, u, x0 = systems(structure, values, made, SETTINGS)
    sample, who = response(system, u, DT, x0, SETTINGS, group=len(names) + 1).rejoined.T
    y = predict_many(structure, values, made, SETTINGS, group=len(names) + 1)
    velocity, differenced = np.abs(y[:, :, 1:] - y[:, :, :1])
    assert len(sample)
    assert not differenced[sample, who - 1].any()
    # Elsewhere it is the mean over the sample before, up to how much the velocity changes within.
    assert (differenced.max(axis=0) <= 2.0 * velocity.max(axis=0)).all()


def test_residuals__true_parameters__are_zero():
    kinds = ("position", "velocity", "velocity-differenced", "acceleration")
    y = predict(STRUCTURE, VALUES, recording(*kinds), SETTINGS)
    problem = SimulationErrorProblem.of(STRUCTURE, [recording(*kinds, y=y)])
    residuals = problem.residuals({n: np.array([v]) for n, v in VALUES.items()}, SETTINGS)
    assert np.abs(residuals).max() < 1e-6


def test_costs_and_products__simulated_in_portions__are_the_same_bits(monkeypatch):
    y = predict(STRUCTURE, VALUES, recording("velocity"), SETTINGS)
    problem = SimulationErrorProblem.of(STRUCTURE, [recording("velocity", y=y + 0.1)])
    space = parameter_space(STRUCTURE, scales(problem.recordings), {}, {})
    theta = space.to_scaled(np.array([VALUES[name] for name in space.names]))
    starts = theta + np.linspace(-0.05, 0.05, 40)[:, None]
    values = space.named(space.from_scaled(starts.T)) | {"M_G": np.array([VALUES["M_G"]])}  # one for all sets

    def made():
        normal = normal_equations(problem, space, SETTINGS, starts)
        return [problem.costs(values, SETTINGS), *normal]

    whole = made()
    small = replace(simulation_error.POLICY, most_numbers=1)
    monkeypatch.setattr(simulation_error, "POLICY", small)
    for a, b in zip(whole, made(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_evaluate__jacobian__equals_central_differences():
    y = predict(STRUCTURE, VALUES, recording("velocity"), SETTINGS)
    r = recording("velocity", y=y + 0.1)
    space = parameter_space(STRUCTURE, scales(r), {}, {})
    problem = SimulationErrorProblem.of(STRUCTURE, [r])
    theta = space.to_scaled(np.array([VALUES[name] for name in space.names]))
    _, J = evaluate(problem, space, SETTINGS, theta)
    for i, name in enumerate(space.names):
        errors = []
        # The plain central difference lets each side choose its own steps, and where they differ it carries
        # the level's error over the difference. That happens at one distance or the other, seldom at both.
        for step in (1e-4, 1e-3):
            ends = np.stack([theta, theta], axis=1)
            ends[i] += [step, -step]
            values = dict(zip(space.names, space.from_scaled(ends), strict=True))
            residuals = problem.residuals(values, SETTINGS)
            central = (residuals[:, 0] - residuals[:, 1]) / (2 * step)
            errors.append(np.linalg.norm(J[:, i] - central) / np.linalg.norm(central))
        assert min(errors) < 2e-3, (name, errors)  # issue A


def test_residuals__diverged_simulation__are_large_and_finite():
    r = recording("velocity", y=predict(STRUCTURE, VALUES, recording("velocity"), SETTINGS))
    problem = SimulationErrorProblem.of(STRUCTURE, [r])
    absurd = {"f_v": -1e4, "J1": 1e-9, "J2": 1e-9}  # friction that feeds energy
    sets = {n: np.array([v, absurd.get(n, v)]) for n, v in VALUES.items()}
    residuals = problem.residuals(sets, SETTINGS)
    assert np.all(np.isfinite(residuals))
    good, bad = np.square(residuals).sum(axis=0)
    assert good < 1e-6
    at_rest = float(np.sum((r.y * problem.weights[:, None]) ** 2))
    assert bad > at_rest  # worse than a model that never moves


def test_residuals__recordings_and_outputs__stacked_and_weighted():
    one, two = recording("position", "velocity"), recording("position", "velocity")
    y = predict(STRUCTURE, VALUES, one, SETTINGS)
    one, two = recording("position", "velocity", y=y), recording("position", "velocity", y=2 * y)
    problem = SimulationErrorProblem.of(STRUCTURE, [one, two])
    residuals = problem.residuals({n: np.array([v]) for n, v in VALUES.items()}, SETTINGS)[:, 0]
    assert residuals.shape == (problem.samples,) == (4 * SAMPLES,)
    np.testing.assert_allclose(residuals[: 2 * SAMPLES], 0.0, atol=1e-6)
    expected = (-y * problem.weights[:, None]).ravel()
    np.testing.assert_allclose(residuals[2 * SAMPLES :], expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("speed", [0.0, 12.0])
def test_predict__starts_from_the_first_samples(speed):
    r = recording("velocity")
    y = predict(STRUCTURE, VALUES, r, SETTINGS, initial={"q1": 0, "q2": 0, "v1": speed, "v2": speed})
    again = predict(STRUCTURE, VALUES, recording("velocity", y=y), SETTINGS)
    assert again[0, 0] == pytest.approx(speed, rel=0.1)


@pytest.mark.parametrize("kinds", [("velocity",), ("velocity-differenced",), ("position", "acceleration")])
def test_costs__upper_limit_reached__are_infinite(kinds):
    """Two recordings: a sum may reach its limit in the second one."""
    measured = np.random.default_rng(1).standard_normal((2, len(kinds), SAMPLES))
    problem = SimulationErrorProblem.of(STRUCTURE, [recording(*kinds, y=y) for y in measured])
    sets = {name: value * np.array([1.0, 1.1, 0.5, 2.0]) for name, value in VALUES.items()}
    whole = problem.costs(sets, SETTINGS)
    most = whole * np.array([1.001, 0.999, np.inf, 0.1])
    found = problem.costs(sets, SETTINGS, most)
    np.testing.assert_allclose(found[[0, 2]], whole[[0, 2]], rtol=1e-12)
    assert np.all(np.isinf(found[[1, 3]]))
