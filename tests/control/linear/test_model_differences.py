"""Differences for control between models of one drive."""

import math

import numpy as np
import pytest

from brightgrey.control.linear.model_differences import FrequencyBand, excited_band, model_figures
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, assemble
from support.drives import system_of, values_of

SPEED = 0.5 * E.speed
OVER = FrequencyBand(0.5, 40.0)


def test_excited_band__two_tones__holds_both():
    t = 1e-3 * np.arange(2000)
    low, high = excited_band([np.sin(2.0 * np.pi * 5.0 * t) + 0.5 * np.sin(2.0 * np.pi * 30.0 * t)], 1e-3)
    assert low == pytest.approx(0.5)
    assert high == pytest.approx(30.0, abs=1.5)
    assert excited_band([np.ones(100)], 0.01).high > excited_band([np.ones(100)], 0.01).low


def test_model_figures__equal_models__have_no_difference():
    _, same = model_figures([system_of("two_mass+coulomb+viscous")] * 2, SPEED, E.f_tanh, OVER)
    assert (same.gain_difference, same.phase_difference) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_model_figures__inertia_and_delay__change_gain_and_phase():
    heavy = system_of("one_mass+delay", J1=0.024, T_d=2e-3)
    first, second = model_figures([system_of("one_mass"), heavy], SPEED, E.f_tanh, OVER)
    assert second.gain_difference == pytest.approx(-20.0 * np.log10(2.0), rel=1e-6)
    assert second.phase_difference == pytest.approx(360.0 * OVER.high * 2e-3, rel=1e-6)
    assert (first.dead_time, second.dead_time) == (0.0, 2e-3)


def test_model_figures__elastic_model__differs_at_the_resonance():
    rigid = system_of("one_mass", J1=0.02)
    _, elastic = model_figures([rigid, system_of("two_mass")], SPEED, E.f_tanh, OVER)
    (swing,) = elastic.resonances
    assert swing.frequency == pytest.approx(19.9, abs=0.1)
    assert elastic.frequency == pytest.approx(19.9, abs=0.5) or elastic.frequency == pytest.approx(15.4, abs=0.5)
    assert abs(elastic.gain_difference) > 15.0


@pytest.mark.parametrize("text", ["one_mass", "two_mass", "two_mass+backlash"])
def test_model_figures__friction_and_gravity__are_separated(text):
    structure = "+".join([*text.split("+")[:1], "coulomb", "stribeck", "gravity", *text.split("+")[1:]])
    (found,) = model_figures([system_of(structure)], SPEED, E.f_tanh, OVER)
    values = values_of(structure)
    slow = 3.0 / E.f_tanh
    expected = np.tanh(3.0) * (values["M_C"] + values["M_S"] * np.exp(-slow / values["omega_S"]))
    assert found.standstill_friction == pytest.approx(expected, rel=1e-9)
    assert found.constant_input == pytest.approx(-values["M_G"], rel=1e-9)


def test_model_figures__exact_friction__has_its_breakaway_torque():
    text = "two_mass+coulomb+stribeck+gravity+backlash"
    values = values_of(text)
    (found,) = model_figures([assemble(PAPER.parse(text), values, math.inf)], SPEED, math.inf, OVER)
    assert found.standstill_friction == pytest.approx(values["M_C"] + values["M_S"], rel=1e-9)
    assert found.constant_input == pytest.approx(-values["M_G"], rel=1e-9)
