"""State feedback on the states that a Kalman filter estimates."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brightgrey.control.design.closed_loop import closed_loop, standstill
from brightgrey.control.design.controllers import OutputFeedback, StateFeedback, feedforward
from brightgrey.control.design.lqg import ObserverFeedback, kalman_gain, lqg_compensator
from brightgrey.control.design.state_feedback import design_state_feedback
from brightgrey.control.filters.extended_kalman import Noise
from brightgrey.control.linear.analysis import analyse_system
from brightgrey.control.linear.margins import closed_loop_poles
from brightgrey.control.linear.operating_point import contact_mode
from brightgrey.control.linear.twist_coordinates import to_twist_coordinates
from brightgrey.errors import SettingsError
from brightgrey.excitation import MotionLimits, reversing
from brightgrey.kit import Linear
from support.drives import SETTINGS, system_of

DT = 1e-3
NOISE = Noise(0.4, np.array([0.04]))
FULL = "two_mass+coulomb+viscous+gravity+backlash+current_control+delay"


def designed(text):
    system = system_of(text)
    found = design_state_feedback(analyse_system(system, speed=10.0), largest_error=2.0, torque=4.0, settling_time=0.05)
    return system, found, kalman_gain(found.analysis.linear, NOISE, DT)


def test_kalman_gain__agrees_with_python_control():
    control = pytest.importorskip("control")
    _, found, gain = designed("two_mass+viscous+current_control")
    A, B, C, _ = found.analysis.linear
    theirs, _, _ = control.lqe(A, B, C, [[0.4**2 * DT]], [[0.04**2 * DT]])
    assert_allclose(gain, theirs, rtol=1e-6)


def test_lqg_compensator__poles__are_those_of_feedback_and_filter():
    _, found, gain = designed("two_mass+viscous+current_control")
    A, _, C, _ = found.analysis.linear
    expected = np.concatenate([found.poles, np.linalg.eigvals(A - gain @ C)])
    poles = closed_loop_poles(found.analysis.linear, lqg_compensator(found, gain))
    assert_allclose(np.sort_complex(poles), np.sort_complex(expected), rtol=1e-5)


def test_kalman_gain__unobservable_mode__is_refused():
    hidden = Linear(np.diag([1.0, -1.0]), np.ones((2, 1)), np.array([[0.0, 1.0]]), np.zeros((1, 1)))
    with pytest.raises(SettingsError, match="Kalman"):
        kalman_gain(hidden, NOISE, DT)


def test_observer_feedback__linear_drive__agrees_with_lqg_compensator():
    """Without friction and limits, from standstill, under a disturbance."""
    system, found, gain = designed("two_mass+viscous+current_control")
    push = np.where(np.arange(300) > 20, 0.5, 0.0)
    exact = ObserverFeedback(StateFeedback(found, standstill(300), DT), system, NOISE, 40.0)
    plain = OutputFeedback(lqg_compensator(found, gain), DT, np.zeros(300))
    runs = [closed_loop(system, c, 300, DT, SETTINGS, disturbance=push).state("v1") for c in (exact, plain)]
    assert np.abs(runs[0] - runs[1]).max() < 0.2 * np.abs(runs[1]).max()
    assert np.abs(runs[0][-20:]).max() < 0.05 * np.abs(runs[0]).max()


@pytest.mark.parametrize("delay", [0.0, 1.5e-3])
def test_observer_feedback__noisy_speed_only__follows_nearly_as_well(delay):
    system = system_of(FULL, T_d=delay)
    found = design_state_feedback(analyse_system(system, speed=10.0), largest_error=2.0, torque=4.0, settling_time=0.05)
    motion = reversing(1.5, MotionLimits(20.0, 250.0, 15000.0), dt=DT, samples=400, before=0.02, between=0.02)
    follow = StateFeedback(found, feedforward(contact_mode(to_twist_coordinates(system), "forward"), motion), DT)
    noise = 0.02 * np.random.default_rng(1).normal(size=(400, 1))
    push = np.where(np.arange(400) > 300, 0.5, 0.0)
    errors = []
    for controller, told in ((follow, None), (ObserverFeedback(follow, system, NOISE, 40.0), noise)):
        run = closed_loop(system, controller, 400, DT, SETTINGS, limit=8.0, disturbance=push, noise=told)
        assert np.abs(run.u).max() <= 8.0
        errors.append(float(np.sqrt(np.mean((run.state("v1") - motion.velocity) ** 2))))
    assert errors[1] < 1.2 * errors[0]
