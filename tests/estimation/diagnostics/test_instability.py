"""Unstable motions: an arm that falls parts from its model, one that hangs does not."""

import numpy as np
import pytest

from brightgrey.estimation import fit, predict
from brightgrey.estimation.diagnostics.instability import parting_time
from brightgrey.kit import Structure
from brightgrey.recordings import read_recording
from brightgrey.simulation import Settings
from support.recordings import make_recording

ARM = Structure.parse("one_mass+viscous+pendulum")
J, G = 0.1, 2.0
VALUES = {"J1": J, "f_v": 0.01, "G": G, "k": 1.0}
SETTINGS = Settings(100.0, 10.0)
DT = 5e-3


def arm(pose, seconds=5.0, torque=0.3):
    """Recording and parameters of an arm that begins at rest in a pose, under a small torque."""
    u = torque * np.sin(2.0 * np.pi * 0.7 * DT * np.arange(round(seconds / DT)))
    empty = make_recording(u, np.zeros(u.size), dt=DT, kind="position")
    values = {**VALUES, "phi_0": pose}
    y = predict(ARM, values, empty, SETTINGS)
    y = y[0] + 1e-4 * np.random.default_rng(0).standard_normal(u.size)
    return make_recording(u, y, dt=DT, kind="position"), values


def test_parting_time__arm_that_hangs__is_none():
    r, values = arm(0.0)
    assert parting_time(ARM, values, r, SETTINGS) is None


def test_parting_time__arm_that_stands__follows_its_rate_of_growth():
    """A shift grows as cosh(w t) with w² = G / J near the upright pose: a hundredfold at arcosh(100) / w."""
    r, values = arm(np.pi, seconds=3.0, torque=1e-3)
    time = parting_time(ARM, values, r, SETTINGS)
    assert time == pytest.approx(np.arccosh(100.0) / np.sqrt(G / J), rel=0.2)


@pytest.mark.parametrize(("pose", "says"), [(0.0, False), (np.pi, True)])
def test_instability_findings__fit__says_where_the_motion_parts(pose, says):
    r, values = arm(pose, seconds=3.0, torque=1e-3)
    found = fit(ARM, [r], fixed=values, patience=0, starts=1)
    texts = [f.text for f in found.outcome.findings if f.kind == "unstable"]
    assert bool(texts) == says
    assert not says or "part from there on" in texts[0]


def test_parting_time__linear_drive__is_none():
    r, _ = arm(0.0)
    linear = Structure.parse("one_mass+viscous+ground_spring")
    assert parting_time(linear, {"J1": J, "f_v": 0.01, "c_g": 1.0}, r, SETTINGS) is None


def test_parting_time__measured_pendulum__is_where_the_prediction_ends(measured):
    """Parameters from four seconds of the other record; no model holds an arm upright for long."""
    r = read_recording(measured("pendulum/energy_shaping.csv"), input="torque", outputs=["position"], time="time")
    structure = Structure.parse("one_mass+coulomb+viscous+gravity+pendulum")
    values = {"J1": 0.1809, "M_C": 0.18, "f_v": 0.0089, "M_G": 0.005, "G": 3.53, "k": 1.0, "phi_0": 0.0143}
    settings = Settings(1.0 / 0.43, 10.0)
    y, simulated = r.y[0], predict(structure, values, r, settings)[0]
    time = parting_time(structure, values, r, settings)

    def fit_until(seconds):
        part = r.t - r.t[0] <= seconds
        return 1.0 - np.linalg.norm((y - simulated)[part]) / np.linalg.norm(y[part] - y[part].mean())

    assert time is not None
    assert fit_until(2.0) >= 0.9
    assert fit_until(0.9 * time) >= 0.9
    assert fit_until(time + 2.0) <= 0.5
