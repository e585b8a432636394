"""State before the first sample."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.errors import SettingsError
from brightgrey.estimation import fit, predict
from brightgrey.estimation.onset import Onset, check_initial, noise_of
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording, Signal
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference

DT = 1e-3
SETTINGS = Settings(f_tanh=2.5, speed_scale=40.0, level="accurate")
STRUCTURE = PAPER.parse("one_mass+viscous")
TRUE = {"J1": 0.02, "f_v": 0.05}


def drive(speed, noise, seed=0, structure=STRUCTURE, values=TRUE, x0=None, samples=800):
    t = DT * np.arange(samples)
    u = 2.0 * np.sin(2 * np.pi * 3 * t)
    x0 = np.array([0.0, speed]) if x0 is None else x0
    (v,) = reference(structure, values, u, DT, f_tanh=2.5, x0=x0)
    y = v + noise * np.random.default_rng(seed).standard_normal(samples)
    outputs = (Signal("v", "velocity", "rad/s"),)
    return Recording("made", t, u, y[None], Signal("u", "input", "N m"), outputs)


def test_auto_takes_standstill_or_clear_motion():
    assert Onset.of(drive(0.0, 0.01)).speed == 0.0
    assert Onset.of(drive(5.0, 0.01)).speed == pytest.approx(5.0, rel=0.1)
    assert Onset.of(drive(5.0, 0.01), "rest").speed == 0.0


def test_estimated_speed_is_limited_by_the_sensors_noise():
    recording = drive(5.0, 0.1)
    (speed,) = Onset.of(recording, "estimated").unknown
    assert speed.high - speed.low == pytest.approx(12.0 * noise_of(recording)[0] / np.sqrt(10), rel=1e-6)
    found = fit(STRUCTURE, [recording], f_tanh=2.5, initial="estimated", level="fast")
    assert found.initial_states[0]["v1"] == pytest.approx(5.0, abs=0.1)
    assert set(found.estimates) == set(TRUE)
    for name, value in TRUE.items():
        assert found.estimates[name].value == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize("pole", [0.9, 0.95])
def test_slow_noise_that_looks_like_motion_leaves_standstill_open(pole):
    clean = drive(0.0, 0.0)
    moving = left_out = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        noise = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.standard_normal(1300))[500:]
        noisy = replace(clean, y=clean.y + 0.06 * np.abs(clean.y).max() * noise)
        for part in Onset.of(noisy).unknown:
            moving += 1
            left_out += not part.low <= 0.0 <= part.high
    assert moving >= 10  # else this tests nothing
    assert left_out <= 4  # beyond three standard deviations, which come from few means


def test_position_in_the_gap_is_searched_for_where_a_recording_begins_in_motion():
    structure = PAPER.parse("two_mass+viscous+backlash")
    values = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "f_v": 0.05, "alpha": 0.05}
    x0 = np.array([0.0, 0.06, 8.0, 8.0, -0.06])  # 0.6 of the gap, the shaft relaxed
    recording = drive(8.0, 0.01, structure=structure, values=values, x0=x0)
    names = [part.name for part in Onset.of(recording, "auto", "", ("lambda1",)).unknown]
    assert names == ["speed(0)", "lambda1(0)/width"]
    found = fit(structure, [recording], f_tanh=2.5, level="fast", seed=1)
    assert found.initial_states[0]["lambda1"] == pytest.approx(-0.06, rel=0.2)
    y = predict(
        structure, {n: e.value for n, e in found.estimates.items()}, recording, SETTINGS, found.initial_states[0]
    )
    assert np.std(y - recording.y) <= 1.1 * 0.01


def test_every_recording_has_its_own_initial_state():
    both = [drive(5.0, 0.02, seed=1), drive(-3.0, 0.02, seed=2)]
    found = fit(STRUCTURE, both, f_tanh=2.5, initial="estimated", level="fast")
    speeds = [state["v1"] for state in found.initial_states]
    assert speeds == pytest.approx([5.0, -3.0], abs=0.1)
    assert found.estimates["J1"].value == pytest.approx(TRUE["J1"], rel=0.02)


def test_wrong_name_is_refused():
    assert check_initial("rest") == "rest"
    with pytest.raises(SettingsError, match="Did you mean 'rest'"):
        check_initial("restt")
