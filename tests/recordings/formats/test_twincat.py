"""Exports of Beckhoff TwinCAT Scope, cut from those of one test scope (see data/twincat/LICENSE)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording
from brightgrey.recordings.file import open_table

DATA = Path(__file__).parents[1] / "data" / "twincat"
FILES = ("decimal_comma", "default", "separator_2", "no_oversampling")


@pytest.mark.parametrize("name", FILES)
def test_read_scope_text__variant__gives_channels_with_their_own_time(name: str) -> None:
    table, title = open_table(DATA / f"{name}.csv")
    assert title == "Beckhoff TwinCAT Scope"
    channel = table.columns[table.find("var_REAL32")]
    time, values = table.load([channel.clock, table.find("var_REAL32")])
    present = np.isfinite(values)
    np.testing.assert_array_equal(time[present], values[present])  # the scope recorded its own time in ms
    assert table.columns[channel.clock].unit == "ms"


SHORT = """Name,YT Scope Project,,,
File,scope.csv,,,
Starttime of export,132959733843760000,,,

Name,torque,Name,speed,position
"""


@pytest.mark.parametrize(
    "row",
    [
        lambda k: f"{k},{k % 7},{2 * k},{k % 5},{k}" if k < 30 else f"{k},{k % 7},,,",
        lambda k: f"{k},{k % 7},{k},{k // 2 % 5},{k // 2}" if k % 2 == 0 else f"{k},{k % 7},,,",
        lambda k: f"{k},{k % 7},{k - k % 2},{k // 2 % 5},{k // 2}",
    ],
    ids=["without a pause", "beside their time", "filled with the value before"],
)
def test_read_scope_text__short_header_and_slower_channels__have_their_own_time(
    tmp_path: Path, row: Callable[[int], str]
) -> None:
    path = tmp_path / "scope.csv"
    path.write_text(SHORT + "\n" + "\n".join(row(k) for k in range(60)) + "\n", encoding="utf-8")
    assert open_table(path)[1] == "Beckhoff TwinCAT Scope"
    recording = read_recording(path, input="torque", outputs="speed:velocity")
    assert recording.dt == pytest.approx(0.002)
    assert recording.samples >= 29
    np.testing.assert_array_equal(recording.y[0], np.arange(recording.samples) % 5)


@pytest.mark.parametrize("name", FILES)
def test_read_scope_text__scale_factor__is_applied_once(name: str) -> None:
    """Two channels of one variable, of which one has ScaleFactor -1 and Offset 1; one file has numbers as recorded."""
    table, _ = open_table(DATA / f"{name}.csv")
    plain, scaled = table.load([table.find("var_REAL32"), table.find("func_scaled")])
    np.testing.assert_array_equal(scaled, 1.0 - plain)
    (in_units,) = table.load([table.find("func_units_scaled")])
    np.testing.assert_array_equal(in_units, 10.0 - 10.0 * plain)
    assert table.notes == ()


def test_read_scope_text__whole_numbers_with_a_factor__show_if_it_is_applied(tmp_path: Path) -> None:
    head = "Name\tscope\nFile\tx\n\nName\tq\nData-Type\t{}\nSampleTime[ms]\t1\nOffset\t0\nScaleFactor\t{}\n\n"
    path = tmp_path / "scope.csv"
    cases = (("INT32", "0,001", "{}"), ("INT32", "0,001", "0,{:03}"), ("INT32", "1e-3", "{}"), ("REAL32", "1", "{}"))
    for kind, factor, form in (*cases, ("REAL32", "1e-3", "0,{:03}")):
        rows = "".join(f"{i}\t{form.format(i)}\n" for i in range(1, 40))
        path.write_text(head.format(kind, factor) + rows, encoding="utf-8")
        table, _ = open_table(path)
        (values,) = table.load([1])
        assert len(table.notes) == (kind == "REAL32" and factor != "1")
        np.testing.assert_allclose(values, np.arange(1, 40) * (1.0 if factor == "1" else 1e-3))


def test_read_scope_text__full_time_stamps__are_milliseconds(tmp_path: Path) -> None:
    text = "Name\tscope\n\nName\tq\nSampleTime[ms]\t1\n\n"
    text += "".join(f"{132959733843760000 + 10000 * i}\t{i}\n" for i in range(40))
    path = tmp_path / "scope.csv"
    path.write_text(text, encoding="utf-8")
    table, _ = open_table(path)
    np.testing.assert_allclose(table.load([0])[0], np.arange(40.0), atol=0.002)


@pytest.mark.parametrize("name", FILES)
def test_read_scope_text__unit__is_read_without_its_quantity(name: str) -> None:
    table, _ = open_table(DATA / f"{name}.csv")
    units = {column.name: column.unit for column in table.columns if column.name}
    assert {units["func_units_scaled"], units["func_units_unscaled"]} == {"V", "dV"}
    assert units["var_INT16"] is None


def test_read_scope_text__channel_that_goes_on_longer__ends_the_others(tmp_path: Path) -> None:
    text = (DATA / "decimal_comma.csv").read_text(encoding="utf-8")
    longer = "".join(f"{k / 5:g}\t{k / 5:g}\n".replace(".", ",") for k in range(107, 200))
    path = tmp_path / "scope.txt"
    path.write_text(text + longer + "EOF\n", encoding="utf-8")
    table, _ = open_table(path)
    assert np.isfinite(table.load([table.find("func_OS")])).sum() == 200
    recording = read_recording(path, input="var_REAL32", outputs="var_INT16:position")
    assert recording.samples == 107
    assert recording.dt == 1e-3


def test_read_scope_text__oversampled_input__is_put_onto_the_clock_of_the_output() -> None:
    path = DATA / "default.csv"
    recording = read_recording(path, input="var_REAL32", outputs="func_OS:position")
    np.testing.assert_allclose(recording.u, recording.t * 1e3, atol=1e-9)
    np.testing.assert_allclose(recording.y[0], recording.t * 1e3, atol=1e-9)
    assert recording.dt == 2e-4
    assert any("is interpolated at the 0.0002 s of 'func_OS'" in note for note in recording.notes)


@pytest.mark.parametrize("name", [*FILES, "sorted_channels", "with_eof"])
def test_read_scope_text__whole_file__has_all_samples(measured: Callable[[str], Path], name: str) -> None:
    recording = read_recording(
        measured(f"twincat/{name}.csv"), input="var_REAL32", outputs="var_INT16:position", units={"var_INT16": "rad"}
    )
    assert (recording.samples, recording.dt, recording.t[0]) == (1000, 1e-3, 0.0)
    np.testing.assert_array_equal(recording.u, np.arange(1000.0))
    np.testing.assert_array_equal(recording.y[0], np.arange(1000.0))


@pytest.mark.parametrize(
    ("cut", "message"),
    [
        (lambda lines: lines[:6] + lines[7:], "no line with the names of the channels"),
        (lambda lines: lines[:24], "no numbers below the properties"),
        (lambda lines: [*lines[:40], "1\tabc", *lines[41:]], "row 41, column 'func_OS': 'abc' is not a number"),
    ],
)
def test_read_scope_text__damaged_file__is_refused(
    tmp_path: Path, cut: Callable[[list[str]], list[str]], message: str
) -> None:
    lines = (DATA / "decimal_comma.csv").read_text(encoding="utf-8").splitlines()
    path = tmp_path / "scope.csv"
    path.write_text("\n".join(cut(lines)), encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        read_recording(path, input="func_OS", outputs="var_INT16:position")
