"""Text files in every dialect: what they hold comes in, and what is wrong is named with its place."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError, SettingsError
from brightgrey.recordings import Recording, read_recording

N = 40
T = np.round(np.arange(N) * 0.01, 6)
U = np.round(np.sin(np.arange(N)), 5)
V = np.round(np.cumsum(U), 5)


def rows(delimiter: str = ",", decimal: str = ".", t: np.ndarray = T) -> list[str]:
    lines = [delimiter.join(f"{x:.6g}" for x in row) for row in zip(t, U, V, strict=True)]
    return [line.replace(".", decimal) if decimal != "." else line for line in lines]


def write(folder: Path, lines: list[str], *, end: str = "\n", encoding: str = "utf-8") -> Path:
    path = folder / "run.csv"
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


def read(path: Path, **options: object) -> Recording:
    chosen = {"input": "torque", "outputs": ["velocity:velocity"], **options}
    return read_recording(path, **chosen)  # type: ignore[arg-type]


def check(recording: Recording) -> None:
    np.testing.assert_array_equal(recording.u, U)
    np.testing.assert_array_equal(recording.y, [V])
    np.testing.assert_allclose(recording.t, T, atol=1e-15)
    assert recording.dt == 0.01


HEADERS = {
    "comma": ("t,torque,velocity", ","),
    "semicolon": ("t;torque;velocity", ";"),
    "tab": ("t\ttorque\tvelocity", "\t"),
    "space": ("t torque velocity", " "),
    "bar": ("t|torque|velocity", "|"),
    "units in brackets": ("Time [s],torque [N m],velocity [rad/s]", ","),
    "units in round brackets": ("time (s);torque (Nm);velocity (rad/s)", ";"),
    "units after slashes": ("t / s;torque / N m;velocity / (rad/s)", ";"),
    "units after slashes, closely": ("t/s;torque/Nm;velocity/(rad/s)", ";"),
    "units in brackets, spaces between": ("t [s] torque [N m] velocity [rad/s]", " "),
    "quoted": ('"t","torque","velocity"', ","),
    "quoted, spaces between": ('"t" "torque [N m]" "velocity [rad/s]"', " "),
}


@pytest.mark.parametrize(
    ("header", "delimiter", "decimal"),
    [(*header, decimal) for header in HEADERS.values() for decimal in ".," if decimal != header[1]],
)
def test_read_delimited__headers_and_delimiters__are_found(
    tmp_path: Path, header: str, delimiter: str, decimal: str
) -> None:
    recording = read(write(tmp_path, [header, *rows(delimiter, decimal)]))
    check(recording)
    signals = (recording.input, *recording.outputs)
    assert [s.name for s in signals] == ["torque", "velocity"]
    assert [s.unit for s in signals] == ["N m", "rad/s"]
    assert all(s.unit_given for s in signals) == ("rad/s" in header)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_read_delimited__line_ends_and_encodings__are_found(tmp_path: Path, end: str, encoding: str) -> None:
    lines = ["t [s];torque [N m];velocity [°/s]", *rows(";", ",")]
    recording = read(write(tmp_path, lines, end=end, encoding=encoding))
    np.testing.assert_array_equal(recording.u, U)
    np.testing.assert_allclose(recording.y[0], np.deg2rad(V), rtol=1e-15)
    assert recording.outputs[0].unit == "deg/s"


@pytest.mark.parametrize(
    "lines",
    [
        ["# measured on a Monday", "t,torque,velocity", *rows()],
        ["% a", "// b", "", "t,torque,velocity", "", *rows(), "", "# end"],
        ["t,torque,velocity,", *(f"{line}," for line in rows())],
        ["t,torque,velocity", *(f"{line},," for line in rows())],
        ["t , torque , velocity", *(line.replace(",", " , ") for line in rows())],
        ["t,torque,velocity", *('"' + line.replace(",", '","') + '"' for line in rows())],
        ["t,torque,velocity", *rows(), ",,", ",,"],
        ["sep=,", "t,torque,velocity", *rows()],
        ["Logger 5", "Axis;3", "", "t,torque,velocity", *rows()],
        ["t,torque,velocity", "s,N m,rad/s", *rows()],
        ['t,"torque\n[N m]","velocity\n[rad/s]"', *rows()],
        ["t,torque,velocity", "[s],[Nm],[rad/s]", *rows()],
        ["# t torque velocity", *rows(" ")],
        ["#t,torque,velocity", *rows()],
        ["t,torque,velocity,state", *(f"{line},RUN" for line in rows())],
        ["date,t,torque,velocity", *(f"2024-05-01 12:00:00,{line}" for line in rows())],
        ["t,torque,velocity", *(line.replace(",", ",  ") for line in rows())],
        ["   t  torque velocity", *(f"  {line}" for line in rows(" "))],
    ],
    ids=lambda lines: lines[0],
)
def test_read_delimited__additions_of_loggers_and_spreadsheets__are_skipped(tmp_path: Path, lines: list[str]) -> None:
    check(read(write(tmp_path, lines)))


def test_read_delimited__row_of_units__gives_the_units(tmp_path: Path) -> None:
    path = write(tmp_path, ["t;torque;velocity", "ms;mNm;1/min", *rows(";", t=T * 1000)])
    recording = read(path)
    np.testing.assert_allclose(recording.u, U / 1000, rtol=1e-15)
    np.testing.assert_allclose(recording.y[0], V * np.pi / 30, rtol=1e-15)
    assert recording.dt == 0.01


def test_read_delimited__skipped_rows__are_noted(tmp_path: Path) -> None:
    recording = read(write(tmp_path, ["t;torque;velocity", "ms;what;ever", *rows(";")]))
    assert "row 2 above the numbers is skipped, beginning 'ms;what;ever'" in recording.notes


def test_read_delimited__no_header__columns_are_numbered(tmp_path: Path) -> None:
    path = write(tmp_path, rows())
    check(read(path, input="2", outputs=["3:velocity"], time="1"))
    with pytest.raises(RecordingError, match=r"no column is called t or time.*1, 2, 3"):
        read(path, input="2", outputs=["3:velocity"])
    with pytest.raises(RecordingError, match="Columns: 1, 2, 3"):
        read(path, time="1")


def test_read_delimited__number_as_column__counts_from_one(tmp_path: Path) -> None:
    recording = read(write(tmp_path, ["t,torque,velocity", *rows()]), input="2", outputs=["3:velocity"])
    assert recording.input.name == "torque"


def test_read_delimited__index_or_suffix__is_part_of_the_name(tmp_path: Path) -> None:
    path = write(tmp_path, ["t,axis[1],torque_Nm", *rows()])
    recording = read(path, input="torque_Nm", outputs=["axis[1]:position"])
    assert not recording.input.unit_given
    with pytest.raises(RecordingError, match="Did you mean 'torque_Nm'"):
        read(path)


def test_read_delimited__full_header__names_the_column_too(tmp_path: Path) -> None:
    path = write(tmp_path, ["t,v [rad/s],v [rpm]", *rows()])
    recording = read(path, input="v [rad/s]", outputs=["v [rpm]"])
    assert recording.outputs[0].unit == "rpm"
    with pytest.raises(RecordingError, match=r"2 columns are called 'v' \(fields 2, 3\)"):
        read(path, input="v", outputs=["v"])


def test_read_delimited__dialect_given__is_used(tmp_path: Path) -> None:
    path = write(tmp_path, ["t;torque;velocity", *rows(";", ",")])
    check(read(path, delimiter=";", decimal=",", header=True))
    check(read(path, delimiter="semicolon"))
    with pytest.raises(SettingsError, match="Did you mean 'semicolon'"):
        read(path, delimiter="semikolon")
    with pytest.raises(SettingsError, match="neither"):
        read(path, decimal="'")
    with pytest.raises(SettingsError, match="both be a comma"):
        read(path, delimiter=",", decimal=",")
    with pytest.raises(RecordingError, match="row 1, column '2': 'torque' is not a number"):
        read(path, header=False, input="2", outputs="3:velocity", time="1")


def test_read_delimited__header_of_numbers__can_be_forced(tmp_path: Path) -> None:
    path = write(tmp_path, ["0,1,2", *rows()])
    recording = read(path, header=True, time="0", input="1", outputs="2:velocity")
    np.testing.assert_array_equal(recording.u, U)


def test_read_delimited__one_column_in_each_file__is_read_with_its_interval(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("motor torque [N m]\n" + "\n".join(f"{u}" for u in U))
    (tmp_path / "v.csv").write_text("\n".join(f"{v}" for v in V))
    recording = read_recording(
        tmp_path / "u.csv", input="motor torque", outputs="v.1:velocity", beside=[tmp_path / "v.csv"], dt=0.01
    )
    np.testing.assert_array_equal(recording.u, U)
    np.testing.assert_array_equal(recording.y, [V])
    assert recording.input.unit == "N m"


BAD = {
    "empty": ([], "run.csv: the file is empty"),
    "comments only": (["# nothing"], "the file is empty but for comments"),
    "header only": (["t,torque,velocity"], "no columns of numbers"),
    "prose": (["This is a letter.", "It has no numbers."], "no columns of numbers"),
    "one column": (["torque", *(f"{u}" for u in U)], "unknown column 'velocity'. Columns: torque"),
    "few numbers in prose": (["A letter.", "12", "It has one number."], "no columns of numbers"),
    "missing column": (
        ["t,torqe,velocity", *rows()],
        "unknown column 'torque'. Did you mean 'torqe'? Columns: t, torqe",
    ),
    "two of a name": (
        ["t,torque,torque,velocity", *(f"{line},1" for line in rows())],
        "2 columns are called 'torque'",
    ),
    "header too short": (["t,torque", *rows()], "row 1: the header has 2 fields, rows below have 3"),
    "header too long": (
        ["t,torque,velocity,x", *rows()],
        "row 1: the header has 4 fields, rows below have 3",
    ),
    "few samples": (["t,torque,velocity", *rows()[:19]], "19 samples are too few"),
    "unknown unit": (
        ["t,torque [Nmx],velocity", *rows()],
        "column 'torque': unknown unit 'Nmx'. Did you mean 'N m'",
    ),
    "wrong unit": (["t,torque,velocity [N m]", *rows()], "column 'velocity': unit 'N m' does not fit"),
    "time in metres": (["t [m],torque,velocity", *rows()], "column 't': unit 'm' is not one of time"),
    "two times": (
        ["t,Time,torque,velocity", *(f"0,{line}" for line in rows())],
        "'t' (field 1), 'Time' (field 2)",
    ),
}


@pytest.mark.parametrize(("lines", "message"), BAD.values(), ids=BAD)
def test_read_delimited__unusable_file__is_refused_in_one_line(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(RecordingError) as error:
        read(write(tmp_path, lines))
    text = str(error.value)
    assert message in text
    assert text.startswith("run.csv: ")
    assert "\n" not in text
    assert str(tmp_path) not in text


CELLS = {
    "text": ("0.2,abc,1", "row 22, column 'torque': 'abc' is not a number"),
    "text in the time": ("abc,0.2,1", "row 22, column 't': 'abc' is not a number"),
    "thousands": ('0.2,"1,500",1', "row 22, column 'torque': '1,500' is not a number"),
    "underscore": ("0.2,1_0,1", "row 22, column 'torque': '1_0' is not a number"),
    "hexadecimal": ("0.2,0x10,1", "row 22, column 'torque': '0x10' is not a number"),
    "infinite": ("0.2,inf,1", "row 22, column 'torque': the value is infinite"),
    "apostrophe": ("0.2,0'568,1", "row 22, column 'torque': '0'568' is not a number"),
    "too few fields": ("0.2,1", "row 22: 2 fields where 3 are expected"),
    "too many fields": ("0.2,1,2,3", "row 22: 4 fields where 3 are expected"),
    "backwards": ("0.1,1,1", "row 22, column 't': time runs backwards: 0.1 s after 0.19 s"),
}


@pytest.mark.parametrize(("cell", "message"), CELLS.values(), ids=CELLS)
def test_read_delimited__bad_cell__is_named_by_row_and_column(tmp_path: Path, cell: str, message: str) -> None:
    lines = ["t,torque,velocity", *rows()]
    lines[21] = cell
    with pytest.raises(RecordingError) as error:
        read(write(tmp_path, lines))
    assert f"run.csv: {message}" in str(error.value)


def test_read_delimited__row_in_a_message__is_the_line_of_the_file(tmp_path: Path) -> None:
    lines = ["# one", "", "# three", "t,torque,velocity", "# five", *rows()]
    lines[25] = "0.2,abc,1"
    with pytest.raises(RecordingError, match="row 26, column 'torque'"):
        read(write(tmp_path, lines))


@pytest.mark.parametrize("first", ["0,abc,1", "abc,0,1"])
def test_read_delimited__text_in_the_first_row__is_no_header(tmp_path: Path, first: str) -> None:
    lines = ["t,torque,velocity", *rows()]
    lines[1] = first
    with pytest.raises(RecordingError, match=r"row 2, column .*'abc' is not a number"):
        read(write(tmp_path, lines))


def test_read_delimited__two_rows_in_the_first_line__are_refused(tmp_path: Path) -> None:
    lines = ["t,torque,velocity", *rows()]
    lines[1:3] = [lines[1] + lines[2]]
    with pytest.raises(RecordingError, match="row 2: 5 fields where 3 are expected"):
        read(write(tmp_path, lines))


def test_read_delimited__file_cut_off__is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["t,torque,velocity", *rows()]) + "\n0.4,1")
    with pytest.raises(RecordingError, match="row 42: 2 fields where 3 are expected; the file seems to be cut off"):
        read(path)


@pytest.mark.parametrize("word", ["", "NaN", "nan", "n/a", "-", "NULL"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_read_delimited__single_missing_value__is_interpolated_with_a_note(
    tmp_path: Path, word: str, decimal: str
) -> None:
    lines = ["t;torque;velocity", *rows(";", decimal)]
    fields = lines[21].split(";")
    lines[21] = ";".join([fields[0], word, fields[2]])
    recording = read(write(tmp_path, lines))
    assert recording.u[20] == pytest.approx((U[19] + U[21]) / 2)
    assert recording.y[0, 20] == V[20]
    assert "'torque' has no value in row 22: interpolated" in recording.notes


@pytest.mark.parametrize("gap", [(20, 21), (10, 20)])
def test_read_delimited__several_missing_values__are_refused(tmp_path: Path, gap: tuple[int, ...]) -> None:
    lines = ["t,torque,velocity", *rows()]
    for i in gap:
        fields = lines[i + 1].split(",")
        lines[i + 1] = ",".join([fields[0], "nan", fields[2]])
    with pytest.raises(RecordingError, match=f"row {gap[0] + 2}, column 'torque': no value here, 2 in all"):
        read(write(tmp_path, lines))


def test_read_delimited__missing_first_value__is_left_out(tmp_path: Path) -> None:
    lines = ["t,torque,velocity", *rows()]
    lines[1] = "0,0,nan"
    recording = read(write(tmp_path, lines))
    assert recording.t[0] == 0.01
    assert any("row 2 at the ends: left out" in note for note in recording.notes)


def test_read_delimited__column_without_numbers__is_refused(tmp_path: Path) -> None:
    lines = ["t,torque,velocity", *(line.rsplit(",", 1)[0] + ",nan" for line in rows())]
    with pytest.raises(RecordingError, match="column 'velocity': there is no number in it"):
        read(write(tmp_path, lines))


def test_read_delimited__mixed_decimal_marks__are_refused(tmp_path: Path) -> None:
    lines = ["t;torque;velocity", *rows(";", ",")]
    lines[21] = "0,2;1.500;1"  # one and a half, or fifteen hundred?
    with pytest.raises(RecordingError, match=r"row 22, column 'torque': '1\.500' is not a number"):
        read(write(tmp_path, lines))


def test_read_delimited__late_decimal_comma__is_found(tmp_path: Path) -> None:
    n = 2000
    lines = ["t;torque;velocity", *(f"{i};{i % 7};{i % 5}" for i in range(n))]
    lines[1500] = "1499;2,5;3"
    recording = read(write(tmp_path, lines))
    assert recording.u[1499] == 2.5


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04" + bytes(100), "save the sheet as CSV"),
        (b"\x00\x01\x02" * 100, "no text file"),
        (b"\x81\x8d\x8f\x90\x9d", "no columns of numbers"),
    ],
)
def test_read_recording__file_that_is_no_text__is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=message):
        read(path)


def test_read_recording__missing_file__is_refused_with_the_nearest(tmp_path: Path) -> None:
    write(tmp_path, rows())
    with pytest.raises(RecordingError, match=r"rum\.csv: there is no such file\. Did you mean 'run\.csv'\?$"):
        read(tmp_path / "rum.csv")
    missing = tmp_path / "nowhere" / "run.csv"
    with pytest.raises(RecordingError) as refused:
        read(missing)
    assert str(refused.value) == f"{missing}: there is no such file"
    with pytest.raises(RecordingError, match="this is a folder"):
        read(tmp_path)


def test_read_recording__device_or_pipe__is_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    for path in (pipe, Path(os.devnull)):
        with pytest.raises(RecordingError) as refused:
            read(path)
        assert str(refused.value) == f"{path}: this is a device or a pipe, not a file"


def test_read_recording__hundred_thousand_rows__is_fast(tmp_path: Path) -> None:
    n = 100_000
    k = np.arange(n)
    data = np.column_stack([k * 1e-3, np.sin(k), np.cos(k)])
    path = tmp_path / "run.csv"
    np.savetxt(path, data, fmt="%.9g", delimiter=";", header="t;torque;velocity", comments="")
    read(path)
    start = time.process_time()
    recording = read(path)
    spent = time.process_time() - start
    start = time.process_time()
    for line in path.read_text().splitlines()[1:]:
        [float(field) for field in line.split(";")]
    loop = time.process_time() - start
    np.testing.assert_allclose(recording.u, data[:, 1], rtol=1e-8)
    print(f"{spent:.3f} s, {spent / loop:.2f} times a plain loop")
    assert spent < 10 * loop  # measured 2; a guard against quadratic work that a slow machine does not touch
