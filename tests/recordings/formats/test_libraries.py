"""Formats that libraries of others read, each written here by its own library; and what a damaged file does."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording
from brightgrey.recordings.file import open_table
from brightgrey.recordings.formats import child_process
from brightgrey.recordings.formats.child_process import Library, read_in_child

N = 60
T = np.arange(N) * 1e-3
U = np.sin(np.arange(N))
V = np.cumsum(U)


def test_read_hdf5__matlab_7_3__has_vectors_matrices_and_structs(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.bin"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": T[None], "log/u": U[None], "data": np.stack([U, V])}.items():
            file[name] = values  # MATLAB writes column by column
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["text"] = np.array([[97, 98]], np.uint16)
        file["text"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
    recording = read_recording(path, input="log.u", outputs="data(:,2):velocity", time="t")
    np.testing.assert_array_equal(recording.u, U)
    np.testing.assert_array_equal(recording.y[0], V)
    table, title = open_table(path)
    assert title == "MATLAB 7.3 and HDF5"
    assert table.unread == "not vectors: text"


def test_read_tdms__waveforms_of_two_rates__have_their_own_time(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "run"
    slow = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "unit_string": "rad/s"}
    fast = {"wf_increment": 5e-4, "wf_start_offset": 0.0, "unit_string": "Nm"}
    u = np.repeat(U, 2)
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("axis", "speed", V, properties=slow),
                nptdms.ChannelObject("axis", "torque", u, properties=fast),
            ]
        )
    recording = read_recording(path, input="torque", outputs="speed", hold="zoh")
    np.testing.assert_array_equal(recording.y[0], V)
    np.testing.assert_allclose(recording.u, U, atol=1e-12)
    assert (recording.dt, recording.input.unit) == (1e-3, "N m")
    assert any("'torque', sampled every 0.0005 s, is averaged at the 0.001 s" in note for note in recording.notes)


def test_read_tdms__file_that_is_cut_off__is_read_with_the_remark_of_the_library(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "run"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("axis", "speed", V)])
    path.write_bytes(path.read_bytes()[:-80])
    table, _ = open_table(path)
    assert table.rows.size == N - 10
    assert "nptdms remarks: Last segment of file has less data than expected" in table.notes[0]


def test_read_mdf__groups_with_their_masters__are_put_onto_one_clock(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "run.mf4"
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(V, T, unit="rad/s", name="speed")])
        file.append([asammdf.Signal(np.interp(T[::2], T, T), T[::2], unit="Nm", name="torque")])
        file.save(path)
    recording = read_recording(path, input="torque", outputs="speed")
    np.testing.assert_array_equal(recording.y[0], V[: recording.samples])
    np.testing.assert_allclose(recording.u, recording.t, atol=1e-12)
    assert recording.samples == N - 1  # the torque ends one sample earlier
    assert any("'torque', sampled every 0.002 s, is interpolated" in note for note in recording.notes)


@pytest.mark.parametrize("name", ["raw1.tdms", "Digital_Input.tdms", "test_batch.mf4"])
def test_read_library__file_of_its_own_tests__has_channels_with_time(
    measured: Callable[[str], Path], name: str
) -> None:
    pytest.importorskip("nptdms" if name.endswith("tdms") else "asammdf")
    table, _ = open_table(measured(f"formats/{name}"))
    assert all(column.clock is not None for column in table.columns if column.name)


def test_read_in_child__library_missing__names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.tdms"
    path.write_bytes(b"TDSm" + bytes(100))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RecordingError, match=r"read by npTDMS, .* pip install 'brightgrey\[formats-lgpl\]'"):
        read_recording(path, input="u", outputs="v")


CRASHES = {
    "segmentation fault": ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "with code -11"),
    "endless loop": ("while True: pass", "takes more than 1 s"),
    "memory": ("import numpy; numpy.ones(10**10)", "takes more than 50 MB of memory|Unable to allocate"),
    "foreign error": ("raise KeyError('a\\nb\\x1b[31m')", r"may be damaged \('a"),
}


@pytest.mark.parametrize(("code", "message"), CRASHES.values(), ids=CRASHES)
def test_read_in_child__library_that_fails__is_an_error_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, message: str
) -> None:
    (tmp_path / "failing_reader.py").write_text(f"def extract(path):\n    {code.replace(chr(10), chr(10) + '    ')}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = tmp_path / "run.bin"
    path.write_bytes(b"x")
    library = Library("json", "json", seconds=1.0, least_megabytes=50)
    with pytest.raises(RecordingError, match=message) as error:
        read_in_child("failing_reader", library, path)
    assert str(error.value).isprintable()


@pytest.mark.skipif(os.name != "posix", reason="limits of a process are those of POSIX")
def test_library__limits__leave_room_for_a_file() -> None:
    for name in ("mat", "hdf5", "tdms", "mdf4"):
        module = importlib.import_module(f"brightgrey.recordings.formats.{name}")
        assert module.LIBRARY.least_megabytes * child_process.MEGABYTE >= 1e8
