"""Sampling intervals that a line above the numbers states: used where they are clear, asked for where not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording
from support.drive_texts import HEADER, V, comma, same, write

STATED = {
    "interval": ["Device: A1", "Sample interval: 0.002 s", "Samples: 60"],
    "interval in its brackets": ["Sampling time [ms] = 2"],
    "rate": ["SampleRate;500 Hz"],
    "rate of a scope": ["Sample Rate: 0.5 kS/s (recorded)"],
    "comment": ["# sampling period: 2ms"],
    "German": ["Abtastzeit: 2,0 ms"],
}


@pytest.mark.parametrize("head", STATED.values(), ids=STATED)
def test_read_recording__interval_above_the_numbers__is_used_and_noted(tmp_path: Path, head: list[str]) -> None:
    german = "Abtast" in head[0]
    path = write(
        tmp_path, [*head, "torque [Nm];speed [rpm]"], lambda t, u, v: f"{comma(u)};{comma(v)}" if german else f"{u};{v}"
    )
    recording = same(path)
    assert any("gives the sampling interval of 0.002 s" in note for note in recording.notes)


def test_read_recording__interval_given__goes_before_that_of_the_file(tmp_path: Path) -> None:
    path = write(tmp_path, [*STATED["rate"], "torque [Nm];speed [rpm]"], lambda t, u, v: f"{u};{v}")
    recording = read_recording(path, input="torque", outputs="speed:velocity", dt=1e-3)
    assert recording.dt == 1e-3
    assert "the interval is given, that of the file is not used" in recording.notes


@pytest.mark.parametrize(
    "head",
    [["Sample interval: 0.002"], ["Sampling rate: 500 Hz", "Scan rate: 1 kHz"], ["Sample time: 0 s"], ["Sampling: on"]],
)
def test_read_recording__interval_without_unit_or_certainty__is_asked_for(tmp_path: Path, head: list[str]) -> None:
    path = write(tmp_path, [*head, "torque [Nm];speed [rpm]"], lambda t, u, v: f"{u};{v}")
    with pytest.raises(RecordingError, match="give the interval by --dt"):
        read_recording(path, input="torque", outputs="speed:velocity")


def test_read_recording__interval_beside_a_time__is_not_used(tmp_path: Path) -> None:
    same(write(tmp_path, ["Sample rate: 1 Hz", HEADER], lambda t, u, v: f"{t:.3f};{u};{v}"))


def test_read_recording__interval_beside_times_of_channels__is_not_used(tmp_path: Path) -> None:
    head = ["Sample rate: 1 Hz", "t_torque;torque [Nm];t_speed;speed [rpm]"]
    same(write(tmp_path, head, lambda t, u, v: f"{t:.3f};{u};{t:.3f};{v}"))


@pytest.mark.parametrize("step", [1.0, 0.01])
def test_read_recording__interval_beside_a_first_column_that_rises__only_if_it_counts(
    tmp_path: Path, step: float
) -> None:
    head = ["Sample rate: 500 Hz", "n;torque [Nm];speed [rpm]"]
    path = write(tmp_path, head, lambda t, u, v: f"{step * round(t / 2e-3):g};{u};{v}")
    if step == 1.0:
        same(path)
    else:
        with pytest.raises(RecordingError, match="give the interval by --dt"):
            read_recording(path, input="torque", outputs="speed:velocity")


@pytest.mark.parametrize(
    "head",
    [
        ["Recording time: 10 s"],
        ["Trace time: 5 s"],
        ["Sample time: 10 s"],
        ["Sample interval: 1e12 s"],
        ["Sample rate: 1e-320 Hz"],
        ["Abtastrate: 10.000 Hz"],
        ["Sampling rate: 1,000 Hz"],
        ["Recording rate: 10 kHz", "Decimation: 10"],
    ],
)
def test_read_recording__duration_or_doubtful_interval__is_asked_for(tmp_path: Path, head: list[str]) -> None:
    path = write(tmp_path, [*head, "torque [Nm];speed [rpm]"], lambda t, u, v: f"{comma(u)};{comma(v)}")
    with pytest.raises(RecordingError, match="give the interval by --dt"):
        read_recording(path, input="torque", outputs="speed:velocity")


def test_read_recording__file_beside_that_states_its_interval__keeps_it(tmp_path: Path) -> None:
    first = write(tmp_path, ["time [s];torque [Nm]"], lambda t, u, v: f"{t:.3f};{u}").rename(tmp_path / "a.csv")
    second = write(tmp_path, ["Sample rate: 500 Hz", "speed [rpm];A"], lambda t, u, v: f"{v};0").rename(
        tmp_path / "b.csv"
    )
    recording = read_recording(first, beside=[second], input="torque", outputs="b.speed:velocity")
    np.testing.assert_allclose(recording.y[0], V * np.pi / 30, rtol=1e-12)
    assert recording.dt == pytest.approx(2e-3)
