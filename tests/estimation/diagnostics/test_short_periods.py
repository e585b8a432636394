"""Loads whose period is shorter than the simulated position is off."""

import numpy as np
import pytest

from brightgrey.estimation.diagnostics.short_periods import short_period_findings
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import Structure
from support.recordings import make_recording

RIPPLE = Structure.parse("one_mass+viscous+pendulum")


@pytest.mark.parametrize(("off", "says"), [(0.02, False), (0.2, True)])
def test_short_period_findings__position_off_by_more_than_a_radian_of_the_load__says_both(off, says):
    t = 1e-3 * np.arange(2000)
    r = make_recording(np.sin(t), np.sin(3.0 * t), kind="position")
    problem = SimulationErrorProblem.of(RIPPLE, [r])
    residual = problem.weights[0] * np.full(t.size, off)
    values = {"J1": 1.0, "f_v": 0.1, "G": 0.5, "k": 10.0, "phi_0": 0.0}
    found = short_period_findings(problem, values, residual)
    assert bool(found) == says
    if says:
        assert found[0].parameters == ("G", "k", "phi_0")
        assert "repeats every 0.628 rad, and the simulated position is 0.2 rad off" in found[0].text


def test_short_period_findings__velocity__does_not_show_the_position():
    t = 1e-3 * np.arange(2000)
    problem = SimulationErrorProblem.of(RIPPLE, [make_recording(np.sin(t), np.sin(3.0 * t))])
    values = {"J1": 1.0, "f_v": 0.1, "G": 0.5, "k": 10.0, "phi_0": 0.0}
    assert short_period_findings(problem, values, problem.weights[0] * np.ones(t.size)) == []
