"""Sensors at other masses than the first, and speeds without sign."""

import numpy as np
import pytest

from brightgrey import identify, recording_from
from brightgrey.errors import SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.simulation.reference import reference

VALUES = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "f_v": 0.004, "M_C": 0.3}
GAP = VALUES | {"alpha": 0.004}
F_TANH = 40.0


def recorded(structure, values, sensors, noise, kinds):
    """Recording by the reference solver, with white noise in parts of each signal's standard deviation."""
    u, rng = E.torque(), np.random.default_rng(3)
    signals = reference(structure, values, u, E.dt, f_tanh=F_TANH, outputs=sensors)
    signals = [np.abs(y) if "speed" in kind else y for y, kind in zip(signals, kinds, strict=True)]
    noisy = {f"y{i}": y + noise * y.std() * rng.normal(size=y.size) for i, y in enumerate(signals)}
    columns = {"t": E.dt * np.arange(u.size), "torque": u, **noisy}
    units = {"t": "s", "torque": "N m"} | {
        name: "rad" if "position" in kind else "rad/s" for name, kind in zip(noisy, kinds, strict=True)
    }
    return recording_from(columns, input="torque", outputs=list(zip(noisy, kinds, strict=True)), time="t", units=units)


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


def test_sensor__mass_that_is_not_there__is_refused():
    recording = recorded("two_mass+coulomb+viscous", VALUES, ("v2",), 0.01, ("velocity@2",))
    with pytest.raises(SettingsError, match=r"output 'velocity@2': 'one_mass\+viscous' has mass 1 only"):
        identify(recording, "one_mass+viscous")
