"""MATLAB files: vectors, matrices, structs; and those that cannot be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording

N = 50
T = np.arange(N) * 1e-3
U = np.sin(np.arange(N))
V = np.cumsum(U)


def save(folder: Path, **variables: object) -> Path:
    path = folder / "run.mat"
    scipy.io.savemat(path, variables, do_compression=True)
    return path


@pytest.mark.parametrize("shape", [(N,), (N, 1), (1, N)])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_read_mat__vectors__are_columns(tmp_path: Path, shape: tuple[int, ...], dtype: type) -> None:
    u, v = U.astype(dtype), V.astype(dtype)
    path = save(tmp_path, t=T.reshape(shape), u=u.reshape(shape), v=v.reshape(shape), gain=3.5, note="text")
    recording = read_recording(path, input="u", outputs="v:velocity")
    np.testing.assert_array_equal(recording.u, u)
    np.testing.assert_array_equal(recording.y, [v])
    assert recording.dt == 1e-3
    assert recording.name == "run.mat"


def test_read_mat__whole_numbers_and_old_format__are_read(tmp_path: Path) -> None:
    path = tmp_path / "old.mat"
    counts = np.arange(N, dtype=np.int16)
    scipy.io.savemat(path, {"t": T, "u": U, "q": counts}, format="4")
    recording = read_recording(path, input="u", outputs="q:position")
    np.testing.assert_array_equal(recording.y, [counts])


def test_read_mat__matrices_and_structs__have_columns_by_index_and_field(tmp_path: Path) -> None:
    path = save(tmp_path, data=np.column_stack([T, U, V]), log={"time": T, "axis": {"u": U, "v": V}})
    recording = read_recording(path, input="data(:,2)", outputs="data(:,3):velocity", time="data(:,1)")
    np.testing.assert_array_equal(recording.u, U)
    recording = read_recording(path, input="log.axis.u", outputs="log.axis.v:velocity", time="log.time")
    np.testing.assert_array_equal(recording.y, [V])


def test_read_mat__missing_variable__names_the_nearest_and_all_others(tmp_path: Path) -> None:
    path = save(tmp_path, t=T, vir=U, qm=V, gtau=35.15, long=np.zeros(2 * N))
    with pytest.raises(RecordingError) as error:
        read_recording(path, input="virr", outputs="qm:position")
    message = str(error.value)
    assert message.startswith("run.mat: unknown column 'virr'. Did you mean 'vir'?")
    assert "of other length: long (100 samples)" in message
    assert "not vectors: gtau" in message


def test_read_mat__vectors_of_several_lengths__the_input_decides(tmp_path: Path) -> None:
    others = {f"x{i}": np.zeros(7) for i in range(9)}
    path = save(tmp_path, t=T, u=U, v=V, **others)
    assert read_recording(path, input="u", outputs="v:velocity").samples == N


def test_read_mat__bad_value__is_named_by_row(tmp_path: Path) -> None:
    v = V.copy()
    v[10:12] = np.nan
    with pytest.raises(RecordingError, match=r"run\.mat: row 11, column 'v': no value here"):
        read_recording(save(tmp_path, t=T, u=U, v=v), input="u", outputs="v:velocity")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"MATLAB 5.0 MAT-file, Platform: PCWIN64" + b" " * 86 + b"\x00\x01IM" + b"\xff" * 64,
            "may be damaged",
        ),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600), "h5py cannot read the file, it may be damaged"),
        (b"\x89HDF\r\n\x1a\n" + bytes(600), "h5py cannot read the file, it may be damaged"),
        (b"", "the file is empty"),
    ],
)
def test_read_mat__unreadable_file__is_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "run.mat"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=message) as error:
        read_recording(path, input="u", outputs="v:velocity")
    assert "\n" not in str(error.value)
    assert str(tmp_path) not in str(error.value)


def test_read_mat__truncated_file__is_refused(tmp_path: Path) -> None:
    path = save(tmp_path, t=T, u=U, v=V)
    whole = path.read_bytes()
    for part in (0.3, 0.6, 0.95):
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(RecordingError, match=r"may be damaged|unknown column"):
            read_recording(path, input="u", outputs="v:velocity")


def test_read_mat__no_vectors__is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no vector of numbers in it; it holds a"):
        read_recording(save(tmp_path, a=1.0), input="u", outputs="v:velocity")
    with pytest.raises(RecordingError, match="no vector of numbers"):
        read_recording(save(tmp_path, z=U * 1j), input="z", outputs="z:velocity")


def test_read_recording__mat_content_with_another_suffix__is_read_as_mat(tmp_path: Path) -> None:
    path = save(tmp_path, t=T, u=U, v=V).rename(tmp_path / "run.dat")
    assert read_recording(path, input="u", outputs="v:velocity").samples == N


def test_read_mat__cells_of_unequal_arrays_and_structs_beside_the_data__are_no_columns(tmp_path: Path) -> None:
    cell = np.empty((1, 2), object)
    cell[0, 0], cell[0, 1] = {"a": 1.0}, np.zeros((0, 3))
    path = save(tmp_path, t=T, u=U, v=V, note=cell, more={"cell": cell, "text": "a", "w": V})
    recording = read_recording(path, input="u", outputs=["v", "more.w:velocity"])
    np.testing.assert_array_equal(recording.y[1], V)
