import csv
import io

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation import demo_recording
from brightgrey.excitation.random_drives import modes
from brightgrey.kit import PAPER
from brightgrey.simulation.reference import reference


@pytest.fixture(scope="module")
def velocity():
    return reference(E.structure, E.values, E.torque(), E.dt, f_tanh=E.f_tanh)[0]


@pytest.fixture(scope="module")
def demo():
    rows = list(csv.reader(io.StringIO(demo_recording())))
    return rows[0], np.array(rows[1:], dtype=float).T


def test_paper_experiment__values__are_those_of_the_structure():
    assert list(E.values) == list(PAPER.parse(E.structure).parameters)


def test_paper_experiment__resonance__is_that_of_a_servo_axis():
    v = E.values
    frequency, ratio = modes(np.array([v["J1"], v["J2"]]), np.array([v["c1"]]), np.array([v["d1"]]))
    assert 10.0 < frequency[0] < 40.0
    assert 0.01 < ratio[0] < 0.1


def test_paper_experiment__friction__is_visible_and_does_not_dominate():
    peak = np.max(np.abs(E.torque()))
    v = E.values
    assert 0.1 < (v["M_C"] + v["M_S"]) / peak < 0.2
    assert 0.1 < (v["M_C"] + v["f_v"] * E.speed) / peak < 0.2


def test_paper_experiment__drive__moves_reverses_and_comes_to_rest(velocity):
    assert np.max(np.abs(velocity)) == pytest.approx(E.speed, rel=0.01)
    assert np.max(velocity) > 0.9 * E.speed
    assert np.min(velocity) < -0.9 * E.speed
    assert abs(velocity[-1]) < 1.0 / E.f_tanh


def test_paper_experiment__stribeck_effect__is_visible(velocity):
    peak, bend = np.max(np.abs(velocity)), E.values["omega_S"]
    assert 2.0 * 5.0 / E.f_tanh < bend < 0.5 * peak / 3.0
    assert E.f_tanh == pytest.approx(100.0 / peak, rel=0.01)  # the default rule finds it
    slow = np.mean((np.abs(velocity) < 2.0 * bend) & (np.abs(velocity) > 2.0 / E.f_tanh))
    assert slow > 0.15  # of all samples


def test_demo_recording__samples__are_the_experiment_with_noise(demo, velocity):
    header, (t, torque, measured) = demo
    assert header == ["t", "torque", "velocity"]
    np.testing.assert_allclose(t, np.arange(1800) * 1e-3, atol=1e-12)
    np.testing.assert_allclose(torque, E.torque(), atol=0.5001e-3)
    noise = measured - velocity
    expected = np.hypot(1e-3 * np.max(np.abs(velocity)), 0.01 / np.sqrt(12.0))
    # The standard deviation of 1800 values is itself known to 1.7 %.
    assert np.std(noise) == pytest.approx(expected, rel=4 * 0.017)
    assert abs(np.mean(noise)) < 4 * expected / np.sqrt(1800)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4 / np.sqrt(1800)
