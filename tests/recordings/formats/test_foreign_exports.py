"""Files as other programs write them: oscilloscopes, ROS, LabVIEW, Simulink, spreadsheets in other languages."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from brightgrey import inspect
from brightgrey.errors import RecordingError
from brightgrey.recordings import Recording, read_recording
from brightgrey.recordings.file import open_table
from brightgrey.recordings.formats.mat import extract

N = 60
T = np.arange(N) * 1e-3
U = np.round(np.sin(np.arange(N)), 5)
V = np.round(np.cumsum(U), 5)


def write(folder: Path, head: Sequence[str], row: Callable[[int], str], end: Sequence[str] = ()) -> Path:
    path = folder / "run.csv"
    path.write_text("\n".join([*head, *map(row, range(N)), *end]) + "\n", encoding="utf-8")
    return path


def read(path: Path, **options: object) -> Recording:
    chosen = {"input": "torque", "outputs": ["velocity:velocity"], **options}
    return read_recording(path, **chosen)  # type: ignore[arg-type]


def plain(k: int) -> str:
    return f"{T[k]:.4f},{U[k]},{V[k]}"


def same(recording: Recording, dt: float = 1e-3) -> None:
    np.testing.assert_allclose(recording.u, U, rtol=1e-12)
    np.testing.assert_allclose(recording.y[0], V, rtol=1e-12)
    assert recording.dt == pytest.approx(dt, rel=1e-6)


def test_read_delimited__preamble_with_as_many_fields__names_are_those_with_a_time(tmp_path: Path) -> None:
    head = ["SCOPE,30152,Waveform", "Segments,1,SegmentSize,60", "Segment,TrigTime,TimeSinceSegment1", "#1,1-Dec,0"]
    path = write(tmp_path, [*head, "Time,torque,velocity"], plain)
    same(read(path))


@pytest.mark.parametrize(
    ("header", "units"),
    [
        ("Time in s,torque in Nm,velocity in 1/min", ("s", "Nm", "1/min")),
        ("Time {s},torque {Nm},velocity {rad/s}", ("s", "Nm", "rad/s")),
        ("Time [s],torque / Nm,velocity 1/min", ("s", "Nm", "1/min")),
    ],
)
def test_read_delimited__unit_in_words_or_braces__is_the_columns(
    tmp_path: Path, header: str, units: tuple[str, ...]
) -> None:
    table, _ = open_table(write(tmp_path, [header], plain))
    assert [column.name for column in table.columns] == ["Time", "torque", "velocity"]
    assert tuple(column.unit for column in table.columns) == units


def test_read_delimited__name_with_the_word_in__stays_whole(tmp_path: Path) -> None:
    table, _ = open_table(write(tmp_path, ["time,torque in axis,velocity"], plain))
    assert table.columns[1].name == "torque in axis"


@pytest.mark.parametrize("factor", [1.0, 1e3, 1e6, 1e9], ids=["s", "ms", "us", "ns"])
def test_read_delimited__times_since_1970__say_their_unit(tmp_path: Path, factor: float) -> None:
    head, start = ["%time,torque,velocity"], 1_700_000_000
    path = write(
        tmp_path, head, lambda k: f"{start * factor + k * 1e-3 * factor:.{4 if factor < 1e3 else 0}f},{U[k]},{V[k]}"
    )
    recording = read(path)
    same(recording)
    assert factor == 1.0 or any("its numbers count from 1970" in note for note in recording.notes)


def test_read_delimited__time_of_small_numbers__is_in_s(tmp_path: Path) -> None:
    recording = read(write(tmp_path, ["time,torque,velocity"], lambda k: f"{k},{U[k]},{V[k]}"))
    assert recording.dt == 1.0


@pytest.mark.parametrize(
    "written",
    [
        lambda at: at.strftime("%H:%M:%S.%f"),
        lambda at: f"{at:%H:%M:%S}:{at.microsecond // 1000:03d}",
        lambda at: f"{at:%m/%d/%Y %I:%M:%S}.{at.microsecond // 1000:03d} {at:%p}",
        lambda at: at.isoformat() + "+01:00",
        lambda at: at.strftime("%Y-%m-%d %H:%M:%S.%f UTC"),
    ],
    ids=["no date", "colon before ms", "AM and PM", "zone", "UTC"],
)
def test_read_delimited__clock_times_past_midnight__go_on(tmp_path: Path, written: Callable[[datetime], str]) -> None:
    start = datetime(2024, 3, 9, 23, 59, 59, 970_000)
    path = write(
        tmp_path, ["stamp;torque;velocity"], lambda k: f"{written(start + timedelta(milliseconds=k))};{U[k]};{V[k]}"
    )
    same(read(path))


def test_read_delimited__dated_time_that_falls_by_a_day__runs_backwards(tmp_path: Path) -> None:
    path = write(
        tmp_path, ["stamp,torque,velocity"], lambda k: f"2024-03-0{9 - k // 30} 12:00:00.{k:03d},{U[k]},{V[k]}"
    )
    with pytest.raises(RecordingError, match="time runs backwards"):
        read(path)


def test_read_delimited__summary_below_the_numbers__is_left_out(tmp_path: Path) -> None:
    end = ["", "Min,-1,-2", "Max,1,2", "Mean,0,0"]
    recording = read(write(tmp_path, ["time,torque,velocity"], plain, end))
    same(recording)
    assert any("rows 63, 64, 65 below the numbers are skipped" in note for note in recording.notes)


def test_read_delimited__header_again_between_the_numbers__is_left_out(tmp_path: Path) -> None:
    head = "time,torque,velocity"
    recording = read(write(tmp_path, [head], lambda k: (f"{head}\n" if k == 30 else "") + plain(k)))
    same(recording)
    assert any("row 32 repeats the header: skipped; the logger was started again" in n for n in recording.notes)
    assert not any("comment lines" in note for note in recording.notes)


def test_read_delimited__logger_begins_anew__says_to_cut_the_file(tmp_path: Path) -> None:
    head = "time,torque,velocity"
    path = write(tmp_path, [head], lambda k: f"{head}\n0,0,0" if k == 30 else plain(k))
    with pytest.raises(RecordingError, match=r"time runs backwards: 0 s after 0\.029 s; .* cut the file there"):
        read(path)


def test_read_delimited__rows_from_the_last_to_the_first__says_to_turn_them(tmp_path: Path) -> None:
    path = write(tmp_path, ["time,torque,velocity"], lambda k: plain(N - 1 - k))
    with pytest.raises(RecordingError, match=r"time runs backwards, in all rows: .* turn their order round"):
        read(path)


def test_read_delimited__time_of_whole_seconds__asks_for_the_interval(tmp_path: Path) -> None:
    path = write(tmp_path, ["time,torque,velocity"], lambda k: f"{k // 20},{U[k]},{V[k]}")
    with pytest.raises(RecordingError, match="the time is too coarse: give the interval by --dt"):
        read(path)


def test_table__part_of_a_name__is_guessed(tmp_path: Path) -> None:
    path = write(tmp_path, ["time,_to.Axis_1.actorData.torque_nominal,velocity"], plain)
    with pytest.raises(RecordingError, match=r"Did you mean '_to\.Axis_1\.actorData\.torque_nominal'"):
        read(path)


@pytest.mark.parametrize("word", ["#NV", "1.#QNAN", "-nan(ind)", "n. def.", "#DIV/0!", "Bad"])
def test_read_delimited__word_for_no_number__is_missing(tmp_path: Path, word: str) -> None:
    recording = read(
        write(tmp_path, ["time,torque,velocity"], lambda k: plain(k) if k != 9 else f"0.009,{word},{V[9]}")
    )
    assert any("'torque' has no value in row 11: interpolated" in note for note in recording.notes)


@pytest.mark.parametrize("word", ["∞", "-∞", "1.#INF"])
def test_read_delimited__word_for_infinity__is_refused_with_its_row(tmp_path: Path, word: str) -> None:
    path = write(tmp_path, ["time,torque,velocity"], lambda k: plain(k) if k != 9 else f"0.009,{word},{V[9]}")
    with pytest.raises(RecordingError, match="row 11, column 'torque': the value is infinite"):
        read(path)


def test_read_recording__sources_merged_by_time__have_a_clock_each(tmp_path: Path) -> None:
    path = write(tmp_path, ["time,torque,velocity"], lambda k: f"{T[k]:.4f},{U[k]},\n{T[k] + 4e-4:.4f},,{V[k]}")
    recording = read(path)
    assert recording.dt == pytest.approx(1e-3)
    np.testing.assert_array_equal(recording.y[0], V[: recording.samples])
    np.testing.assert_allclose(recording.u, np.interp(recording.t, T, U), atol=1e-9)
    assert inspect(path).channels[1].dt == pytest.approx(1e-3)


def test_read_recording__slow_channel_among_fast_rows__is_read_at_its_own_rate(tmp_path: Path) -> None:
    path = write(tmp_path, ["time,torque,velocity"], lambda k: f"{T[k]:.4f},{U[k]},{V[k] if k % 2 == 0 else ''}")
    recording = read(path)
    assert recording.dt == pytest.approx(2e-3)
    np.testing.assert_array_equal(recording.y[0], V[::2])


def test_inspect__count_of_samples__is_no_motion(tmp_path: Path) -> None:
    found = inspect(write(tmp_path, ["nr,time,ch1,ch2"], lambda k: f"{k},{plain(k)}"))
    assert found.meanings[0].quantity == "count"
    assert "--output nr" not in found.command


def test_inspect__text_among_numbers__names_the_row(tmp_path: Path) -> None:
    path = write(tmp_path, ["time,torque,velocity"], lambda k: plain(k) if k != 9 else f"0.009,x1,{V[9]}")
    rows = inspect(path).rows()
    assert rows[1][-1] == "row 11, column 'torque': 'x1' is not a number"


@pytest.mark.parametrize(
    ("content", "advice"),
    [
        (b"\x93NUMPY\x01\x00", "give its columns to recording_from"),
        (b"PAR1\x15\x04", "give its columns to recording_from"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "save the sheet as CSV"),
        (b"#ROSBAG V2.0\n", "export the topics as CSV"),
        (b"\x89MCAP0\r\n", "export the topics as CSV"),
        (b'{"t": 0, "torque": 1}\n', "JSON; write its samples as CSV"),
        (b'<?xml version="1.0"?>', "export the samples as CSV"),
    ],
)
def test_open_table__file_of_another_kind__says_what_to_do(tmp_path: Path, content: bytes, advice: str) -> None:
    path = tmp_path / "run"
    path.write_bytes(content + bytes(100))
    with pytest.raises(RecordingError, match=advice):
        open_table(path)


def test_open_table__numpy_archive__is_not_taken_for_a_workbook(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", t=T, u=U)
    with pytest.raises(RecordingError, match="NumPy archive; give its arrays to recording_from"):
        open_table(tmp_path / "run.npz")


def labview(columns: str, tag: Callable[[str], str], rows: list[str], names: str, mark: str = "\t") -> str:
    head = ["LabVIEW Measurement", "Writer_Version\t2", f"Separator\t{'Tab' if mark == chr(9) else 'Comma'}"]
    head += ["Decimal_Separator\t.", f"X_Columns\t{columns}", "***End_of_Header***", ""]
    tags = ["Channels\t2", tag("Y_Unit_Label\tNm\trad/s"), tag("Delta_X\t0.001\t0.001"), "***End_of_Header***"]
    return "\n".join([*head, *tags, names, *rows]).replace("\t", mark) + "\n"


LABVIEW = {
    "one": labview(
        "One", str, [f"{T[k]:.4f}\t{U[k]}\t{V[k]}\t" for k in range(N)], "X_Value\ttorque\tvelocity\tComment"
    ),
    "none": labview("No", str, [f"\t{U[k]}\t{V[k]}" for k in range(N)], "X_Value\ttorque\tvelocity\tComment"),
    "comma": labview("One", str, [f"{T[k]:.4f}\t{U[k]}\t{V[k]}" for k in range(N)], "X_Value\ttorque\tvelocity", ","),
    "multi": labview(
        "Multi",
        lambda line: line.replace("\t", "\t\t").replace("\t\t", "\t", 1),
        [f"{T[k]:.4f}\t{U[k]}\t{T[k]:.4f}\t{V[k]}" + "\tbegun" * (k == 0) for k in range(N)],
        "X_Value\ttorque\tX_Value\tvelocity\tComment",
    ),
}


@pytest.mark.parametrize("content", LABVIEW.values(), ids=LABVIEW)
def test_read_labview__times_in_any_place__are_read(tmp_path: Path, content: str) -> None:
    path = tmp_path / "run"
    path.write_text(content, encoding="utf-8")
    _, title = open_table(path)
    assert title == "LabVIEW measurement"
    recording = read_recording(path, input="torque", outputs="velocity")
    same(recording)
    assert (recording.input.unit, recording.outputs[0].unit) == ("N m", "rad/s")


def test_read_labview__second_segment__is_read_on(tmp_path: Path) -> None:
    whole = LABVIEW["one"]
    at = whole.index("Channels")
    rows = "".join(f"{T[k] + 0.06:.4f}\t{U[k]}\t{V[k]}\n" for k in range(N))
    path = tmp_path / "run"
    path.write_text(whole + "\n" + whole[at : whole.index("0.0000\t")] + rows, encoding="utf-8")
    recording = read_recording(path, input="torque", outputs="velocity")
    assert recording.samples == 2 * N
    np.testing.assert_array_equal(recording.u, np.tile(U, 2))


@pytest.mark.parametrize("cut", ["***End_of_Header***\nX_V", "0.0000\t"])
def test_read_labview__file_that_ends_early__is_refused(tmp_path: Path, cut: str) -> None:
    path = tmp_path / "run"
    path.write_text(LABVIEW["one"][: LABVIEW["one"].index(cut)], encoding="utf-8")
    with pytest.raises(RecordingError, match=r"ends before its header does|no numbers below the header"):
        open_table(path)


def test_read_numbered__oscilloscope_of_rigol__has_the_time_of_its_header(tmp_path: Path) -> None:
    head = ["X,torque,velocity,Start,Increment,", "Sequence,Volt,Volt,-5.0e-01,1.000e-03"]
    path = write(tmp_path, head, lambda k: f"{k},{U[k]},{V[k]},")
    assert open_table(path)[1] == "Rigol oscilloscope"
    recording = read(path, units={"velocity": "rad/s"})
    same(recording)
    assert (recording.t[0], recording.input.unit) == (-0.5, "V")


@pytest.mark.parametrize("unit", ["s", ""])
def test_read_numbered__step_in_the_line_of_names__gives_the_time(tmp_path: Path, unit: str) -> None:
    head = f"CH1V,CH2V,t0 =-5.000000e-02{unit}, tInc = 1.000000e-03{unit},"
    path = write(tmp_path, [head], lambda k: f"{U[k]},{V[k]},,")
    recording = read(path, input="CH1", outputs="CH2V:velocity", units={"CH1": "N m", "CH2": "rad/s"})
    same(recording)
    assert recording.t[0] == pytest.approx(-0.05)


@pytest.mark.parametrize(
    "second", ["Sequence,Volt,Volt,,", "Sequence", "Sequence,Volt,Volt", "Sequence,Volt,Volt,0,-1e-3"]
)
def test_read_numbered__header_without_a_step__is_refused(tmp_path: Path, second: str) -> None:
    path = write(tmp_path, ["X,torque,velocity,Start,Increment,", second], lambda k: f"{k},{U[k]},{V[k]},")
    with pytest.raises(RecordingError, match="row 2: no numbers for the first time and the step"):
        read(path)


def test_read_mat__structure_with_time__signals_are_found_by_their_labels(tmp_path: Path) -> None:
    signals = [{"values": x[:, None], "label": name} for x, name in ((U, "torque"), (V, "velocity"))]
    scipy.io.savemat(tmp_path / "run", {"out": {"time": T[:, None], "signals": signals}}, appendmat=False)
    same(read(tmp_path / "run", time="out.time"))
    said = [meaning.quantity for meaning in inspect(tmp_path / "run").meanings]
    assert said == ["time", "torque", "velocity"]


def test_read_mat__export_of_a_test_bench__has_its_units(tmp_path: Path) -> None:
    content = {"X": {"Name": "time", "Data": T, "Unit": "s"}, "Y": {"Name": "torque", "Data": U, "Unit": "Nm"}}
    scipy.io.savemat(tmp_path / "run", {"rec": content}, appendmat=False)
    table, _ = open_table(tmp_path / "run")
    assert [(c.name, c.header, c.unit) for c in table.columns] == [
        ("rec.X.Data", "time", "s"),
        ("rec.Y.Data", "torque", "Nm"),
    ]


def test_extract__object_of_matlab__says_how_to_save_it(monkeypatch: pytest.MonkeyPatch) -> None:
    opaque = np.zeros(1, dtype=[("s0", "O"), ("s1", "O"), ("s2", "O"), ("arr", "O")])
    opaque["s2"] = b"timeseries"
    monkeypatch.setattr(scipy.io, "loadmat", lambda *args, **options: {"t": T, "log": opaque})
    assert extract(Path("run")).others == (
        "log (an object of class timeseries: save its numbers, e.g. t = x.Time; u = x.Data)",
    )


def test_read_hdf5__object_of_matlab__says_how_to_save_it(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(file := io.BytesIO(), "w", userblock_size=512) as written:
        written["t"] = T[None]
        written["log"] = np.zeros((1, 6), np.uint32)
        written["log"].attrs["MATLAB_class"] = np.bytes_("timeseries")
        written["log"].attrs["MATLAB_object_decode"] = np.int32(3)
    (tmp_path / "run").write_bytes(file.getvalue())
    table, _ = open_table(tmp_path / "run")
    assert "log (an object of class timeseries: save its numbers" in table.unread
