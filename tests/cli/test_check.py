"""``brightgrey check``: what it says, what it writes, and what `identify` makes of it."""

import json
import tomllib

import numpy as np
import pytest

from brightgrey import read_recordings

COLUMNS = ("--input", "torque", "--output", "speed")


@pytest.fixture(scope="module")
def turned(drive, tmp_path_factory):
    """Recording of the drive with its torque turned round."""
    path = tmp_path_factory.mktemp("turned") / "axis.csv"
    t, torque, speed = np.loadtxt(drive.folder / "a.csv", delimiter=",", skiprows=1).T
    header = "t [s],torque [N m],speed [rad/s]"
    np.savetxt(path, np.column_stack([t, -torque, speed]), fmt="%.9g", delimiter=",", header=header, comments="")
    return path


def test_check__sound_recording__passes(drive, call):
    done = call("check", drive.folder / "a.csv", *COLUMNS)
    assert (done.code, done.err) == (0, "")
    assert "0 stop" in done.out


def test_check__sign_turned__stops_and_fix_writes_what_mends_it(turned, call):
    done = call("check", turned, *COLUMNS, "--fix")
    assert done.code == 1
    assert "slows the motion down" in done.out
    written = turned.parent / "recording.toml"
    assert tomllib.loads(written.read_text())["input_gain"] == -1.0
    again = call("check", written, "--all", "--json")
    assert again.code == 0
    found = json.loads(again.out)
    assert {r["grade"] for r in found["results"]} <= {"note", "passed"}
    refused = call("check", turned, *COLUMNS, "--fix")
    assert refused.code == 2
    assert "recording.toml exists" in refused.err
    written.unlink()


def test_identify__stop__is_refused_unless_told_otherwise(turned, tmp_path, call):
    fit = ("--structure", "one_mass", "--out", tmp_path / "out")
    done = call("identify", turned, *COLUMNS, *fit)
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert "--input-gain -1" in done.err
    assert "--no-check" in done.err
    done = call("identify", turned, *COLUMNS, *fit, "--no-check", "--quiet")
    assert (done.code, done.err) == (0, "")
    assert 'id="checks"' in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_identify_and_simulate__recording_toml__is_read_and_options_replace_its_own(drive, tmp_path, call):
    (tmp_path / "a.csv").write_bytes((drive.folder / "a.csv").read_bytes())
    path = tmp_path / "recording.toml"
    path.write_text('recording = "a.csv"\ninput = "torque"\noutput = "speed:velocity"\nwindow = "0:0.5"\n')
    (recording,) = read_recordings(path)
    assert recording.t[-1] == pytest.approx(0.5)
    done = call("identify", path, "--window", "0:1", "--structure", "one_mass", "--out", tmp_path / "out", "--no-check")
    assert (done.code, done.err) == (0, "")
    assert call("simulate", tmp_path / "out" / "model.json", path, "--json").code == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('input = "torque"', "names no recording"),
        ('recording = "a.csv"\ninptu = "torque"', "Did you mean 'input'"),
        ('recording = "a.csv"\ndecimate = "many"', "decimate 'many' is not a number"),
        ('recording = "a.csv"\ninput = "torque"', "no output is named"),
        ("recording = ", "is not TOML"),
    ],
)
def test_check__faulty_recording_toml__one_line(tmp_path, call, text, message):
    (tmp_path / "recording.toml").write_text(text)
    done = call("check", tmp_path / "recording.toml")
    assert done.code == 2
    assert message in done.err
    assert done.err.count("\n") == 1


def test_identify__no_input_named__says_which_option(drive, tmp_path, call):
    done = call("identify", drive.folder / "a.csv", "--output", "speed", "--out", tmp_path / "out")
    assert done.code == 2
    assert "--input is missing" in done.err
