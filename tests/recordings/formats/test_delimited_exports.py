"""Text files as loggers export them: compressed, with clock times, thousands marks, several times; and absurd ones."""

from __future__ import annotations

import contextlib
import gzip
import time
import zlib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings import Recording, read_recording
from brightgrey.recordings.file import open_table

N = 40
T = np.round(np.arange(N) * 0.01, 6)
U = np.round(np.sin(np.arange(N)), 5)
V = np.round(np.cumsum(U), 5)
LINES = ["t,torque,velocity", *(f"{t:g},{u:g},{v:g}" for t, u, v in zip(T, U, V, strict=True))]


def write(folder: Path, lines: list[str], name: str = "run.csv") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read(path: Path, **options: object) -> Recording:
    chosen = {"input": "torque", "outputs": ["velocity:velocity"], **options}
    return read_recording(path, **chosen)  # type: ignore[arg-type]


@pytest.mark.parametrize("members", [1, 3])
def test_read_delimited__gzip__is_expanded(tmp_path: Path, members: int) -> None:
    whole = ("\n".join(LINES) + "\n").encode()
    cuts = np.linspace(0, len(whole), members + 1).astype(int)
    path = tmp_path / "run.anything"
    path.write_bytes(b"".join(gzip.compress(whole[a:b]) for a, b in pairwise(cuts)))
    np.testing.assert_array_equal(read(path).u, U)


def test_read_delimited__gzip_bomb__is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv.gz"
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    path.write_bytes(b"".join(packer.compress(b"1,2,3\n" * 1_000_000) for _ in range(40)) + packer.flush())
    with pytest.raises(RecordingError, match="expands to more than 67 MB, which no recording does"):
        read(path)


@pytest.mark.parametrize("damage", [lambda data: data[:-20], lambda data: data[:40] + b"x" * 20 + data[60:]])
def test_read_delimited__damaged_gzip__is_refused(tmp_path: Path, damage) -> None:
    path = tmp_path / "run.csv.gz"
    path.write_bytes(damage(gzip.compress("\n".join(LINES).encode())))
    with pytest.raises(RecordingError, match=r"run\.csv\.gz: the compressed file is (cut off|damaged)"):
        read(path)


STAMPS = {
    "ISO": "2024-01-01 23:59:{:06.3f}",
    "ISO with T": "2024-01-01T23:59:{:06.3f}Z",
    "German": "01.02.2024 10:00:{:06.3f}",
    "time of day": "10:00:{:06.3f}",
}


@pytest.mark.parametrize("form", STAMPS.values(), ids=STAMPS)
def test_read_delimited__clock_times__are_seconds(tmp_path: Path, form: str) -> None:
    lines = ["Timestamp;torque;velocity", *(f"{form.format(t)};{u:g};{v:g}" for t, u, v in zip(T, U, V, strict=True))]
    recording = read(write(tmp_path, lines))
    np.testing.assert_allclose(recording.t, T, atol=1e-9)
    np.testing.assert_array_equal(recording.u, U)


def test_read_delimited__clock_times_in_an_unknown_column__are_the_time_past_midnight(tmp_path: Path) -> None:
    clock = [
        f"2024-01-{1 + (k >= 20):02} {23 if k < 20 else 0:02}:{59 if k < 20 else 0:02}:{(k + 40) % 60:02}"
        for k in range(N)
    ]
    lines = ["when,torque,velocity", *(f"{c},{u:g},{v:g}" for c, u, v in zip(clock, U, V, strict=True))]
    recording = read(write(tmp_path, lines))
    assert recording.dt == 1.0
    np.testing.assert_allclose(recording.t, np.arange(N), atol=1e-9)
    lines[10] = lines[10].replace("2024-01-01", "2024-13-01")
    with pytest.raises(RecordingError, match="row 11, column 'when': '2024-13-01 23:59:49' is no clock time"):
        read(write(tmp_path, lines))


@pytest.mark.parametrize(
    ("decimal", "thousands"),
    [(".", ","), (",", "."), (".", "'"), (",", "'"), (".", "’")],
)
def test_read_delimited__thousands_marks__are_left_out(tmp_path: Path, decimal: str, thousands: str) -> None:
    u = np.round(1e4 * U, 2)
    marks = str.maketrans({",": thousands, ".": decimal})
    numbers = [f"{x:,.2f}".translate(marks) for x in u]
    rows = [f"{t:.2f}".replace(".", decimal) + f";{x};{k}" for k, (t, x) in enumerate(zip(T, numbers, strict=True))]
    recording = read(write(tmp_path, ["t;torque;velocity", *rows]))
    np.testing.assert_allclose(recording.u, u, rtol=1e-15)
    np.testing.assert_array_equal(recording.y[0], np.arange(N))


def test_read_delimited__time_beside_each_channel__gives_each_its_own(tmp_path: Path) -> None:
    lines = ["Time [s],torque [N m],Time [s],velocity [rad/s]"]
    for k in range(2 * N):
        slow = f"{2 * T[k]:g},{V[k]:g}" if k < N else ","
        lines.append(f"{0.01 * k:g},{k},{slow}")
    recording = read(write(tmp_path, lines))
    assert (recording.samples, recording.dt) == (N, 0.02)
    np.testing.assert_array_equal(recording.y[0], V)
    np.testing.assert_allclose(recording.u, 2 * np.arange(N), atol=1e-9)
    assert any("'torque', sampled every 0.01 s, is replaced by straight lines" in note for note in recording.notes)


@pytest.mark.parametrize("missing", ["9.91E+37", "-9.91e37"])
def test_read_delimited__not_a_number_of_instruments__is_missing(tmp_path: Path, missing: str) -> None:
    lines = [*LINES]
    lines[11] = f"0.1,{missing},{V[10]:g}"
    recording = read(write(tmp_path, lines))
    assert recording.u[10] == pytest.approx((U[9] + U[11]) / 2)
    assert "'torque' has no value in row 12: interpolated" in recording.notes


@pytest.mark.parametrize("value", ["1e160", "3.4e38", "-1e31", "1" * 60])
def test_read_delimited__absurd_value__is_refused(tmp_path: Path, value: str) -> None:
    lines = [*LINES]
    lines[11] = f"0.1,{value},{V[10]:g}"
    with pytest.raises(RecordingError, match=r"row 12, column 'torque': no sensor measures -?[0-9.]+e"):
        read(write(tmp_path, lines))


HUGE = {
    "a field longer than the csv module takes": '"' + "x" * 200_000 + '",1,2',
    "a token of digits": "1" * 200_000 + "x,1,2",
    "many fields": ",".join(["1"] * 200_000),
    "many quoted fields": ",".join(['"1"'] * 100_000),
    "a header without an end": "a [" * 100_000,
}


@pytest.mark.parametrize("line", HUGE.values(), ids=HUGE)
@pytest.mark.parametrize("row", [0, 20])
def test_read_delimited__absurd_line__is_refused_in_little_time(tmp_path: Path, line: str, row: int) -> None:
    path = write(tmp_path, [*LINES[:row], line, *LINES[row:]])
    start = time.process_time()
    with contextlib.suppress(RecordingError):
        read(path)
    assert time.process_time() - start < 3.0


@pytest.mark.parametrize("width", [20_000])
def test_read_delimited__thousands_of_columns__are_read_in_little_time(tmp_path: Path, width: int) -> None:
    row = ",".join(["1"] * width)
    path = write(tmp_path, [",".join(f"c{i}" for i in range(width)), *[row] * 25])
    start = time.process_time()
    table, _ = open_table(path)
    assert len(table.columns) == width
    with pytest.raises(RecordingError, match="unknown column 'd1'"):
        table.find("d1")
    assert time.process_time() - start < 5.0


def test_errors__control_characters_of_a_file__are_escaped(tmp_path: Path) -> None:
    lines = [*LINES]
    lines[5] = "0.04,\x1b[31mred\x07,1"
    with pytest.raises(RecordingError) as error:
        read(write(tmp_path, lines))
    assert str(error.value) == r"run.csv: row 6, column 'torque': '\x1b[31mred\x07' is not a number"


def test_errors__many_long_names__are_shortened(tmp_path: Path) -> None:
    names = ",".join(["t", *(f"{'long' * 50}{i}" for i in range(30))])
    path = write(tmp_path, [names, *(f"{t:g}" + ",1" * 30 for t in T)])
    with pytest.raises(RecordingError, match="unknown column 'torque'") as error:
        read(path)
    assert len(str(error.value)) <= 1000


@pytest.mark.parametrize("name", ["²", "1" * 5000, "", "0", "-1", "١"])
def test_table__column_that_is_no_number__is_unknown(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordingError, match="unknown column"):
        read(write(tmp_path, LINES), input=name)


EXPORTS = {
    "footer": [*LINES, "End of measurement", "# 40 samples"],
    "properties as wide as the numbers": ["Writer,2,", "Samples,300,300", "Date,2020/01/01,12", *LINES],
    "names and units in comments": [
        "# t torque velocity",
        "# s Nm rad/s",
        *(line.replace(",", " ") for line in LINES[1:]),
    ],
    "empty line after each": [text for line in LINES for text in (line, "")],
    "a title, then names": ["Trace;Axis 1", *(line.replace(",", ";") for line in LINES)],
}


@pytest.mark.parametrize("lines", EXPORTS.values(), ids=EXPORTS)
def test_read_delimited__text_around_the_numbers__is_skipped_with_a_note(tmp_path: Path, lines: list[str]) -> None:
    recording = read(write(tmp_path, lines))
    np.testing.assert_array_equal(recording.u, U)
    np.testing.assert_array_equal(recording.y[0], V)
    assert any("skipped" in note or "names are taken" in note for note in recording.notes)


def test_read_delimited__units_in_a_second_comment__are_read(tmp_path: Path) -> None:
    recording = read(write(tmp_path, EXPORTS["names and units in comments"]))
    assert (recording.input.unit, recording.input.unit_given) == ("N m", True)
