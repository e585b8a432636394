"""Pattern search as an estimator: the same optimum as least squares, slower; and the paper's names of things."""

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.estimation import fit
from brightgrey.estimation.optimisation.pattern_fit import cost_function
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.simulation import Settings, shared_cores
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TEXT = "one_mass+coulomb+viscous"
VALUES = {"J1": 0.02, "M_C": 0.9, "f_v": 0.02}
AROUND = {name: (0.5 * value, 2.0 * value) for name, value in VALUES.items()}


@pytest.fixture(scope="module")
def drawn():
    u, dt = PAPER_EXPERIMENT.torque(), PAPER_EXPERIMENT.dt
    y = reference(TEXT, VALUES, u, dt, f_tanh=2.5).reshape(-1)
    y = y + 1e-3 * np.abs(y).max() * np.random.default_rng(0).standard_normal(y.shape)
    return make_recording(u, y, dt=dt, names=("torque", "v"), name="drawn")


def test_fit__by_pattern_search__finds_the_optimum_of_least_squares(drawn):
    settings = {"bounds": AROUND, "f_tanh": 2.5, "starts": 2, "level": "fast"}
    squares = fit(PAPER.parse(TEXT), [drawn], **settings)
    patterns = fit(PAPER.parse(TEXT), [drawn], estimator="pattern-search", **settings)
    assert patterns.outcome.kind == "converged"
    assert patterns.cost == pytest.approx(squares.cost, rel=1e-4)
    for name, e in squares.estimates.items():
        assert patterns.estimates[name].value == pytest.approx(e.value, abs=0.2 * e.std)
        assert patterns.estimates[name].std == pytest.approx(e.std, rel=0.05)
    assert patterns.evaluations > 5 * squares.evaluations
    with shared_cores(2):
        assert fit(PAPER.parse(TEXT), [drawn], estimator="pattern-search", **settings) == patterns


def test_cost_function__points_and_limits__is_that_of_the_residuals(drawn):
    structure, settings = PAPER.parse(TEXT), Settings(2.5, 40.0, "fast")
    problem = SimulationErrorProblem.of(structure, [drawn, drawn])
    space = parameter_space(structure, scales([drawn]), AROUND, {"f_v": 0.02})
    starts = np.array([[0.01, 0.02, 0.03], [0.5, 0.9, 1.7]])
    cost = cost_function(problem, space, settings)
    found = cost(space.to_scaled(starts), np.full(3, np.inf))
    values = dict(zip(space.names, starts, strict=True)) | {"f_v": np.full(3, 0.02)}
    np.testing.assert_allclose(found, np.square(problem.residuals(values, settings)).sum(axis=0), rtol=1e-10)
    upper_limits = np.array([1.5 * found[0], found[1], 0.7 * found[2]])  # reached in the second recording
    aborted = cost(space.to_scaled(starts), upper_limits)
    assert aborted.tolist() == [found[0], np.inf, np.inf]


def test_fit__unknown_estimator__is_refused(drawn):
    with pytest.raises(SettingsError, match="Did you mean 'pattern-search'"):
        fit(PAPER.parse(TEXT), [drawn], estimator="patternsearch")
