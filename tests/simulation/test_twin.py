"""Compiled kernel against its plain twin: the same scheme, written twice."""

import numpy as np
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.plants import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.plain import plain_response

OUTPUTS = ("position", "velocity", "acceleration")
ALL = list(PAPER.structures())
HOLDS, LEVELS = ("linear", "zoh"), ("accurate", "fast")


@settings(max_examples=40, deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate))
@given(
    structure=st.sampled_from(ALL),
    seed=st.integers(0, 2**32 - 1),
    level=st.sampled_from(LEVELS),
    hold=st.sampled_from(HOLDS),
)
@example(PAPER.parse("four_mass+coulomb+viscous+backlash+current_control+delay"), 7, "accurate", "zoh")
@example(PAPER.parse("three_mass+stribeck+current_control+delay"), 7, "fast", "linear")
def test_compiled_equals_plain(structure: Structure, seed: int, level: str, hold: str) -> None:
    experiment = PAPER_EXPERIMENT
    u = experiment.torque()[150:450]
    values = random_values(structure.parameters, np.random.default_rng(seed))
    system = assemble(structure, values, experiment.f_tanh, OUTPUTS)
    how = Settings(experiment.f_tanh, experiment.speed, level, hold)  # type: ignore[arg-type]
    x0 = system.rest(u=u[0])
    fast = response(system, u, experiment.dt, x0, how).y[:, :, 0]
    plain = plain_response(system, u, experiment.dt, x0, how)
    # Same steps, other exponentials and root finders: what remains is rounding, carried on by stiff friction.
    # Acceleration jumps at contacts, whose times carry that rounding: it is judged by its root mean square.
    for row, size in enumerate((np.max, np.max, lambda x: np.sqrt(np.mean(x**2)))):
        assert size(np.abs(fast[row] - plain[row])) <= 1e-8 * size(np.abs(plain[row])), OUTPUTS[row]
