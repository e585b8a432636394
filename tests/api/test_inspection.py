"""Inspection of files: guesses with reasons, and a command that reads the file."""

from __future__ import annotations

import html
import os
import shlex
from pathlib import Path

import numpy as np
import pytest
import typer

from brightgrey import RecordingError, inspect
from brightgrey.cli import app

N = 2000
T = 1e-3 * np.arange(N)
U = np.sign(np.sin(2 * np.pi * 2.0 * T)) + 0.2 * np.sin(2 * np.pi * 7.0 * T)
V = np.cumsum(U) * 0.05 - 0.02 * T
Q = np.cumsum(V) * 1e-3


def write(folder: Path, header: str, *columns: np.ndarray) -> Path:
    path = folder / "axis.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def accepted(command: str) -> list[str]:
    """Words of a command line that the program accepts."""
    program, name, *words = shlex.split(command)
    assert (program, name) == ("brightgrey", "identify")
    typer.main.get_command(app).commands["identify"].make_context("identify", list(words))
    return words


def test_inspect__named_channels__gives_the_command_with_reasons(tmp_path: Path) -> None:
    path = write(tmp_path, "t [s],torque [N m],speed [rad/s],speed_ref [rad/s]", T, U, V, V)
    found = inspect(path)
    assert accepted(found.command) == [str(path), "--input", "torque", "--output", "speed:velocity"]
    assert [meaning.words() for meaning in found.meanings] == ["time", "torque", "velocity", "setpoint velocity"]
    assert found.channels[1].dt == pytest.approx(1e-3)
    assert found.why[0] == "input 'torque': torque, its unit is N m"
    assert found.questions == ()


def test_inspect__numbered_sensors_of_one_axis__first_is_the_output_and_the_second_is_asked_for(tmp_path: Path) -> None:
    path = write(
        tmp_path, "t [s],torque [N m],pos1 [rad],vel1 [rad/s],pos2 [rad],vel2 [rad/s]", T, U, Q, V, 1.01 * Q, V
    )
    found = inspect(path)
    assert accepted(found.command) == [str(path), "--input", "torque", "--output", "pos1:position"]
    assert [meaning.words() for meaning in found.meanings] == ["time", "torque", *("position", "velocity") * 2]
    assert any("--output 'pos2:position@2'" in question for question in found.questions)


def test_inspect__numbers_in_brackets__next_one_is_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path, "t [s],torque [N m],vel[1] [rad/s],vel[2] [rad/s]", T, U, V, V)
    assert any("vel[2]" in question and "@2" in question for question in inspect(path).questions)


def test_inspect__no_header__finds_time_position_velocity_and_input(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(size=N)
    path = write(tmp_path, "1297.0,0,0,0,0", 1297.001 + T, noise, Q, U + 0.05 * noise, V)
    path.write_text(path.read_text().split("\n", 1)[1])
    found = inspect(path)
    words = accepted(found.command)
    assert words[1:7] == ["--input", "4", "--output", "3:position", "--time", "1"]
    assert any("the unit of '4' is not in the file" in question for question in found.questions)


def test_inspect__units_of_drives__are_asked_for_with_their_options(tmp_path: Path) -> None:
    path = write(tmp_path, "t [ms],Torque [%],Position [inc]", 1e3 * T, 50 * U, np.round(1e5 * Q))
    found = inspect(path)
    assert "--counts Position=COUNTS" in found.command
    assert any("--rated 'Torque=VALUE UNIT'" in question for question in found.questions)
    assert any("increments make a turn" in question for question in found.questions)


def test_inspect__no_time__asks_for_the_interval(tmp_path: Path) -> None:
    found = inspect(write(tmp_path, "torque_Nm,position_deg", U, np.round(np.rad2deg(Q), 6)))
    assert "--dt SECONDS" in found.command
    assert "--unit 'torque_Nm=N m' --unit position_deg=deg" in found.command
    assert any("put it in place of SECONDS in --dt" in question for question in found.questions)


def test_inspect__several_axes__takes_input_and_output_of_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    still = 1e-3 * rng.normal(size=(2, N))
    found = inspect(write(tmp_path, "t,current_1,pos_1,current_2,pos_2", T, still[0], still[1], U, Q))
    assert accepted(found.command)[1:5] == ["--input", "current_2", "--output", "pos_2:position"]
    assert any("--torque-constant" in question for question in found.questions)


@pytest.mark.parametrize(
    ("header", "option"),
    [
        ("t [s],torque [N m],v1 [rad/s],v2 [rad/s]", "--output 'v2:velocity@2'"),
        ("t [s],torque [N m],motor_speed [rad/s],load_speed [rad/s]", "--output 'load_speed:velocity@2'"),
        ("t [s],torque_1 [N m],v1 [rad/s],v2 [rad/s],torque_2 [N m]", ""),
        ("t [s],torque [N m],speed [rad/s],speed_ref [rad/s]", ""),
    ],
)
def test_inspect__sensor_that_may_be_at_the_second_mass__says_how_to_add_it(
    header: str, option: str, tmp_path: Path
) -> None:
    columns = (T, U, V, 0.6 * V + 0.2 * V.std() * np.sin(2 * np.pi * 20.0 * T), np.roll(U, 9))
    found = inspect(write(tmp_path, header, *columns[: header.count(",") + 1]))
    said = [question for question in found.questions if "second mass" in question]
    assert bool(said) == bool(option)
    assert all(option in question for question in said)


def test_inspect__many_samples__suggests_decimation(tmp_path: Path) -> None:
    k = np.arange(60_000)
    found = inspect(write(tmp_path, "t [s],torque [N m],speed [rad/s]", 1e-4 * k, np.sin(k / 500), np.cos(k / 500)))
    assert "--decimate 3" in found.command


@pytest.mark.parametrize(
    ("header", "problem"),
    [
        ("t,a,b", "no channel looks like a position or a velocity"),
        ("t,pos,b_ref_error", "no channel looks like a torque"),
    ],
)
def test_inspect__no_drive__says_what_is_missing(tmp_path: Path, header: str, problem: str) -> None:
    rng = np.random.default_rng(2)
    found = inspect(write(tmp_path, header, T, *rng.normal(size=(2, N))))
    assert found.command == ""
    assert problem in found.problem


def test_inspect__text_holes_and_constants__are_said(tmp_path: Path) -> None:
    path = write(tmp_path, "t,torque,speed,state", T, U, V, np.zeros(N))
    lines = path.read_text().splitlines()
    lines[100] = lines[100].rsplit(",", 2)[0] + ",,0"
    path.write_text("\n".join([lines[0] + ",mode", *(f"{line},RUN" for line in lines[1:])]))
    rows = {row[0]: row for row in inspect(path).rows()}
    assert rows["speed"][4] == "1"
    assert rows["state"][5] == "never changes"
    assert rows["mode"][3] == "text"


def test_inspect__unreadable_file__is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="there is no such file"):
        inspect(tmp_path / "no.csv")


def test_inspection__notebook__escapes_what_the_file_says(tmp_path: Path) -> None:
    page = inspect(write(tmp_path, "t,torque <b>,speed", T, U, V))._repr_html_()
    assert "<b>axis.csv</b>" in page
    assert html.escape("torque <b>") in page
    assert page.count("<svg") == 3
    assert "brightgrey identify" in page


DATA = Path(os.environ.get("BRIGHTGREY_DATA") or Path(__file__).parents[3] / "shared" / "data")
EXPECTED = {
    "emps/DATA_EMPS.mat": ("vir", "qm:position"),
    "epos/drive1_start_stop_200.csv": ("Torque actual value averaged", "Velocity actual value averaged:velocity"),
    "kuka/axis2_FF_A.csv": ("motor_torque_Nm", "position_deg:position"),
    "mte360/velocity_response_sine_3.mat": ("u", "v1:velocity"),
    "pendulum/sac_with_hole.csv": ("torque", "position:position"),
    "ur10e/joint_1.csv": ("14", "2:position"),
    "ur10e/joint_4.csv": ("17", "5:position"),
    "ur10e/joint_6.csv": ("19", "7:position"),
}


def measured_recordings() -> list[Path]:
    files = [path for path in sorted(DATA.rglob("*")) if path.suffix in (".csv", ".mat", ".tdms", ".mf4")]
    if not files:
        pytest.skip("measured recordings are not there (../shared/data, or BRIGHTGREY_DATA)")
    return files


def test_inspect__measured_recordings__have_the_columns_that_they_are_about() -> None:
    paths = {path.relative_to(DATA).as_posix(): path for path in measured_recordings()}
    for name, expected in EXPECTED.items():
        words = accepted(inspect(paths[name]).command)
        assert (words[2], words[4]) == expected, name


@pytest.mark.long
def test_inspect__every_measured_file__is_read() -> None:
    for path in measured_recordings():
        found = inspect(path)
        assert found.channels, path
        assert found.command or found.problem, path
        if found.command:
            accepted(found.command)
