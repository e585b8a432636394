"""Texts as the programs of drives, oscilloscopes and statistics write them: each is read with the numbers written."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from brightgrey import inspect
from brightgrey.errors import RecordingError
from brightgrey.recordings import read_recording
from brightgrey.recordings.checks.checkup import check
from brightgrey.recordings.file import open_table
from support.drive_texts import HEADER, N, T, U, V, comma, same, write

CELLS: dict[str, tuple[list[str], Callable[[float, float, float], str]]] = {
    "minus of typography": ([HEADER], lambda t, u, v: f"{t};{u};{v:.2f}".replace("-", "−")),
    "exponents of Fortran": ([HEADER], lambda t, u, v: f"{t:.3f};{u:.8E};{v:.8E}".replace("E", "D")),
    "narrow spaces as thousands marks": (
        [HEADER],
        lambda t, u, v: f"{comma(t)};{comma(u)};{comma(v, ',.2f').replace(',', chr(0x202F), f'{v:,.2f}'.count(','))}",
    ),
    "decimal commas in quotes between commas": (
        [HEADER.replace(";", ",")],
        lambda t, u, v: f'"{comma(t)}","{comma(u)}","{comma(v, ".2f")}"',
    ),
    "unit behind each number": ([HEADER.replace(" [s]", "")], lambda t, u, v: f"{t:g} sec;{u};{v:.2f}"),
    "tabs below a header of commas": (["time [s],torque [Nm],speed [rpm]"], lambda t, u, v: f"{t:g}\t{u}\t{v:.2f}"),
    "comment that names columns": (
        ["! scope", "# columns: time[s] torque[Nm] speed[rpm]"],
        lambda t, u, v: f"{t:g} {u} {v:.2f}",
    ),
    "labelled rows of names and units": (
        ["Title,Trace", "Object,Time,torque,speed", "Unit,s,Nm,rpm"],
        lambda t, u, v: f",{t:g},{u},{v:.2f}",
    ),
    "slash and brackets in names": (
        ["time (s);S-0-0084 torque/force [Nm];speed (motor) (Rpm)"],
        lambda t, u, v: f"{t:g};{u};{v:.2f}",
    ),
    "time known by its unit alone": (["x-axis;torque;speed", "second;Nm;rpm"], lambda t, u, v: f"{t:g};{u};{v:.2f}"),
    "types between names and units": (
        ["time;torque;speed", "REAL;REAL;LREAL", "[s];[Nm];[rpm]"],
        lambda t, u, v: f"{t:g};{u};{v:.2f}",
    ),
    "commas between names, spaces between numbers": (
        ["# time[s], torque[Nm], speed[rpm]"],
        lambda t, u, v: f"{t:g} {u} {v:.2f}",
    ),
    "parts of units": (
        ["time [1e-3 s];torque [0.0001 Nm];speed [0.01 rpm]"],
        lambda t, u, v: f"{1e3 * t:.0f};{1e4 * u:.0f};{100 * v:.0f}",
    ),
    "numbers as names, and descriptions": (
        ["a,b,1,2", ",,torque,speed", "s,,Nm,rpm"],
        lambda t, u, v: f"{t:g},200,{u},{v:.2f}",
    ),
}


@pytest.mark.parametrize("name", CELLS)
def test_read_delimited__text_of_another_program__has_the_numbers_written(tmp_path: Path, name: str) -> None:
    head, row = CELLS[name]
    same(write(tmp_path, head, row))


STAMPS: dict[str, Callable[[datetime], str]] = {
    "month in letters": lambda at: at.strftime("%d-%b-%Y %H:%M:%S.%f"),
    "year of two digits": lambda at: at.strftime("%d.%m.%y %H:%M:%S,%f"),
    "digits alone": lambda at: at.strftime("%Y%m%d %H:%M:%S.%f"),
    "days since the start": lambda at: f"{(at - datetime(2024, 2, 28)).days} days {at:%H:%M:%S.%f}",
}


@pytest.mark.parametrize("form", STAMPS)
def test_read_delimited__date_in_another_form__passes_midnight(tmp_path: Path, form: str) -> None:
    start = datetime(2024, 2, 28, 23, 59, 59, 950_000)
    stamp = STAMPS[form]
    path = write(
        tmp_path, [";torque [Nm];speed [rpm]"], lambda t, u, v: f"{stamp(start + timedelta(seconds=t))};{u};{v:.2f}"
    )
    same(path)


def test_read_delimited__rows_counted_in_quotes__are_no_channel(tmp_path: Path) -> None:
    path = write(tmp_path, ['"time" "torque" "speed"'], lambda t, u, v: f'"{round(t * 500) + 1}" {t:g} {u} {v:.2f}')
    same(path, units={"torque": "N m", "speed": "rpm"})


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_read_delimited__utf_16_without_a_mark__is_read(tmp_path: Path, encoding: str) -> None:
    same(write(tmp_path, [HEADER], lambda t, u, v: f"{t:g};{u};{v:.2f}", encoding))


def test_read_delimited__unknown_encoding__columns_are_found_by_number(tmp_path: Path) -> None:
    path = write(
        tmp_path, ["時間(ms),モータ回転速度(r/min),トルク(%)"], lambda t, u, v: f"{1e3 * t:g},{v:.2f},{u}", "cp932"
    )
    recording = same(path, rated={"3": "100 N m"})
    assert any("neither UTF-8, UTF-16 nor Windows-1252" in note for note in recording.notes)


def test_read_delimited__lines_of_a_log_above_the_numbers__columns_are_numbered(tmp_path: Path) -> None:
    path = write(tmp_path, ["MOT: Init", "MOT: Ready."], lambda t, u, v: f"{u}\t{v:.2f}\t0")
    table, _ = open_table(path)
    assert [column.name for column in table.columns] == ["1", "2", "3"]
    assert "no row names the columns" in table.notes


def test_read_delimited__times_called_after_their_channels__are_their_clocks(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{T[k]:.3f};{U[k]}" + (f";{2 * T[k]:.3f};{V[k]:.2f}" if k < N // 2 else ";;") for k in range(N)]
    path.write_text("\n".join(["t_torque [s];torque [Nm];t_spe [s];speed [rpm]", *rows]) + "\n")
    recording = read_recording(path, input="torque", outputs="speed")
    assert recording.dt == pytest.approx(4e-3)
    np.testing.assert_allclose(recording.y[0], V[: N // 2] * np.pi / 30, rtol=1e-12)


def test_read_delimited__name_like_a_time_of_a_channel__is_a_channel_unless_it_rises(tmp_path: Path) -> None:
    path = write(tmp_path, ["time;torque;t_motor;motor_speed"], lambda t, u, v: f"{t:g};{u};{20 + u};{v}")
    table, _ = open_table(path)
    assert [column.clock for column in table.columns] == [None] * 4


def test_read_recording__channel_that_ends_early__is_no_channel_of_a_merged_list(tmp_path: Path) -> None:
    path = write(tmp_path, ["time;torque;speed"], lambda t, u, v: f"{t:g};{u};{v if t < 0.06 else ''}")
    with pytest.raises(RecordingError, match="no value, like in 29 other rows at the ends"):
        read_recording(path, input="torque", outputs="speed")


@pytest.mark.parametrize(("delimiter", "decimal", "cell"), [(";", ",", "1.020"), (",", ".", '"1,020"')])
def test_read_delimited__mark_that_may_mean_two_things__is_refused_with_a_remedy(
    tmp_path: Path, delimiter: str, decimal: str, cell: str
) -> None:
    def row(t: float, u: float, v: float) -> str:
        cells = [f"{t:.3f}".replace(".", decimal), f"{u}".replace(".", decimal), cell if t > 0.05 else f"{v:.0f}"]
        return delimiter.join(cells)

    path = write(tmp_path, [HEADER.replace(";", delimiter)], row)
    with pytest.raises(
        RecordingError, match=r"'1[.,]020' is not a number .* separates thousands, export the numbers without"
    ):
        read_recording(path, input="torque", outputs="speed")


@pytest.mark.parametrize("unquoted", ["0,25,7,5,2,4", "0,7,2,4"])
def test_read_delimited__decimal_commas_between_commas__are_refused_with_a_remedy(
    tmp_path: Path, unquoted: str
) -> None:
    path = write(tmp_path, [HEADER.replace(";", ",")], lambda t, u, v: unquoted)
    with pytest.raises(RecordingError, match="if commas are the decimal marks as well, export with semicolons"):
        read_recording(path, input="torque", outputs="speed")


@pytest.mark.parametrize(("head", "blank"), [(["speed,torque"], " "), (["speed,torque"], "\u202f"), ([], "\u202f")])
def test_read_delimited__blank_as_thousands_mark_between_commas__is_no_delimiter(
    tmp_path: Path, head: list[str], blank: str
) -> None:
    path = write(tmp_path, head, lambda t, u, v: f"{round(500 * t)},1{blank}000")
    with pytest.raises(RecordingError):
        read_recording(path, input="1", outputs="2:velocity", dt=1e-3)


def test_inspect__ticks_without_a_unit__asks_for_the_interval(tmp_path: Path) -> None:
    path = write(tmp_path, ["Ticks;torque [Nm];speed [rpm]"], lambda t, u, v: f"{4000 * t:.0f};{u};{v}")
    found = inspect(path)
    assert "--dt SECONDS" in found.command
    assert "'Ticks' rises by 8 in every row" in found.questions[0]


def test_inspect__time_of_whole_numbers__asks_for_its_unit(tmp_path: Path) -> None:
    path = write(tmp_path, ["time;torque [Nm];speed [rpm]"], lambda t, u, v: f"{1000 * t:.0f};{u};{v}")
    assert (
        "steps of 2 of 'time' are taken as s, as no unit is in the file: --unit 'time=ms'" in inspect(path).questions[0]
    )
    same(path, units={"time": "ms"})


@pytest.mark.parametrize("factor", [1e3, 1 / 86400], ids=["ms", "days"])
def test_check__time_in_another_unit__stops(tmp_path: Path, factor: float) -> None:
    path = write(tmp_path, ["time;torque [Nm];speed [rpm]"], lambda t, u, v: f"{factor * t:.12g};{u};{v}")
    checkup = check(read_recording(path, input="torque", outputs="speed"))
    assert any("say the unit of the time" in result.sentence for result in checkup.of_grade("stop"))


@pytest.mark.parametrize(("name", "signal"), [("speed_rpm", "speed_rpm"), ("n [rpm]", "n")])
def test_check__name_or_unit_that_contradicts__is_minded(tmp_path: Path, name: str, signal: str) -> None:
    path = write(tmp_path, [f"time;{name};y"], lambda t, u, v: f"{t:g};{v};{u}")
    outputs, inputs = ("speed_rpm", "y") if name == signal else ("y:velocity", signal)
    checkup = check(read_recording(path, input=inputs, outputs=outputs))
    assert [result for result in checkup.of_grade("mind") if result.check == "file"]


def test_inspect__text_for_numbers__names_the_cell(tmp_path: Path) -> None:
    path = write(tmp_path, [HEADER], lambda t, u, v: f"{t:g};{u};0x{int(abs(v)):X}")
    assert "Row 2, column 'speed': '0x190' is not a number" in inspect(path).problem


def test_inspect__one_value_in_each_row__says_to_write_columns(tmp_path: Path) -> None:
    stamp = "2024-03-09 12:00:00."
    path = write(
        tmp_path,
        ["stamp;tag;value;quality"],
        lambda t, u, v: f"{stamp}{1000 * t:03.0f};torque;{u};Good\n{stamp}{1000 * t:03.0f};speed;{v};Good",
    )
    assert any("a word says of what (speed, torque)" in note for note in inspect(path).notes)


def test_inspect__channels_in_rows__says_to_turn_the_table(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("".join(f"{name},{','.join(map(str, row))}\n" for name, row in (("t", T), ("u", U), ("v", V))))
    assert "turn the table round" in inspect(path).problem


def test_inspect__name_that_ends_in_a_word_like_a_unit__is_no_length(tmp_path: Path) -> None:
    path = write(tmp_path, ["time;current_in;torque_pct;speed_rpm"], lambda t, u, v: f"{t:g};{u};{u};{v}")
    found = inspect(path)
    assert found.options["units"] == {"torque_pct": "%", "speed_rpm": "rpm"}
    assert any("--rated" in question for question in found.questions)
    path = write(tmp_path, ["time;current_in;speed_rpm"], lambda t, u, v: f"{t:g};{u};{v}")
    assert inspect(path).options["units"]["current_in"] == "A"


@pytest.mark.parametrize(("between", "blank"), [(";", " "), (",", " "), (",", ""), ("\t", "")])
def test_read_recording__unit_behind_every_number__is_that_of_the_column(
    tmp_path: Path, between: str, blank: str
) -> None:
    head = between.join(["time", "torque", "speed"])
    row = between.join(["{0:.3f}{3}s", "{1:g}{3}N m", "{2:.2f}{3}rpm"])
    path = write(tmp_path, [head], lambda t, u, v: row.format(t, u, v, blank))
    same(path)
    assert [c.unit for c in open_table(path)[0].columns] == ["s", "N m", "rpm"]


def test_read_recording__two_units_behind_numbers_of_a_column__is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, ["time;torque;speed"], lambda t, u, v: f"{t:.3f} s;{u:g} N m;{v:.2f} rpm")
    text = path.read_text("utf-8")
    path.write_text(text.replace(f"{U[40]:g} N m", f"{1e3 * U[40]:g} mN m"), "utf-8")
    with pytest.raises(
        RecordingError, match=r"column 'torque': '.* N m' is not a number; 'N m' is not the unit of all rows"
    ):
        read_recording(path, input="torque", outputs="speed:velocity", units={"torque": "N m", "speed": "rpm"})


def test_read_recording__words_that_begin_with_numbers__are_no_units(tmp_path: Path) -> None:
    path = write(tmp_path, ["time;state;torque [Nm];speed [rpm]"], lambda t, u, v: f"{t:.3f};2nd gear;{u:g};{v:.2f}")
    same(path)


@pytest.mark.parametrize("name", ["ms", "msec", "Milliseconds", "ms [ms]"])
def test_read_recording__milliseconds_right_of_clock_times__are_added(tmp_path: Path, name: str) -> None:
    def row(t: float, u: float, v: float) -> str:
        return f"27.11.2026;23:59:{59 if t < 0.05 else 0:02d};{(950 + round(1e3 * t)) % 1000};{u:g};{v:.2f}"

    path = write(tmp_path, [f"Date;Time;{name};torque [Nm];speed [rpm]"], row)
    path.write_text(path.read_text("utf-8").replace("23:59:00", "00:00:00"), "utf-8")
    same(path)


def test_read_recording__milliseconds_right_of_a_time_with_a_fraction__are_not_added_twice(tmp_path: Path) -> None:
    head = ["Time;ms;torque [Nm];speed [rpm]"]
    same(write(tmp_path, head, lambda t, u, v: f"12:00:00.{round(1e3 * t):03d};{round(1e3 * t)};{u:g};{v:.2f}"))


def test_read_recording__other_unit_in_the_header_than_behind_the_numbers__is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, ["time [ms];torque [Nm];speed [rpm]"], lambda t, u, v: f"{t:.3f} s;{u:g} Nm;{v:.2f} rpm")
    with pytest.raises(RecordingError, match=r"column 'time': its header gives the unit 'ms', its numbers have 's'"):
        read_recording(path, input="torque", outputs="speed:velocity")


def test_read_recording__units_behind_decimal_commas_between_blanks__keeps_the_columns(tmp_path: Path) -> None:
    row = "{0} s {1} Nm {2} rpm"
    path = write(tmp_path, ["a b c d e f"], lambda t, u, v: row.format(*(comma(x, ".3f") for x in (t, u, v))))
    recording = read_recording(path, input="c", outputs="e:velocity", time="a", units={"c": "N m", "e": "rpm"})
    np.testing.assert_allclose(recording.u, U, atol=6e-4)


def test_read_recording__unit_in_brackets_behind_numbers__is_read(tmp_path: Path) -> None:
    same(write(tmp_path, ["time;torque;speed"], lambda t, u, v: f"{t:.3f};{u:g} [Nm];{v:.2f} (rpm)"))
