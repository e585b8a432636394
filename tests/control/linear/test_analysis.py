"""The linear model against formulas, finite differences and python-control."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brightgrey.control.linear.analysis import analyse_system, invariant_zeros
from brightgrey.control.linear.controllability import controllability, minimal_realisation, observability
from brightgrey.control.linear.margins import Compensator, frequency_grid, frequency_response, stability_margins
from brightgrey.control.linear.operating_point import CONTACTS, contact_mode, trim_point
from brightgrey.control.linear.twist_coordinates import to_twist_coordinates
from brightgrey.errors import SettingsError
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Linear, Structure, assemble
from support.drives import VALUES, system_of, values_of

control = pytest.importorskip("control", reason="python-control is not installed")

ALL = [str(s) for s in PAPER.structures()]
J1, J2, C1, D1 = (VALUES[name] for name in ("J1", "J2", "c1", "d1"))


def test_analysis__two_masses__agrees_with_the_formulas():
    found = analyse_system(system_of("two_mass"))
    resonance = np.roots([1.0, D1 * (1 / J1 + 1 / J2), C1 * (1 / J1 + 1 / J2)])
    antiresonance = np.roots([1.0, D1 / J2, C1 / J2])
    assert_allclose(np.sort_complex(found.poles), np.sort_complex([0.0, *resonance]), atol=1e-9)
    assert_allclose(np.sort_complex(invariant_zeros(found.linear)), np.sort_complex(antiresonance), rtol=1e-9)
    (swing,), (dip,) = found.resonances, found.antiresonances()
    assert swing.frequency == pytest.approx(abs(resonance[0]) / (2 * np.pi))
    assert dip.damping == pytest.approx(-antiresonance[0].real / abs(antiresonance[0]))
    assert found.stability == "marginal"


def test_analysis__velocity_output__has_no_absolute_position():
    assert analyse_system(system_of("two_mass")).states == ("twist1", "v1", "v2")
    assert "q1" in analyse_system(system_of("two_mass", outputs=("position",))).states


@pytest.mark.parametrize("text", ALL[::23])
def test_contact_mode__jacobian__agrees_with_the_kit(text):
    structure = PAPER.parse(text)
    values = random_values(structure.parameters, np.random.default_rng(3))
    system = assemble(structure, values, 2.5, ("velocity", "acceleration"))
    both = to_twist_coordinates(system)
    for contact in CONTACTS:
        on = contact_mode(both, contact)
        z = on.nominal_state(7.0)
        names = both.system.state_names
        if "lambda1" in names:  # shaft unwound, and pushed outwards where it is in contact
            z[names.index("twist1")] = z[names.index("lambda1")]
            z[names.index("v1")] += {"forward": 1e-3, "gap": 0.0, "backward": -1e-3}[contact]
        x = both.V @ z
        A = both.W @ system.linearise(x, 0.0).A @ both.V
        mine = on.jacobian(both.W @ x, 0.0)
        assert_allclose(mine.A, A, rtol=1e-9, atol=1e-9 * np.abs(A).max())
        assert_allclose(mine.C[1], A[names.index("v1")], atol=1e-9 * np.abs(A).max())


def exact(text, outputs=("velocity",), **changed):
    return assemble(PAPER.parse(text), values_of(text, **changed), math.inf, outputs)


def test_analysis__exact_friction_at_standstill__slides_and_says_that_it_sticks():
    found = analyse_system(exact("one_mass+coulomb+viscous+stribeck+gravity"))
    slope = VALUES["f_v"] - VALUES["M_S"] / VALUES["omega_S"]  # Stribeck friction falls with speed
    assert_allclose(found.poles, [-slope / VALUES["J1"]])
    assert found.operating_point.u == pytest.approx(-VALUES["M_G"])
    assert found.sticking_torque == pytest.approx(VALUES["M_C"] + VALUES["M_S"])
    assert found.stability == "unstable"


@pytest.mark.parametrize("speed", [5.0, -5.0])
@pytest.mark.parametrize("text", ["two_mass+coulomb+stribeck", "two_mass+coulomb+viscous+stribeck+backlash"])
def test_analysis__exact_friction_in_motion__is_that_of_a_steep_sign(text, speed):
    found, steep = (
        analyse_system(assemble(PAPER.parse(text), values_of(text), f, ("acceleration",)), speed=speed)
        for f in (math.inf, 1e3)
    )
    assert_allclose(found.linear.A, steep.linear.A, rtol=1e-12)
    assert_allclose(found.linear.C, steep.linear.C, rtol=1e-12)
    assert found.operating_point.u == pytest.approx(steep.operating_point.u, rel=1e-12)
    assert found.sticking_torque == 0.0


def test_trim_point__torque__carries_friction_gravity_and_acceleration():
    system = system_of("two_mass+coulomb+viscous+gravity+backlash+current_control")
    point = trim_point(contact_mode(to_twist_coordinates(system), "forward"), 10.0, 50.0)
    friction = 0.9 * np.tanh(2.5 * 10.0) + 0.015 * 10.0
    assert point.u == pytest.approx(50.0 * (J1 + J2) + friction - 1.0, rel=1e-9)
    alone = trim_point(contact_mode(to_twist_coordinates(system), "gap"), 10.0, 50.0)
    assert alone.u == pytest.approx(50.0 * J1 + friction - 1.0, rel=1e-9)
    structure = Structure.parse("two_mass+coulomb@2+cubic_spring")
    values = values_of("two_mass") | {"c1": 1e-12, "M_C@2": 0.9, "c_cubic": 75.0}
    limp = assemble(structure, values, 2.5)  # Newton's method begins at the line of c1, 12 powers of ten away
    with pytest.raises(SettingsError, match="no steady motion"):
        trim_point(contact_mode(to_twist_coordinates(limp), "forward"), 10.0)


def test_trim_point__open_gap_before_a_load_with_friction__the_load_coasts():
    values = values_of("two_mass+backlash") | {"M_C@2": 0.9, "f_v@2": 0.015, "M_G@2": 1.0}
    system = assemble(Structure.parse("two_mass+coulomb@2+viscous@2+gravity@2+backlash"), values, 2.5)
    mode = contact_mode(to_twist_coordinates(system), "gap")
    point = trim_point(mode, 10.0)
    assert point.u == pytest.approx(0.0, abs=1e-12)
    coasting = mode.derivative(point.z, point.u)[mode.system.state_names.index("v2")]
    assert coasting == pytest.approx((1.0 - 0.9 * np.tanh(2.5 * 10.0) - 0.015 * 10.0) / J2, rel=1e-9)


@pytest.mark.parametrize(("actuator", "carried"), [(1, 0.9), (2, 0.2), (3, 0.2)])
def test_trim_point__open_gap_and_input_on_another_mass__carries_the_friction_on_its_side(actuator, carried):
    structure = Structure.parse("three_mass+coulomb+coulomb@3+backlash+current_control")
    values = {"J1": 0.01, "J2": 0.02, "J3": 0.03, "c1": 50.0, "c2": 70.0, "d1": 0.02, "d2": 0.03}
    values |= {"M_C": 0.9, "M_C@3": 0.2, "alpha": 0.01, "T_1": 1e-3}
    system = assemble(structure, values, np.inf, actuator=actuator)
    assert trim_point(contact_mode(to_twist_coordinates(system), "gap"), 5.0).u == pytest.approx(carried, rel=1e-9)


@pytest.mark.parametrize("masses", ["three_mass", "four_mass"])
def test_absolute_position__nothing_depends_on_it__no_rounding_is_left_of_it(masses):
    structure = Structure.parse(f"{masses}+coulomb+viscous")
    for seed in range(30):
        values = random_values(structure.parameters, np.random.default_rng(seed))
        found = analyse_system(assemble(structure, values, 2.5, ("position", "velocity")), speed=1.0)
        assert not found.depends_on_position
        assert not found.linear.A[:, found.states.index("q1")].any()


def test_controllability__lost_or_nearly_lost_state__is_measured():
    reached = controllability(Linear(np.diag([-1.0, -2.0]), np.array([[1.0], [1.0]]), np.eye(2)[:1], np.zeros((1, 1))))
    lost = controllability(Linear(np.diag([-1.0, -2.0]), np.array([[1.0], [0.0]]), np.eye(2)[:1], np.zeros((1, 1))))
    near = controllability(Linear(np.diag([-1.0, -2.0]), np.array([[1.0], [1e-5]]), np.eye(2)[:1], np.zeros((1, 1))))
    assert reached.complete
    assert reached.distance > 0.05
    assert (lost.rank, lost.distance) == (1, 0.0)
    assert lost.nearest_mode == pytest.approx(-2.0)
    assert near.complete
    assert near.distance == pytest.approx(0.5e-5, rel=0.2)


def test_analysis__open_gap__loses_the_load():
    found = analyse_system(system_of("two_mass+backlash"), contact="gap")
    assert not found.controllability.complete
    assert not found.observability.complete
    small = minimal_realisation(found.linear)
    omega = np.geomspace(1.0, 1e3, 20)
    assert len(small.A) == 1  # the motor alone
    assert_allclose(frequency_response(small, omega), frequency_response(found.linear, omega), rtol=1e-9)
    assert observability(small).complete


@pytest.mark.parametrize("gain", [0.05, 0.5, 3.0])
def test_margins__agree_with_python_control(gain):
    found = analyse_system(system_of("two_mass+viscous+current_control"))
    pi = Compensator.of([gain, 20.0 * gain], [1.0, 0.0])
    mine = found.margins(pi)
    loop = control.tf([gain, 20.0 * gain], [1.0, 0.0]) * found.to_python_control()
    gm, pm, sm, _, _, _ = control.stability_margins(loop)
    assert mine.phase == pytest.approx(pm, rel=1e-3)
    assert mine.sensitivity == pytest.approx(1.0 / sm, rel=1e-3)
    closed = control.feedback(loop, 1)
    assert mine.stable == bool(np.all(closed.poles().real < 0.0))
    if np.isfinite(mine.gain):
        assert mine.gain == pytest.approx(gm, rel=1e-3)


def test_stability_margins__delay_margin__is_the_limit_of_stability():
    linear = analyse_system(system_of("two_mass+viscous")).linear
    pi = Compensator.of([0.6, 6.0], [1.0, 0.0])
    delay = stability_margins(linear, pi).delay
    assert stability_margins(linear, pi, dead_time=0.97 * delay).stable
    assert not stability_margins(linear, pi, dead_time=1.03 * delay).stable


def test_analysis__dead_time__is_exact_in_the_frequency_response():
    found = analyse_system(system_of("one_mass+viscous+delay"))
    omega, response = found.bode(np.array([10.0, 100.0]))
    expected = np.exp(-1j * omega * 1.5e-3) / (J1 * 1j * omega + 0.015)
    assert_allclose(response[0], expected, rtol=1e-12)


def test_analysis__wrong_contact_or_controller__is_refused():
    with pytest.raises(SettingsError, match="forward"):
        analyse_system(system_of("two_mass+backlash"), contact="forwards")
    with pytest.raises(SettingsError, match="degree"):
        Compensator.of([1.0, 0.0], [1.0])


def test_frequency_grid__rounding_of_a_multiple_root_at_zero__does_not_reach_where_matrices_are_singular():
    assert frequency_grid([3e-8, -3e-8, -1e4]).min() >= 1e-5
    assert frequency_grid([-1e-2, -1e4]).min() == pytest.approx(1e-5)
