"""Compiled kernel against its plain twin: the same scheme, written twice."""

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.plants import random_values
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.plain import plain_response

OUTPUTS = ("position", "velocity", "acceleration")
STRUCTURES = (
    "one_mass",
    "two_mass+coulomb+viscous+stribeck",
    "one_mass+coulomb+gravity+delay",
    "three_mass+stribeck+current_control+delay",
    "two_mass+backlash",
    "four_mass+coulomb+viscous+backlash+current_control+delay",
)


@pytest.mark.parametrize("hold", ["linear", "zoh"])
@pytest.mark.parametrize("level", ["accurate", "fast"])
@pytest.mark.parametrize("name", STRUCTURES)
def test_compiled_equals_plain(name: str, level: str, hold: str) -> None:
    structure = PAPER.parse(name)
    experiment = PAPER_EXPERIMENT
    u = experiment.torque()[150:450]
    values = random_values(structure.parameters, np.random.default_rng(7))
    system = assemble(structure, values, experiment.f_tanh, OUTPUTS)
    settings = Settings(experiment.f_tanh, experiment.speed, level, hold)  # type: ignore[arg-type]
    x0 = system.rest(u=u[0])
    fast = response(system, u, experiment.dt, x0, settings).y[:, :, 0]
    plain = plain_response(system, u, experiment.dt, x0, settings)
    # Same steps, other exponentials and root finders: what remains is rounding, carried on by stiff friction.
    scale = np.abs(plain).max(axis=1)
    assert np.all(np.abs(fast - plain).max(axis=1) <= 1e-8 * scale)
