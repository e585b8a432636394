"""The real recordings come in as their description says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from brightgrey.recordings import Units, read_recording
from brightgrey.recordings.checks.checkup import check

Measured = Callable[[str], Path]


def test_read_recording__emps__has_its_documented_values(measured: Measured) -> None:
    path = measured("emps/DATA_EMPS.mat")
    raw = scipy.io.loadmat(path)
    recording = read_recording(
        path, input="vir", outputs=["qm:position"], input_gain=35.15065, units={"vir": "N", "qm": "m"}
    )
    assert (recording.samples, recording.dt, recording.t[0]) == (24841, 1e-3, 0.0)
    np.testing.assert_allclose(recording.u, 35.15065 * raw["vir"].ravel(), rtol=1e-15)
    np.testing.assert_array_equal(recording.y[0], raw["qm"].ravel())
    assert recording.resolution[0] == pytest.approx(5e-8, rel=1e-6)
    assert recording.units == Units("N", "m")
    assert recording.units.of((1, -1, 2)) == ("kg", 1.0)


@pytest.mark.parametrize("name", ["velocity_response_1_5", "velocity_response_sine_1", "velocity_response_sine_3"])
def test_read_recording__mte360_with_two_carts__has_its_documented_values(measured: Measured, name: str) -> None:
    recording = read_recording(
        measured(f"mte360/{name}.mat"),
        input="u",
        outputs=["v1:velocity-differenced", "v2:velocity-differenced"],
        units={"u": "V", "v1": "mm/s", "v2": "mm/s"},
    )
    assert (recording.samples, recording.dt) == (8001, 1e-3)
    assert recording.resolution == pytest.approx([4.6592e-3, 4.6592e-3], rel=1e-6)
    assert recording.units.of((1, -1, 2))[0] == "V s²/mm"


def test_check__mte360_single_axis__velocity_is_differenced(measured: Measured) -> None:
    path = measured("mte360/single_axis_square_1_5.mat")
    recording = read_recording(path, input="u", outputs="v", units={"u": "V", "v": "mm/s"})
    assert (recording.samples, recording.dt) == (4001, 1e-3)
    (found,) = (r for r in check(recording).results if r.check == "differenced velocity")
    assert found.grade == "mind"
    assert "steps of 4.659 mm/s" in found.figure


@pytest.mark.parametrize("name", ["axis2_FF_A", "axis3_FF_A"])
def test_read_recording__robot_axes__have_their_documented_values(measured: Measured, name: str) -> None:
    path = measured(f"kuka/{name}.csv")
    units = {"motor_torque_Nm": "N m", "position_deg": "deg", "velocity_deg_per_s": "deg/s"}
    recording = read_recording(
        path,
        input="motor_torque_Nm",
        outputs=["position_deg:position", "velocity_deg_per_s:velocity"],
        units=units,
    )
    raw = np.loadtxt(path, delimiter=",", skiprows=1)
    assert (recording.samples, recording.dt) == (2501, 4e-3)
    np.testing.assert_array_equal(recording.u, raw[:, 1])
    np.testing.assert_allclose(recording.y, np.deg2rad(raw[:, 2:].T), rtol=1e-14)
    assert recording.notes == ()
