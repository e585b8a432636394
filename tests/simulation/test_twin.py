"""Compiled kernel against its plain twin: the same scheme, written twice."""

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.plain import plain_response

OUTPUTS = ("position", "velocity", "acceleration")
ALL = list(PAPER.structures())
TORQUE = PAPER_EXPERIMENT.torque()
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
def test_kernel__any_structure__equals_plain(structure: Structure, seed: int, level: str, hold: str) -> None:
    values = random_values(structure.parameters, np.random.default_rng(seed))
    same(structure, values, TORQUE[150:450:5], level, hold)  # forth, on by itself, and back


# A rigid coupling with hardly any damping, as fits with one mass too many end at. While the gap is open, its damper
# relaxes within d/c = 1 ns and 3 ns.
RIGID = {"J1": 0.0165, "J2": 0.00704, "J3": 0.000972, "c1": 123e3, "c2": 0.156, "d2": 0.0398}
RIGID |= {"alpha": 0.7, "M_C": 0.288}


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("damping", [1.23e-4, 4e-4])
def test_kernel__damper_relaxes_in_nanoseconds__equals_plain(level: str, damping: float) -> None:
    same(PAPER.parse("three_mass+coulomb+backlash"), RIGID | {"d1": damping}, -TORQUE[150:350], level, "linear")


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("T_d", [0.37e-3, 1.0e-3 / 3.0, 2.0e-3 - 1e-12])
def test_kernel__dead_time_and_rattling_gap__equals_plain(level: str, hold: str, T_d: float) -> None:
    """Searches start from such gaps: knots fall anywhere in a step, and every sample has contacts."""
    structure = PAPER.parse("three_mass+coulomb+viscous+gravity+backlash+current_control+delay")
    values = RIGID | {"c1": 3e3, "d1": 1.5e-6, "c2": 40.0, "alpha": 1.4e-5, "f_v": 0.01, "M_G": 0.05}
    u = 3.0 * np.sin(0.7 * np.arange(16.0))
    same(structure, values | {"T_1": 2e-4, "T_d": T_d}, u, level, hold)


@pytest.mark.parametrize(("level", "ticks"), [("accurate", 128), ("fast", 32)])
@pytest.mark.parametrize("times", [9.0, 20.0, 40.0])
def test_kernel__gap_not_at_its_quasi_steady_course__equals_plain(level: str, ticks: int, times: float) -> None:
    """The position in the gap relaxes to its quasi-steady course, `times` constants per tick, and meets a limit."""
    structure, rng = PAPER.parse("two_mass+backlash"), np.random.default_rng(5)
    for _ in range(10):
        c, alpha = 10.0 ** rng.uniform(1.0, 3.0), 10.0 ** rng.uniform(-4.0, -2.0)
        d = c * PAPER_EXPERIMENT.dt / (ticks * times)
        values = {"J1": 0.01, "J2": 0.004, "c1": c, "d1": d, "alpha": alpha}
        gap = -2.0 * alpha * rng.random()
        x0 = np.array([gap + 2.0 * alpha * rng.normal(), 0.0, rng.normal(), 0.0, gap])
        same(structure, values, np.full(4, 0.3), level, "linear", x0)


@pytest.mark.parametrize("level", LEVELS)
def test_kernel__far_from_the_origin__same_motion(level: str) -> None:
    """After 16 turns the rounding of positions is 1e-12 of the gap."""
    names, u = ("velocity",), -TORQUE[150:350]
    structure, values = PAPER.parse("three_mass+coulomb+backlash"), RIGID | {"d1": 1.23e-4, "alpha": 1e-4}
    system = assemble(structure, values, PAPER_EXPERIMENT.f_tanh, names)
    how = Settings(PAPER_EXPERIMENT.f_tanh, PAPER_EXPERIMENT.speed, level)  # type: ignore[arg-type]
    here = system.rest(u=u[0])
    there = here + 100.0 * np.array([name.startswith("q") for name in system.state_names])
    near, far = (response(system, u, PAPER_EXPERIMENT.dt, x0, how).y[0, :, 0] for x0 in (here, there))
    # Rounding of 100 rad is 1.4e-14 rad, c/d of it 1.4e-5 rad/s, and ten samples have a contact each at most.
    np.testing.assert_allclose(far[:10], near[:10], atol=1.4e-4)
    assert np.isfinite(far).all()


@pytest.mark.parametrize("level", LEVELS)
def test_kernel__gap_opens_at_rest_before_three_masses__equals_plain(level: str) -> None:
    """The first eight derivatives of the last mass's position are zero then."""
    values = {"J1": 0.00066, "J2": 0.00045, "J3": 0.0025, "J4": 0.019, "c1": 3050.0, "c2": 4.84, "c3": 23.0}
    values |= {"d1": 1.2e-4, "d2": 0.0063, "d3": 0.12, "M_C": 1.15, "alpha": 0.003, "T_1": 0.0037}
    same(PAPER.parse("four_mass+coulomb+backlash+current_control"), values, -0.1 * np.arange(20.0), level, "linear")


@pytest.mark.parametrize("speed", [50.0, 61.9, 75.0])
def test_kernel__drive_rests_at_the_end_of_its_gap__equals_plain(speed: float) -> None:
    """Rounding of c/d times the twist, at 18 rad, must not open and close the contact for ever."""
    structure = PAPER.parse("two_mass+stribeck+backlash")
    values = random_values(structure.parameters, np.random.default_rng([3, 58, 0]))
    system = assemble(structure, values, PAPER_EXPERIMENT.f_tanh, OUTPUTS)
    u, how = TORQUE[:760], Settings(PAPER_EXPERIMENT.f_tanh, speed, "accurate")
    run = response(system, u, PAPER_EXPERIMENT.dt, system.rest(u=u[0]), how)
    assert run.diverged[0] == -1
    assert np.abs(run.y[1, -20:, 0]).max() < 1e-9
    same(structure, values, u, "accurate", "linear")


@pytest.mark.parametrize("off", [1e-10, 1e-9, 1.1e-9])
def test_kernel__knot_beside_a_tick__equals_plain(off: float) -> None:
    """A knot within a billionth of a tick is on the tick or just after it, never a tick away."""
    T_d = PAPER_EXPERIMENT.dt * (2.0 + off) / 128.0
    u = 3.0 * np.random.default_rng(0).normal(size=12)
    same(PAPER.parse("one_mass+coulomb+delay"), {"J1": 0.01, "M_C": 0.1, "T_d": T_d}, u, "accurate", "zoh")


def same(
    structure: Structure,
    values: Mapping[str, float],
    u: NDArray[np.float64],
    level: str,
    hold: str,
    x0: NDArray[np.float64] | None = None,
) -> None:
    experiment = PAPER_EXPERIMENT
    system = assemble(structure, values, experiment.f_tanh, OUTPUTS)
    how = Settings(experiment.f_tanh, experiment.speed, level, hold)  # type: ignore[arg-type]
    x0 = system.rest(u=u[0]) if x0 is None else x0
    fast = response(system, u, experiment.dt, x0, how).y[:, :, 0]
    plain = plain_response(system, u, experiment.dt, x0, how)
    # Same steps, other exponentials and root finders: what remains is rounding, carried on by stiff friction.
    # Acceleration jumps at contacts, whose times carry that rounding: it is judged by its root mean square.
    for row, size in enumerate((np.max, np.max, lambda x: np.sqrt(np.mean(x**2)))):
        assert size(np.abs(fast[row] - plain[row])) <= 1e-8 * size(np.abs(plain[row])), OUTPUTS[row]
