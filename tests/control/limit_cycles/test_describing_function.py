"""Describing functions against formulas, and limit cycles against simulation."""

import math

import numpy as np
import pytest

from brightgrey.control.design.closed_loop import closed_loop
from brightgrey.control.design.controllers import OutputFeedback
from brightgrey.control.limit_cycles.describing_function import (
    describing_function,
    gap_describing_function,
    predict_limit_cycles,
    saturation_gain,
)
from brightgrey.control.linear.margins import Compensator
from brightgrey.errors import SettingsError
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings
from support.drives import system_of, values_of

NERVOUS = {"J1": 0.004, "J2": 0.016, "c1": 5000.0, "d1": 2.0, "M_C": 0.05, "f_v": 0.01, "alpha": 0.01}
NERVOUS |= {"T_1": 2e-3, "T_d": 1e-3}
DT = 5e-4


def test_describing_function__coulomb_friction__is_that_of_a_relay():
    (element,) = [e for e in system_of("one_mass+coulomb").elements if not e.law.affine]
    amplitude = np.array([4.0, 40.0, 400.0])
    found = describing_function(element, amplitude)
    assert found[2] == pytest.approx(-4.0 * 0.9 / (np.pi * 400.0), rel=1e-3)
    assert describing_function(element, np.array([1e-4]))[0] == pytest.approx(-0.9 * 2.5, rel=1e-4)
    assert np.all(np.diff(found) > 0.0)


def test_describing_function__exact_friction__is_that_of_a_relay_at_any_amplitude():
    values = values_of("one_mass+coulomb")
    (element,) = assemble(PAPER.parse("one_mass+coulomb"), values, math.inf).elements
    amplitude = np.geomspace(1e-6, 1e3, 10)
    np.testing.assert_allclose(describing_function(element, amplitude), -4.0 * 0.9 / (np.pi * amplitude), rtol=1e-4)


def test_saturation_gain__agrees_with_quadrature():
    t = np.linspace(0.0, 2.0 * np.pi, 200001)
    clipped = np.clip(3.0 * np.sin(t), -1.0, 1.0) * np.sin(t)
    numeric = np.sum(0.5 * (clipped[1:] + clipped[:-1]) * np.diff(t)) / np.pi / 3.0
    assert saturation_gain(3.0, 1.0) == pytest.approx(numeric, rel=1e-8)
    assert saturation_gain(0.5, 1.0) == 1.0


def test_gap_describing_function__wide_gap__is_an_integrator():
    omega, feedback = np.array([50.0]), -200.0
    found = gap_describing_function(1e9, feedback, omega, np.array([1.0]))
    assert found[0] == pytest.approx(1.0 / (1j * 50.0 + 200.0), rel=5e-2)


def fundamental(y, dt):
    t = dt * np.arange(len(y))
    y = y - y.mean()
    crossings = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
    at = t[crossings] - y[crossings] * dt / (y[crossings + 1] - y[crossings])
    frequency = (len(at) - 1) / (at[-1] - at[0])
    M = np.column_stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t)])
    return frequency, float(np.hypot(*np.linalg.lstsq(M, y, rcond=None)[0]))


@pytest.mark.parametrize(
    ("text", "gain", "limit"),
    [
        ("two_mass+coulomb+viscous+current_control+delay", 10.0, 3.0),
        ("two_mass+coulomb+viscous+backlash+current_control+delay", 5.0, np.inf),
    ],
)
def test_predict_limit_cycles__unstable_loop__agrees_with_simulation(text, gain, limit):
    system = system_of(text, **NERVOUS)
    controller = Compensator.of([gain, 5.0 * gain], [1.0, 0.0])
    found = predict_limit_cycles(
        system, controller, torque=(0.1, 500.0), omega=(50.0, 4000.0), delay=DT / 2, limit=limit
    )
    cycle = [c for c in found if c.stable][-1]
    start = system.rest()
    start[system.state_names.index("v1")] = 0.7 * cycle.outputs[0]
    run = closed_loop(
        system, OutputFeedback(controller, DT, np.zeros(800)), 800, DT, Settings(2.5, 100.0), limit=limit, x0=start
    )
    frequency, amplitude = fundamental(run.y[400:, 0], DT)
    assert frequency == pytest.approx(cycle.frequency, rel=0.15)
    assert amplitude == pytest.approx(cycle.outputs[0], rel=0.15)


def test_predict_limit_cycles__exact_friction__is_the_limit_of_a_steep_sign():
    """The smallest torques are far below breakaway, where the drive sticks and no oscillation is found."""
    text = "two_mass+coulomb+viscous+current_control+delay"
    controller = Compensator.of([10.0, 50.0], [1.0, 0.0])
    found, steep = (
        predict_limit_cycles(
            assemble(PAPER.parse(text), values_of(text, **NERVOUS), f),
            controller,
            torque=(0.01, 500.0),
            omega=(50.0, 4000.0),
            delay=DT / 2,
            limit=3.0,
        )
        for f in (math.inf, 1e4)
    )
    (cycle,) = [c for c in found if c.stable]
    system = assemble(PAPER.parse(text), values_of(text, **NERVOUS), math.inf)
    start = system.rest()
    start[system.state_names.index("v1")] = 0.7 * cycle.outputs[0]
    loop = OutputFeedback(controller, DT, np.zeros(400))
    run = closed_loop(system, loop, 400, DT, Settings(math.inf, 100.0), limit=3.0, x0=start)
    frequency, amplitude = fundamental(run.y[200:, 0], DT)
    assert frequency == pytest.approx(cycle.frequency, rel=0.15)
    assert amplitude == pytest.approx(cycle.outputs[0], rel=0.15)
    for one, other in zip(found, steep, strict=True):
        assert one.stable == other.stable
        assert one.frequency == pytest.approx(other.frequency, rel=1e-3)
        assert one.torque == pytest.approx(other.torque, rel=1e-3)


def test_predict_limit_cycles__linear_stable_loop__finds_none():
    system = system_of("two_mass+viscous+current_control+delay", **NERVOUS)
    assert (
        predict_limit_cycles(system, Compensator.of([0.5, 2.0], [1.0, 0.0]), torque=(0.1, 100.0), omega=(50.0, 4000.0))
        == ()
    )


def test_predict_limit_cycles__acceleration_output__is_refused():
    with pytest.raises(SettingsError, match="acceleration"):
        predict_limit_cycles(
            system_of("one_mass", outputs=("acceleration",)),
            Compensator.of([1.0], [1.0]),
            torque=(0.1, 1.0),
            omega=(1.0, 10.0),
        )
