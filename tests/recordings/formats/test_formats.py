"""All formats together: each file has one, by its content; and names and objects that are no recording."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from brightgrey.errors import RecordingError, SettingsError
from brightgrey.recordings import read_recording, recording_from
from brightgrey.recordings.file import open_table
from brightgrey.recordings.formats import file_formats
from brightgrey.recordings.policy import READING

N = 40
T = np.arange(N) * 1e-3
U = np.sin(np.arange(N))
DATA = Path(__file__).parents[1] / "data"
SAMPLES = {
    "twincat": (DATA / "twincat" / "default.csv").read_bytes(),
    "epos": (DATA / "epos" / "start_stop.csv").read_bytes(),
    "matlab 5": b"MATLAB 5.0 MAT-file, Platform: PCWIN64" + bytes(200),
    "matlab 4": np.array([0, N, 1, 0, 2], "<i4").tobytes() + b"u\x00" + bytes(8 * N),
    "matlab 7.3": b"MATLAB 7.3 MAT-file" + bytes(493) + b"\x89HDF\r\n\x1a\n",
    "hdf5": b"\x89HDF\r\n\x1a\n" + bytes(100),
    "tdms": b"TDSm" + bytes(100),
    "mdf": b"MDF     4.10    " + bytes(100),
}
NEITHER = {
    "text": b"t,torque,velocity\n0,1,2\n",
    "names": b"Name,Value,t\n1,2,3\n",
    "nothing": b"",
    "zeros": bytes(100),
    "workbook": b"PK\x03\x04" + bytes(100),
}


@pytest.mark.parametrize("start", SAMPLES.values(), ids=SAMPLES)
def test_file_formats__file_of_one_format__is_recognised_by_that_alone(start: bytes) -> None:
    assert sum(known.recognises(start[: READING.first_bytes]) for known in file_formats()) == 1


@pytest.mark.parametrize("start", NEITHER.values(), ids=NEITHER)
def test_file_formats__other_file__is_recognised_by_none(start: bytes) -> None:
    assert not any(known.recognises(start) for known in file_formats())


def test_open_table__name_that_is_no_utf_8__is_escaped(tmp_path: Path) -> None:
    path = os.fsencode(tmp_path) + b"/run_\xff.csv"
    try:
        with open(path, "w") as file:  # noqa: PTH123
            file.write("t,u,v\n" + "".join(f"{t},{u},{u}\n" for t, u in zip(T, U, strict=True)))
    except OSError:
        pytest.skip("this file system takes UTF-8 only")
    recording = read_recording(os.fsdecode(path), input="u", outputs="v")
    assert recording.name == r"run_\udcff.csv"
    assert recording.name.encode()


def test_read_mat__cells_and_sparse_matrices_beside_the_data__are_named_and_left(tmp_path: Path) -> None:
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = {"a": 1.0}, {"b": np.arange(3.0)}
    path = tmp_path / "run.mat"
    content = {"t": T, "u": U, "v": U, "cells": cells, "sparse": scipy.sparse.csc_array((10_000, 10_000))}
    scipy.io.savemat(path, content)
    table, _ = open_table(path)
    assert {"t", "u", "v"} <= {column.name for column in table.columns}
    assert "sparse" in table.unread
    assert read_recording(path, input="u", outputs="v").samples == N


@pytest.mark.parametrize("size", [10**7, 10**9])
def test_read_mat__size_that_is_a_lie__is_refused(tmp_path: Path, size: int) -> None:
    path = tmp_path / "run.mat"
    path.write_bytes(np.array([0, size, 1, 0, 2], "<i4").tobytes() + b"u\x00" + bytes(8 * N))
    with pytest.raises(RecordingError, match="scipy cannot read the file, it may be damaged"):
        read_recording(path, input="u", outputs="u")


def test_recording_from__complex_numbers__are_refused() -> None:
    with pytest.raises(RecordingError, match="column 'u': real numbers are expected"):
        recording_from({"t": T, "u": U * 1j, "v": U}, input="u", outputs="v")


@pytest.mark.parametrize("window", [(1,), (1, 2, 3), "ab", (0, "end")])
def test_recording_from__window_that_is_no_pair__is_refused(window: object) -> None:
    with pytest.raises(SettingsError, match="is no pair of start and end"):
        recording_from({"t": T, "u": U, "v": U}, input="u", outputs="v", window=window)  # type: ignore[arg-type]


@pytest.mark.parametrize("decimate", [np.inf, np.nan, 1.5, 0, True])
def test_recording_from__decimation_by_no_whole_number__is_refused(decimate: float) -> None:
    with pytest.raises(SettingsError, match="whole number from 1"):
        recording_from({"t": T, "u": U, "v": U}, input="u", outputs="v", decimate=decimate)  # type: ignore[arg-type]


def test_read_recording__header_that_is_no_answer__is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,u,v\n0,1,2\n")
    with pytest.raises(SettingsError, match="header is 't,u,v'; expected: True or False"):
        read_recording(path, input="u", outputs="v", header="t,u,v")  # type: ignore[arg-type]


def test_recording_from__gain_beyond_all_numbers__is_refused_without_a_warning() -> None:
    with pytest.raises(RecordingError, match="a number is not finite"):
        recording_from({"t": T, "u": 1e3 * U, "v": U}, input="u", outputs="v", input_gain=1e308)


def test_recording_from__many_samples__suggest_decimation() -> None:
    k = np.arange(60_000)
    columns = {"t": k * 1e-4, "u": np.sin(k / 100), "v": np.cos(k / 100)}
    notes = recording_from(columns, input="u", outputs="v:velocity").notes
    assert "60000 samples make an identification slow; decimate by 3 keeps 20000 of them" in notes
    assert not any("slow" in note for note in recording_from(columns, input="u", outputs="v", decimate=3).notes)
