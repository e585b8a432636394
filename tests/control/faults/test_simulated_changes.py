"""Changes of a known drive's parameters, estimated by simulation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.control.faults.simulated_changes import ParameterGroup, estimate_changes
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import Structure
from brightgrey.simulation.reference import reference
from support.drives import SETTINGS, values_of
from support.recordings import make_recording

STRUCTURE = Structure.parse("two_mass+coulomb+viscous+backlash")
TRUTH = values_of(str(STRUCTURE))
LOAD, GAP = ParameterGroup(("J2",), math.inf), ParameterGroup(("alpha",), math.inf)
MIN_CHANGE = math.log(1.1)


@pytest.fixture(scope="module")
def speed():
    return reference(STRUCTURE, TRUTH, E.torque()[::2], 2 * E.dt, f_tanh=E.f_tanh)[0]


def recording_of(speed, noise, seed=3):
    y = speed + noise * np.random.default_rng(seed).normal(size=len(speed))
    return make_recording(E.torque()[::2], y, dt=2 * E.dt, names=("torque", "velocity"), name="simulated")


def found(model, changes, recording):
    return estimate_changes(STRUCTURE, model, changes, recording, SETTINGS, min_change=MIN_CHANGE)


def test_estimate_changes__more_noise__widens_the_intervals(speed):
    model = {**TRUTH, "J2": TRUTH["J2"] / 1.3, "alpha": TRUTH["alpha"] / 2.0}
    stds = []
    for noise in (0.02, 0.1):
        out = found(model, (LOAD, GAP), recording_of(speed, noise))
        assert np.all(np.abs(out.log_factors - np.log([1.3, 2.0])) < 4.0 * out.std)
        stds.append(out.std)
    assert stds[1] / stds[0] == pytest.approx([5.0, 5.0], rel=0.5)


def test_estimate_changes__narrow_prior__holds_the_factor(speed):
    model = {**TRUTH, "f_v": TRUTH["f_v"] / 1.1}
    recording = recording_of(speed, 0.05)
    loose, tight = (found(model, (LOAD, ParameterGroup(("f_v",), std)), recording) for std in (0.1, 1e-4))
    assert loose.log_factors[1] == pytest.approx(math.log(1.1), abs=4.0 * loose.std[1])
    assert abs(tight.log_factors[1]) < 5e-4
    assert tight.std[1] == pytest.approx(1e-4, rel=0.1)


def test_estimate_changes__start_in_motion__fits_the_initial_state(speed):
    whole = recording_of(speed, 0.02)
    cut = slice(150, None)
    late = replace(whole, t=whole.t[cut] - whole.t[150], u=whole.u[cut], y=whole.y[:, cut])
    assert abs(late.y[0, 0]) > 0.1 * np.abs(late.y).max()
    out = found({**TRUTH, "J2": TRUTH["J2"] / 1.3}, (LOAD, GAP), late)
    assert np.all(np.abs(out.log_factors - np.log([1.3, 1.0])) < 4.0 * out.std)
    assert out.std[0] < 0.05
