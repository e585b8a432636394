"""State feedback, cascade and the closed loop on the non-linear model."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from brightgrey.control.design.cascade import CascadeGoal, design_cascade
from brightgrey.control.design.closed_loop import closed_loop, standstill
from brightgrey.control.design.controllers import CascadeController, OutputFeedback, StateFeedback, feedforward
from brightgrey.control.design.state_feedback import design_state_feedback, lqr, place_poles
from brightgrey.control.linear.analysis import analyse_system
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.operating_point import contact_mode
from brightgrey.control.linear.twist_coordinates import to_twist_coordinates
from brightgrey.errors import SettingsError
from brightgrey.excitation import MotionLimits, reversing
from support.drives import SETTINGS, VALUES, system_of

DT = 1e-3
MOTION = reversing(1.5, MotionLimits(20.0, 250.0, 15000.0), dt=DT, samples=400, before=0.02, between=0.02)


def test_lqr__agrees_with_python_control():
    control = pytest.importorskip("control")
    linear = analyse_system(system_of("two_mass+viscous+current_control")).linear
    Q, R = np.diag([1.0, 2.0, 3.0, 0.1]), np.array([[0.5]])
    K, _, poles = control.lqr(linear.A, linear.B, Q, R)
    mine = lqr(linear.A, linear.B, Q, R)
    assert_allclose(mine.K, K, rtol=1e-8)
    assert_allclose(np.sort_complex(mine.poles), np.sort_complex(poles), rtol=1e-8)


def test_place_poles__reachable_poles__are_the_closed_loop_poles():
    linear = analyse_system(system_of("two_mass+viscous")).linear
    wanted = np.array([-50.0, -60.0 + 80.0j, -60.0 - 80.0j])
    assert_allclose(np.sort_complex(place_poles(linear.A, linear.B, wanted).poles), np.sort_complex(wanted), rtol=1e-8)
    with pytest.raises(SettingsError, match="2 poles for a system of order 3"):
        place_poles(linear.A, linear.B, [-1.0, -2.0])


def test_design_state_feedback__open_gap__is_refused():
    system = system_of("two_mass+viscous+backlash")
    design_state_feedback(analyse_system(system, contact="backward"), largest_error=1.0, torque=5.0)
    with pytest.raises(SettingsError, match="stabilising"):
        design_state_feedback(analyse_system(system, contact="gap"), largest_error=1.0, torque=5.0)


def test_closed_loop__linear_drive__follows_the_formula():
    """One mass with a P controller: the sampled loop has a formula."""
    gain, start = 1.5, 4.0
    system = system_of("one_mass+viscous")
    x0 = system.rest(speed=start)
    loop = OutputFeedback(Compensator.of([gain], [1.0]), DT, np.zeros(100))
    run = closed_loop(system, loop, 100, DT, SETTINGS, x0=x0)
    a, J = -VALUES["f_v"] / VALUES["J1"], VALUES["J1"]
    factor = np.exp(a * DT) - gain / J * np.expm1(a * DT) / a
    assert_allclose(run.y[:, 0], start * factor ** np.arange(100), rtol=1e-6, atol=1e-6 * start)


def test_closed_loop__fractional_dead_time__is_exact():
    """Torque held from 1.5 samples after it was asked for."""
    system = system_of("one_mass+viscous+delay", T_d=1.5 * DT)
    loop = OutputFeedback(Compensator.of([1.0], [1.0]), DT, np.concatenate([[2.0], np.zeros(9)]))
    run = closed_loop(system, loop, 4, DT, SETTINGS)
    a, J = -VALUES["f_v"] / VALUES["J1"], VALUES["J1"]
    assert run.y[1, 0] == 0.0
    assert run.y[2, 0] == pytest.approx(2.0 / J * np.expm1(a * 0.5 * DT) / a, rel=1e-6)
    assert run.u[0] == 2.0


def test_state_feedback__feedforward__halves_the_error():
    system = system_of("two_mass+coulomb+viscous+gravity+backlash+current_control")
    found = design_state_feedback(analyse_system(system, speed=10.0), largest_error=2.0, torque=4.0, settling_time=0.05)
    assert np.all(found.poles.real < 0.0)
    reached = found.margins(0.5 * DT)
    assert reached.stable
    assert reached.phase > 45.0
    errors = []
    for torque in (True, False):
        reference = feedforward(contact_mode(to_twist_coordinates(system), "forward"), MOTION, torque=torque)
        run = closed_loop(system, StateFeedback(found, reference, DT), 400, DT, SETTINGS, limit=8.0)
        assert np.abs(run.u).max() <= 8.0
        errors.append(float(np.sqrt(np.mean((run.state("v1") - MOTION.velocity) ** 2))))
    assert errors[0] < 0.5 * errors[1]


def test_state_feedback__constant_disturbance__is_rejected():
    system = system_of("two_mass+coulomb+viscous+gravity")
    found = design_state_feedback(analyse_system(system, speed=10.0), largest_error=1.0, torque=4.0, settling_time=0.02)
    run = closed_loop(
        system, StateFeedback(found, standstill(500), DT), 500, DT, SETTINGS, disturbance=np.full(500, 0.8)
    )
    assert np.abs(run.state("v1")).max() > 0.02
    assert np.abs(run.state("v1")[-50:]).max() < 0.02 * np.abs(run.state("v1")).max()


def test_design_cascade__drive_with_gap__meets_its_goal_and_follows():
    system = system_of("two_mass+coulomb+viscous+backlash", outputs=("position", "velocity"))
    goal = CascadeGoal()
    analyses = [analyse_system(system, speed=10.0, contact=contact) for contact in ("forward", "gap")]
    found = design_cascade(analyses, VALUES["J1"] + VALUES["J2"], DT, goal=goal)
    for reached in (*found.speed_margins, *found.position_margins):
        assert reached.stable
        assert reached.gain >= goal.gain
        assert reached.phase >= goal.phase
        assert reached.sensitivity <= goal.sensitivity
    reference = feedforward(contact_mode(to_twist_coordinates(system), "forward"), MOTION)
    names = system.state_names
    controller = CascadeController(found, reference, DT, names.index("q1"), names.index("v1"))
    run = closed_loop(system, controller, 400, DT, SETTINGS, limit=10.0)
    assert np.abs(run.state("q1") - MOTION.position).max() < 0.05 * MOTION.position.max()


def settling_time(system, found, step=0.1, share=0.02, samples=2000):
    """Time after which the position stays within a share of a step of its reference, s."""
    reference = replace(standstill(samples), position=np.full(samples, step))
    names = system.state_names
    controller = CascadeController(found, reference, DT, names.index("q1"), names.index("v1"))
    run = closed_loop(system, controller, samples, DT, SETTINGS)
    outside = np.flatnonzero(np.abs(run.state("q1") - step) > share * step)
    assert run.state("q1").max() < 1.1 * step
    return DT * float(outside[-1] + 1)


@pytest.mark.parametrize("dead_time", [0.0, 1.5e-3, 6e-3])
def test_design_cascade__rigid_drive__position_loop_is_as_fast_as_its_speed_loop_allows(dead_time):
    """A speed loop at the limit of its goal would leave no phase for a position loop around it."""
    text = "one_mass+viscous" + ("+delay" if dead_time else "")
    given = {"T_d": dead_time} if dead_time else {}
    system = system_of(text, outputs=("position", "velocity"), **given)
    found = design_cascade([analyse_system(system, speed=10.0)], VALUES["J1"], DT)
    crossover = found.speed_gain / VALUES["J1"]
    assert 0.1 < found.position_gain / crossover < 0.4
    assert settling_time(system, found) < 6.0 / found.position_gain


def test_design_cascade__arm__is_stable_hanging_and_upright():
    arm = {"G": 2.0, "k": 1.0, "phi_0": 0.3}
    system = system_of("one_mass+viscous+pendulum", outputs=("position", "velocity"), **arm)
    analyses = [analyse_system(system, position=(turn - 0.3) / 1.0) for turn in (0.0, np.pi)]
    assert [a.stability for a in analyses] == ["stable", "unstable"]
    assert all(a.depends_on_position for a in analyses)
    found = design_cascade(analyses, VALUES["J1"], DT)
    assert all(m.stable for m in (*found.speed_margins, *found.position_margins))
    limits = MotionLimits(10.0, 100.0, 5000.0)
    motion = reversing(np.pi, limits, dt=DT, samples=1200, before=0.02, between=0.05)
    names = system.state_names
    errors = []
    for torque in (True, False):
        reference = feedforward(contact_mode(to_twist_coordinates(system), "forward"), motion, torque=torque)
        controller = CascadeController(found, reference, DT, names.index("q1"), names.index("v1"))
        run = closed_loop(system, controller, 1200, DT, SETTINGS)
        errors.append(float(np.abs(run.state("q1") - motion.position).max()))
    assert errors[0] < 0.05
    assert errors[0] < 0.5 * errors[1]


def test_compensator__discretised__keeps_its_step_response():
    lag = Compensator.of([2.0], [0.05, 1.0])
    sampled = lag.discretise(1e-3)
    state, y = np.zeros(1), []
    for _ in range(200):
        y.append(float((sampled.C @ state + sampled.D[:, 0])[0]))
        state = sampled.A @ state + sampled.B[:, 0]
    exact = [2.0 * (1.0 - float(expm(np.array([[-(k + 0.5) * 1e-3 / 0.05]]))[0, 0])) for k in range(200)]
    assert_allclose(y, exact, atol=2e-3)


@pytest.mark.parametrize("coefficients", [([1e308], [1e-308, 0.0]), ([1e308, 1e308], [1.0, 1.0])])
def test_compensator__coefficients_beyond_all_measure__are_refused(coefficients):
    with pytest.raises(SettingsError, match="a coefficient reaches"):
        Compensator.of(*coefficients)


@pytest.mark.parametrize("coefficients", [(None, [1.0]), ([1.0], "x"), ([np.inf], [1.0, 1.0]), (np.eye(2), [1.0, 1.0])])
def test_compensator__no_numbers__are_refused(coefficients):
    with pytest.raises(SettingsError, match="two lists of finite numbers"):
        Compensator.of(*coefficients)
