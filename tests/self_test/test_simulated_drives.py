"""Drives that a self-test simulates, and what their sensors give."""

import numpy as np
import pytest

from brightgrey.api.to_si import identification_task
from brightgrey.estimation.noise.autoregression import Autoregression
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.self_test.sensor_noise import SensorNoise
from brightgrey.self_test.simulated_drives import measured, simulated_drives
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

STRUCTURE = PAPER.parse("two_mass+coulomb+viscous")
VALUES = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "M_C": 0.9, "f_v": 0.015, "friction_width": 1.0 / E.f_tanh}


@pytest.fixture(scope="module")
def task():
    u = E.torque()
    (v,) = reference(str(STRUCTURE), {n: VALUES[n] for n in STRUCTURE.parameters}, u, E.dt, f_tanh=E.f_tanh)
    return identification_task([make_recording(u, v, dt=E.dt)], None, {}, {}, None)


def test_simulated_drives__found_rival_and_effects__each_has_its_structure_and_size(task):
    rival = PAPER.parse("one_mass+coulomb"), {"J1": 0.02, "M_C": 1.0}
    drives = simulated_drives(task, [(STRUCTURE, VALUES), rival], ["gravity", "three_mass", "delay"])
    kinds = [(variants[0].kind, str(variants[0].structure)) for variants in drives]
    assert kinds == [
        ("found", "two_mass+coulomb+viscous"),
        ("equivalent", "one_mass+coulomb"),
        ("with effect", "two_mass+coulomb+viscous+gravity"),
        ("with effect", "three_mass+coulomb+viscous"),
        ("with effect", "two_mass+coulomb+viscous+delay"),
    ]
    gravity, mass = drives[2], drives[3]
    assert [d.values["M_G"] for d in gravity] == pytest.approx([0.01 * task.scales.torque, -0.01 * task.scales.torque])
    assert mass[0].values["J2"] + mass[0].values["J3"] == pytest.approx(VALUES["J2"])  # the last mass is split


def test_measured__without_noise__is_the_motion_of_the_drive(task):
    ((drive,),) = simulated_drives(task, [(STRUCTURE, VALUES)], [])
    exact = SensorNoise(Autoregression((1.0,), 0.0), 1e-9, 0.0, differenced=False)
    (made,) = measured(task, drive, [exact], np.random.default_rng(0))
    (recording,) = task.recordings
    # The accurate level is within 9e-5 of the peak of the reference solver (docs/validation/accuracy.md).
    assert np.abs(made.y - recording.y).max() < 1e-4 * np.abs(recording.y).max()
    assert np.array_equal(made.u, recording.u)
    assert made.resolution == recording.resolution
