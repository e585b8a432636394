"""Columns, kinds, units and gain: options, guesses from names, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from brightgrey.errors import BrightgreyError, RecordingError, SettingsError
from brightgrey.recordings import Recording, Units, read_recording, recording_from

N = 40
T = 0.01 * np.arange(N)
U = np.sin(np.arange(N))
Q = np.cumsum(U)


def record(
    outputs: object = "v:velocity", names: tuple[str, str, str] = ("u", "v", "w"), **options: object
) -> Recording:
    columns = dict(zip(("t", *names), (T, U, Q, Q + U), strict=True))
    chosen = {"input": names[0], "outputs": outputs, **options}
    return recording_from(columns, **chosen)  # type: ignore[arg-type]


def test_recording_from__input_gain__is_applied_before_the_unit() -> None:
    recording = record(input_gain=35.15, units={"u": "kN", "v": "mm/s"})
    np.testing.assert_allclose(recording.u, 35.15e3 * U, rtol=1e-14)
    np.testing.assert_allclose(recording.y[0], 1e-3 * Q, rtol=1e-14)
    assert recording.input.gain == 35.15
    assert recording.input.factor == pytest.approx(1e-3)
    assert recording.units == Units("kN", "mm")


@pytest.mark.parametrize("gain", [0.0, np.nan, np.inf])
def test_recording_from__gain_of_zero_or_not_finite__is_refused(gain: float) -> None:
    with pytest.raises(SettingsError, match="input gain"):
        record(input_gain=gain)


def test_recording_from__negative_gain__turns_the_sign() -> None:
    np.testing.assert_array_equal(record(input_gain=-1).u, -U)


@pytest.mark.parametrize(
    ("units", "shown"),
    [
        ({}, ("N m", "rad/s", "rad")),
        ({"v": "mm/s"}, ("N", "mm/s", "m")),
        ({"w": "µm"}, ("N", "m/s", "µm")),
        ({"u": "N"}, ("N", "m/s", "m")),
        ({"u": "V"}, ("V", "rad/s", "rad")),
        ({"v": "rpm"}, ("N m", "rpm", "rad")),
        ({"u": "N", "v": "rpm"}, ("N", "rpm", "rad")),
    ],
)
def test_recording_from__missing_units__are_assumed_with_a_note(
    units: dict[str, str], shown: tuple[str, str, str]
) -> None:
    recording = record(["v:velocity", "w:position"], units=units)
    signals = (recording.input, *recording.outputs)
    assert tuple(s.unit for s in signals) == shown
    assert [s.name for s in signals if s.unit_given] == [name for name in ("u", "v", "w") if name in units]
    note = next(note for note in recording.notes if "no unit is given" in note)
    for signal in signals:
        assert (f"'{signal.name}' in {signal.unit}" in note) == (not signal.unit_given)


def test_recording_from__name_ends_in_another_unit__is_noted() -> None:
    names = ("torque_mNm", "speed_deg_per_s", "position_mm")
    recording = record(["speed_deg_per_s:velocity"], names)
    note = next(note for note in recording.notes if "no unit is given" in note)
    assert "torque_mNm=mN m" in note
    assert "speed_deg_per_s=deg/s" in note
    assert recording.outputs[0].unit == "rad/s"


@pytest.mark.parametrize(
    ("output", "units", "kind"),
    [
        ("v", {"v": "rad"}, "position"),
        ("v", {"v": "mm/s"}, "velocity"),
        ("v", {"v": "m/s²"}, "acceleration"),
        ("v", {}, "velocity"),
        (("v", "acceleration"), {}, "acceleration"),
        ("v:velocity-differenced", {}, "velocity-differenced"),
    ],
)
def test_recording_from__kind__is_given_or_follows_from_the_unit(
    output: object, units: dict[str, str], kind: str
) -> None:
    recording = record([output], units=units)
    assert recording.outputs[0].kind == kind
    assert any("is taken as" in note for note in recording.notes) == (output == "v" and not units)


@pytest.mark.parametrize(
    ("name", "kind"), [("axis_pos", "position"), ("motorSpeed", "velocity"), ("Acceleration", "acceleration")]
)
def test_recording_from__kind_by_name__is_noted(name: str, kind: str) -> None:
    recording = record(name, ("u", name, "w"))
    assert recording.outputs[0].kind == kind
    assert f"output '{name}' is taken as {kind}, by its name" in recording.notes


def test_recording_from__colon_in_a_column_name__is_no_kind() -> None:
    recording = record(["axis: speed:velocity"], ("u", "axis: speed", "axis:position"))
    assert recording.outputs[0].name == "axis: speed"
    assert record("axis:position", ("u", "axis: speed", "axis:position")).outputs[0].name == "axis:position"


REFUSED = {
    "kind": ({"outputs": "v:velocty"}, "unknown kind of output 'velocty'. Did you mean 'velocity'?"),
    "kind of a pair": ({"outputs": [("v", "pace")]}, "unknown kind of output 'pace'"),
    "mass": ({"outputs": "v:velocity@0"}, "'0' is no mass, counted from the motor"),
    "input": ({"input": "uu"}, "recording: unknown column 'uu'. Did you mean 'u'? Columns: t, u, v, w"),
    "output": ({"outputs": "x:velocity"}, "unknown column 'x'"),
    "time": ({"time": "T"}, "unknown column 'T'. Did you mean 't'?"),
    "no output": ({"outputs": []}, "no output is named"),
    "twice": ({"outputs": ["v:velocity", "v:position"]}, "column 'v' is named twice"),
    "input as output": ({"outputs": ["u:velocity"]}, "column 'u' is named twice"),
    "time as input": ({"input": "t", "time": "t"}, "column 't' is named twice"),
    "unit": ({"units": {"v": "mm/sek"}}, "unknown unit 'sek' in 'mm/sek'"),
    "column of a unit": ({"units": {"vv": "mm/s"}}, "unknown column 'vv'. Did you mean 'v'?"),
    "unit for its kind": ({"units": {"v": "rad"}}, "unit 'rad' does not fit an output of kind velocity"),
    "frequency": ({"units": {"v": "1/s"}}, "an angle or a length per time, e.g. rad/s"),
    "angle and length": (
        {"outputs": ["v:velocity", "w:position"], "units": {"v": "rad/s", "w": "mm"}},
        "'v' is an angle and 'w' a length",
    ),
    "hold": ({"hold": "zero"}, "unknown hold 'zero'"),
    "decimate": ({"decimate": 0}, "decimate is 0; expected: a whole number from 1"),
    "half": ({"decimate": 1.5}, "decimate is 1.5; expected: a whole number from 1"),
    "window": ({"window": (2, 1)}, "window 2:1 does not start before it ends"),
}


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_recording_from__wrong_option__is_refused_in_one_line(options: dict[str, object], message: str) -> None:
    with pytest.raises(BrightgreyError) as error:
        record(**options)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_recording_from__unused_unit_or_motion_as_input__is_noted() -> None:
    assert any("unit of 'w' is not used" in note for note in record(units={"w": "mm"}).notes)
    note = "input 'u' in rad/s is a motion; models expect a torque, force, voltage or current"
    assert note in record(units={"u": "rad/s"}).notes


@pytest.mark.parametrize("bad", [np.zeros((N, 2)), ["a"] * N, None, np.zeros(N - 1)])
def test_recording_from__arrays_that_are_no_columns__are_refused(bad: object) -> None:
    with pytest.raises(RecordingError, match=r"recording: column"):
        recording_from({"t": T, "u": U, "v": bad}, input="u", outputs="v:velocity")


CONTRADICTIONS = {
    "kind by the unit": (
        {"outputs": "velocity", "units": {"velocity": "deg"}},
        "output 'velocity' is read as position, though its name says velocity",
    ),
    "unit of the file": (
        {"outputs": "omega [deg/s]:velocity", "units": {"omega [deg/s]": "rad/s"}},
        "'omega [deg/s]' is in deg/s by the file, and is read in rad/s as given",
    ),
    "power": (
        {"outputs": "velocity:velocity", "units": {"u": "W"}},
        "input 'u' in W is a power; models expect a torque, force, voltage or current",
    ),
}


@pytest.mark.parametrize(("options", "note"), CONTRADICTIONS.values(), ids=CONTRADICTIONS)
def test_read_recording__units_that_contradict__are_noted(tmp_path, options: dict[str, object], note: str) -> None:
    path = tmp_path / "run.csv"
    table = np.column_stack([T, U, Q, Q])
    np.savetxt(path, table, delimiter=",", header="t [s],u,velocity,omega [deg/s]", comments="")
    assert note in read_recording(path, input="u", **options).notes  # type: ignore[arg-type]


def test_recording_from__time_as_input__asks_for_another_time() -> None:
    columns = {"t": T, "u": U, "v": Q}
    with pytest.raises(RecordingError, match="column 't' is input or output here, and no other one is the time"):
        recording_from(columns, input="t", outputs="v:velocity")
