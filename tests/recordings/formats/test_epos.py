"""Exports of maxon EPOS Studio (see data/epos/LICENSE)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording
from brightgrey.recordings.file import open_table

FILE = Path(__file__).parents[1] / "data" / "epos" / "start_stop.csv"
COLUMNS = {"input": "Torque actual value averaged", "outputs": "Velocity actual value averaged"}


def test_read_recorder_text__export__has_time_names_and_units() -> None:
    table, title = open_table(FILE)
    assert title == "maxon EPOS Studio"
    assert [(column.name, column.unit) for column in table.columns] == [
        ("time", "ms"),
        ("Velocity actual value averaged", "rpm"),
        ("Torque actual value averaged", "%"),
    ]
    assert table.notes == ()
    assert table.rows[0] == 15


def test_read_recorder_text__percent_of_rated__is_a_torque() -> None:
    raw = np.loadtxt(FILE, delimiter=";", skiprows=14)
    recording = read_recording(FILE, **COLUMNS, rated={"torque": "9.84 mN m"})
    np.testing.assert_allclose(recording.u, raw[:, 2] * 9.84e-5, rtol=1e-12)
    np.testing.assert_allclose(recording.y[0], raw[:, 1] * np.pi / 30, rtol=1e-12)
    assert (recording.samples, recording.dt, recording.input.unit) == (500, 0.04, "mN m")


def test_read_recorder_text__rated_value_missing__is_asked_for() -> None:
    recording = read_recording(FILE, **COLUMNS)
    assert any("--rated 'Torque actual value averaged=9.84 mN m'" in note for note in recording.notes)


def test_read_recorder_text__fewer_samples_than_recorded__is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cut.csv"
    path.write_text("\n".join(FILE.read_text(encoding="utf-8").splitlines()[:300]), encoding="utf-8")
    with pytest.raises(RecordingError, match="286 samples where the preamble says 500; the file seems to be cut off"):
        read_recording(path, **COLUMNS)


@pytest.mark.parametrize("name", ["drive1_start_stop_200", "drive1_steady_0.096kg_2", "drive2_start_stop_200"])
def test_read_recorder_text__whole_file__has_all_samples(measured: Callable[[str], Path], name: str) -> None:
    assert read_recording(measured(f"epos/{name}.csv"), **COLUMNS).samples == 500
