"""Channels of one recording in several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording
from brightgrey.recordings.read import read_again
from brightgrey.recordings.recording_toml import read_recordings, write_fixed

N = 100
T = 0.001 * np.arange(N)
U = np.sin(0.1 * np.arange(N))
V = np.cos(0.1 * np.arange(N))


def written(folder: Path, name: str, **columns: np.ndarray) -> Path:
    path = folder / name
    rows = [",".join(f"{value:.17g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([",".join(columns), *rows]))
    return path


def test_beside__no_time__has_the_rows_of_the_first_file(tmp_path: Path) -> None:
    current = written(tmp_path, "current.csv", joint_1=U, joint_2=V)
    position = written(tmp_path, "position.csv", joint_1=V, joint_2=U)
    recording = read_recording(
        current, beside=[position], input="joint_1", outputs="position.joint_1:position", dt=0.001
    )
    np.testing.assert_array_equal(recording.u, U)
    np.testing.assert_array_equal(recording.y[0], V)
    assert recording.source is not None
    np.testing.assert_array_equal(read_again(recording.source).y, recording.y)
    written(tmp_path, "position.csv", joint_1=2 * V, joint_2=U)
    with pytest.raises(RecordingError, match="its content differs"):
        read_again(recording.source)


def test_beside__time_of_the_first_file__holds_for_all(tmp_path: Path) -> None:
    first = written(tmp_path, "a.csv", t=T, u=U)
    second = written(tmp_path, "b.csv", v=V, w=U)
    recording = read_recording(first, beside=[second], input="u", outputs="b.v:velocity")
    np.testing.assert_allclose(recording.t, T)
    np.testing.assert_array_equal(recording.y[0], V)


def test_beside__times_of_their_own__are_put_onto_one_clock(tmp_path: Path) -> None:
    first = written(tmp_path, "a.csv", t=T, u=U)
    second = written(tmp_path, "b.csv", time_ms=1e3 * T[::2] + 10.0, v=V[::2])
    recording = read_recording(first, beside=[second], input="u", outputs="b.v:velocity")
    np.testing.assert_allclose(recording.t, T[::2][: recording.samples] + 0.01, atol=1e-9)
    np.testing.assert_array_equal(recording.y[0], V[::2][: recording.samples])


def test_beside__other_number_of_rows__is_refused(tmp_path: Path) -> None:
    first = written(tmp_path, "a.csv", t=T, u=U)
    second = written(tmp_path, "b.csv", v=V[:-1], w=U[:-1])
    with pytest.raises(RecordingError, match=r"b\.csv: it has 99 rows and no time, and a\.csv 100 rows"):
        read_recording(first, beside=[second], input="u", outputs="b.v:velocity")


def test_recording_toml__beside__is_a_file_beside_it(tmp_path: Path) -> None:
    first = written(tmp_path, "a.csv", t=T, u=U)
    second = written(tmp_path, "b.csv", v=V, w=U)
    path = write_fixed([first], {"input": "u", "output": ["b.v:velocity"], "beside": [str(second)]}, {})
    assert 'beside = ["b.csv"]' in path.read_text(encoding="utf-8")
    (recording,) = read_recordings(path)
    np.testing.assert_array_equal(recording.y[0], V)
