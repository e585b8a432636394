"""Units of drives: parts of a rated value, increments, gear ratios, and a torque from its current."""

from __future__ import annotations

import numpy as np
import pytest

from brightgrey.errors import BrightgreyError, RecordingError, SettingsError
from brightgrey.recordings import Recording, recording_from
from brightgrey.recordings.units.signals import KINDS

N = 40
U = np.sin(np.arange(N))
V = np.cumsum(U)


def record(output: str = "y:velocity", **options: object) -> Recording:
    columns = {"t": 0.001 * np.arange(N), "u": U, "y": V}
    return recording_from(columns, input="u", outputs=output, **options)  # type: ignore[arg-type]


def test_rated__percent_of_torque_and_speed__are_units() -> None:
    recording = record(units={"u": "%", "y": "%"}, rated={"torque": "9.84 mN m", "y": "3000 rpm"})
    np.testing.assert_allclose(recording.u, U * 9.84e-5, rtol=1e-12)
    np.testing.assert_allclose(recording.y[0], V * 100 * np.pi / 100, rtol=1e-12)
    assert [signal.unit for signal in (recording.input, *recording.outputs)] == ["mN m", "rpm"]


@pytest.mark.parametrize(
    ("kind", "unit", "factor"), [("position", "inc", 1.0), ("velocity", "inc/ms", 1e3), ("position", "", 1.0)]
)
def test_counts__increments__are_turns(kind: str, unit: str, factor: float) -> None:
    units = {"y": unit} if unit else {}
    recording = record(f"y:{kind}", units=units, counts={"y": 4096})
    np.testing.assert_allclose(recording.y[0], V * factor * 2 * np.pi / 4096, rtol=1e-12)
    assert recording.resolution[0] < 1.0


@pytest.mark.parametrize("kind", [kind for kind in KINDS if "velocity" in kind or kind == "speed"])
def test_rated__percent_of_any_speed__is_a_speed(kind: str) -> None:
    assert record(f"y:{kind}", units={"y": "%"}, rated={"speed": "3000 rpm"}).outputs[0].unit == "rpm"


def test_gear__angle_at_the_load__is_one_at_the_motor() -> None:
    recording = record("y:position", units={"y": "deg"}, gear={"y": -120.5})
    np.testing.assert_allclose(recording.y[0], np.deg2rad(-120.5 * V), rtol=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [({}, 1.0), ({"u": "mA"}, 1e-3)])
def test_torque_constant__current__is_a_torque(unit: dict[str, str], factor: float) -> None:
    recording = record(units=unit, torque_constant="50 mN m/A")
    np.testing.assert_allclose(recording.u, U * 0.05 * factor, rtol=1e-12)
    assert recording.input.unit == "N m"


MISSING = {
    "output in %": ({"units": {"y": "%"}}, "it is in % of a rated value; say what 100 % are: --rated 'y=3000 rpm'"),
    "increments": ({"output": "y:position", "units": {"y": "inc"}}, "how many make a turn: --counts 'y=4096'"),
}


@pytest.mark.parametrize(("options", "message"), MISSING.values(), ids=MISSING)
def test_drive_scales__value_missing__is_asked_for_by_its_option(options: dict[str, object], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        record(**options)  # type: ignore[arg-type]


WRONG = {
    "no unit": ({"rated": {"torque": "9.84"}}, r"rated torque '9\.84': expected a number and a unit"),
    "no number": ({"rated": {"torque": "N m"}}, "expected a number and a unit"),
    "per cent of per cent": ({"rated": {"torque": "100 %"}}, "say what 100 % are in a unit"),
    "unknown unit": ({"rated": {"torque": "9.84 Nmx"}}, "rated torque '9.84 Nmx': unknown unit"),
    "negative": ({"rated": {"torque": "-1 N m"}}, "is not positive"),
    "other quantity": (
        {"units": {"u": "%"}, "rated": {"torque": "9.84 V"}},
        r"rated torque '9\.84 V': a torque is in N m or N",
    ),
    "unknown name": ({"rated": {"torqe": "1 N m"}}, r"'torqe' is neither a column nor .* Did you mean 'torque'\?"),
    "no percent": ({"units": {"u": "A"}, "rated": {"u": "1 N m"}}, "its unit is A and not %"),
    "counts of the input": ({"counts": {"u": 4096}}, "it is the input and no motion"),
    "counts of an angle": ({"units": {"y": "rad/s"}, "counts": {"y": 4096}}, "but its unit is rad/s"),
    "no counts": ({"counts": {"y": 0.0}}, "counts per turn y 0 is not a positive number"),
    "no ratio": ({"gear": {"y": 0.0}}, "gear ratio y 0 is not"),
    "constant of a torque": ({"units": {"u": "N m"}, "torque_constant": "1 N m/A"}, "is in N m and not in A"),
    "constant alone": ({"torque_constant": "0.05"}, "expected a number and a unit, like 0.05 N m/A"),
    "column after its unit": ({"units": {"rpm": "y"}}, "the column comes first, write 'y=rpm'"),
    "constant in volts": ({"torque_constant": "1 V"}, "no torque or force per current"),
}


@pytest.mark.parametrize(("options", "message"), WRONG.values(), ids=WRONG)
def test_drive_scales__value_that_does_not_fit__is_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(BrightgreyError, match=message) as error:
        record(**options)  # type: ignore[arg-type]
    assert isinstance(error.value, RecordingError | SettingsError)


def test_torque_constant__name_of_the_input_says_a_torque__is_refused() -> None:
    columns = {"t": 0.001 * np.arange(N), "M_Nm": U, "y": V}
    with pytest.raises(RecordingError, match="the name of 'M_Nm' says N m: give its unit"):
        recording_from(columns, input="M_Nm", outputs="y", torque_constant="0.05 N m/A")
    given = recording_from(columns, input="M_Nm", outputs="y", torque_constant="0.05 N m/A", units={"M_Nm": "A"})
    np.testing.assert_allclose(given.u, 0.05 * U, rtol=1e-12)


def test_drive_scales__number_of_a_column__stands_for_its_name() -> None:
    recording = record("y:position", units={"u": "%"}, rated={"2": "8 N m"}, counts={"3": 4096}, gear={"3": 2.0})
    np.testing.assert_allclose(recording.u, 0.08 * U, rtol=1e-12)
    np.testing.assert_allclose(recording.y[0], 2.0 * V * 2 * np.pi / 4096, rtol=1e-12)


def test_rated__thousandths__are_of_the_rated_value() -> None:
    recording = record(units={"u": "0.1%"}, rated={"torque": "8 N m"})
    np.testing.assert_allclose(recording.u, 0.008 * U, rtol=1e-12)
