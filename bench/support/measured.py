"""Measured recordings: the EMPS axis and the drive MTE360, from ../shared/data or the folder BRIGHTGREY_DATA."""

from __future__ import annotations

import os
from pathlib import Path

from brightgrey import Recording, read_recording

__all__ = ["DATA", "emps_recording", "kuka_recording", "mte360_recording", "pendulum_recordings", "two_mass_recordings"]

DATA = Path(os.environ.get("BRIGHTGREY_DATA", Path(__file__).parents[3] / "shared" / "data"))


def mte360_recording(name: str, column: str) -> Recording:
    """One of the MTE360 recordings."""
    return read_recording(
        DATA / "mte360" / f"{name}.mat",
        input="u",
        outputs=[f"{column}:velocity-differenced"],
        time="t",
        units={"u": "V", column: "mm/s"},
    )


def two_mass_recordings() -> dict[str, Recording]:
    """The MTE360 recordings of the drive with a second cart."""
    names = {"square": "1_5", "sine 1 Hz": "sine_1", "sine 3 Hz": "sine_3"}
    return {name: mte360_recording(f"velocity_response_{file}", "v1") for name, file in names.items()}


def emps_recording() -> Recording:
    """Position of the EMPS from its force."""
    return read_recording(
        DATA / "emps" / "DATA_EMPS.mat",
        input="vir",
        outputs=["qm:position"],
        time="t",
        input_gain=35.15065,
        units={"vir": "N", "qm": "m"},
    )


def kuka_recording(axis: int) -> Recording:
    """Axis 2 or 3 of a KUKA KR300, the position on the link side."""
    return read_recording(
        DATA / "kuka" / f"axis{axis}_FF_A.csv",
        input="motor_torque_Nm",
        outputs=["position_deg:position"],
        time="time_s",
        units={"motor_torque_Nm": "N m", "position_deg": "deg"},
    )


def pendulum_recordings() -> dict[str, Recording]:
    """Records of the torque-limited pendulum, the motor's position as output."""
    names = ("system_identification", "energy_shaping", "sac_with_hole")
    return {name: _pendulum(name) for name in names}


def _pendulum(name: str) -> Recording:
    return read_recording(
        DATA / "pendulum" / f"{name}.csv",
        input="torque",
        outputs=["position:position"],
        time="time",
        units={"torque": "N m", "position": "rad"},
    )
