"""Sensors at other masses than the first, and speeds without sign."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey import Model, design, identify, recording_from, simulate
from brightgrey.errors import RecordingError, SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.recordings import Signal
from brightgrey.simulation.reference import reference
from support.models import random_model

VALUES = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "f_v": 0.004, "M_C": 0.3}
GAP = VALUES | {"alpha": 0.004}
F_TANH = 40.0


def recorded(structure, values, sensors, noise, kinds, actuator=1):
    """Recording by the reference solver, with white noise in parts of each signal's standard deviation."""
    u, rng = E.torque(), np.random.default_rng(3)
    signals = reference(structure, values, u, E.dt, f_tanh=F_TANH, outputs=sensors, actuator=actuator)
    signals = [np.abs(y) if "speed" in kind else y for y, kind in zip(signals, kinds, strict=True)]
    noisy = {f"y{i}": y + noise * y.std() * rng.normal(size=y.size) for i, y in enumerate(signals)}
    columns = {"t": E.dt * np.arange(u.size), "torque": u, **noisy}
    units = {"t": "s", "torque": "N m"} | {
        name: "rad" if "position" in kind else "rad/s" for name, kind in zip(noisy, kinds, strict=True)
    }
    outputs = list(zip(noisy, kinds, strict=True))
    return recording_from(columns, input="torque", outputs=outputs, time="t", units=units, actuator=actuator)


@pytest.mark.long
def test_two_encoders__gap_between_them__is_found_within_a_percent():
    recording = recorded("two_mass+backlash+coulomb+viscous", GAP, ("q1", "q2"), 1e-4, ("position", "position@2"))
    result = identify(recording, "two_mass+coulomb+viscous+backlash", f_tanh=F_TANH)
    assert result.model.parameters["alpha"].value == pytest.approx(GAP["alpha"], rel=0.01)
    assert [s.mass for s in result.model.signals] == [1, 1, 2]
    for name in ("J1", "J2", "M_C", "f_v"):
        assert result.model.parameters[name].value == pytest.approx(GAP[name], rel=0.02), name


def test_speed_of_the_load_without_sign__actuator_at_the_motor__parameters_are_found():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v2",), 0.01, ("speed@2",))
    result = identify(recording, "two_mass+coulomb+viscous", f_tanh=F_TANH)
    (fit,) = result.model.fit.train.values()
    assert fit.fit_percent > 98.0
    for name in ("J1", "J2", "f_v", "M_C"):
        assert result.model.parameters[name].value == pytest.approx(VALUES[name], rel=0.15), name


def test_actuator_at_the_load__sensor_at_the_motor__parameters_are_found():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v1",), 0.01, ("velocity",), actuator=2)
    model = identify(recording, "two_mass+coulomb+viscous", f_tanh=F_TANH).model
    for name, value in VALUES.items():
        low, high = model.parameters[name].ci95
        spread = model.parameters[name].std  # low and high are two of them away: four in all
        assert low - 2.0 * spread < value < high + 2.0 * spread, name
    fit = simulate(model, recording).fit["y0"]
    assert fit.fit_percent == pytest.approx(model.fit.train["y0"].fit_percent, abs=1e-6)
    assert Model.check(model.model_dump(mode="json")).input.mass == 2
    with pytest.raises(RecordingError, match=r"signals are .*the model was identified from .*input@2"):
        simulate(model, recorded("two_mass+coulomb+viscous", VALUES, ("v1",), 0.01, ("velocity",)))


def test_actuator_elsewhere__what_needs_it_at_mass_1__is_refused():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v1",), 0.01, ("velocity",), actuator=2)
    with pytest.raises(SettingsError, match="acts on mass 2, and a search needs it at mass 1"):
        identify(recording)
    with pytest.raises(SettingsError, match=r"actuator at mass 2: 'one_mass\+viscous' has mass 1 only"):
        identify(recording, "one_mass+viscous")
    with pytest.raises(SettingsError, match="a cascade closes its loops at mass 1"):
        design(random_model("two_mass", 1, actuator=2), torque=1.0)
    with pytest.raises(SettingsError, match="actuator is 0"):
        recording_from({"t": recording.t, "u": recording.u, "v": recording.y[0]}, input="u", outputs="v", actuator=0)


def test_sensor__mass_that_is_not_there__is_refused():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v2",), 0.01, ("velocity@2",))
    with pytest.raises(SettingsError, match=r"output 'velocity@2': 'one_mass\+viscous' has mass 1 only"):
        identify(recording, "one_mass+viscous")


def test_search__masses_that_a_sensor_needs_are_excluded__says_which_sensor():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v1", "v2"), 0.01, ("velocity", "velocity@2"))
    with pytest.raises(SettingsError, match="'two_mass' is excluded, and 'y1' is measured at mass 2"):
        identify(recording, exclude=["two_mass"])


def test_search__effect_that_it_does_not_offer__says_so():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v1",), 0.01, ("velocity",))
    with pytest.raises(SettingsError, match="the function set 'drive' does not offer 'gravity@2'"):
        identify(recording, require=["gravity@2"])
    with pytest.raises(SettingsError, match="Did you mean 'coulomb'"):
        identify(recording, require=["colomb"])


@pytest.mark.parametrize("mass", [0, -1, "2", 1.5])
def test_signal__mass_that_is_no_count__is_refused(mass):
    with pytest.raises(RecordingError, match="expected a whole number from 1"):
        Signal("v", "velocity", "rad/s", mass=mass)


def test_profile__unknown_parameter__is_refused_before_the_fit():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v1",), 0.01, ("velocity",))
    with pytest.raises(SettingsError, match="unknown estimated parameter 'J9'"):
        identify(recording, "two_mass", profile=["J9"])
    with pytest.raises(SettingsError, match="expected: several parameters"):
        identify(recording, "two_mass", per_recording="f_v")


def test_simulate__recording_with_values_of_its_own__says_that_the_mean_is_taken():
    first = recorded("two_mass+coulomb+viscous", VALUES, ("v1",), 0.01, ("velocity",))
    second = recorded("two_mass+coulomb+viscous", VALUES | {"f_v": 0.012}, ("v1",), 0.01, ("velocity",))
    warm, cold = replace(first, name="warm"), replace(second, name="cold")
    model = identify([warm, cold], "two_mass+coulomb+viscous", per_recording=["f_v"], level="fast").model
    assert simulate(model, cold).notes[-1] == "cold: it was fitted with its own f_v, and is simulated with their mean"
    assert not [note for note in simulate(model, first).notes if "its own" in note]
