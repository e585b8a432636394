"""Every bad input: one line on stderr that helps, exit code 2, no traceback, and nothing written."""

import os
import subprocess
import sys

import pytest

GOOD = ("--input", "torque", "--output", "speed", "--structure", "one_mass")


@pytest.fixture
def place(drive, tmp_path, monkeypatch):
    """Folder with good and bad files, which the program is started in."""
    good = (drive.folder / "a.csv").read_text()
    lines = good.splitlines(keepends=True)
    (tmp_path / "good.csv").write_text(good)
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "text.csv").write_text("".join([*lines[:99], "0.196,1.0,fast\n", *lines[100:]]))
    (tmp_path / "back.csv").write_text("".join([*lines[:199], "0.100,1.0,1.0\n", *lines[200:]]))
    (tmp_path / "model.json").write_text((drive.out / "model.json").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "file").write_text("mine")
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def state(folder):
    return {p.relative_to(folder): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


CASES = {
    "device as file": (("simulate", "model.json", "good.csv", "--out", "pipe"), ["'pipe' is a device or a pipe"]),
    "device as folder": (("identify", "good.csv", *GOOD, "--out", "pipe"), ["'pipe' is a device or a pipe"]),
    "device as model": (("analyse", "pipe"), ["model file 'pipe': it is a device or a pipe"]),
    "device as manifest": (("fleet", "pipe", *GOOD), ["manifest 'pipe': it is a device or a pipe"]),
    "no file": (("inspect",), ["Missing argument 'FILE'. For example: brightgrey inspect axis.csv"]),
    "folder as recording": (("inspect", "."), ["this is a folder, not a recording; name a file in it, e.g. back.csv"]),
    "address as recording": (("inspect", "https://a.org/b.csv"), ["this is an address; download the file first"]),
    "word as interval": (("check", "good.csv", "--dt", "SECONDS"), ["'--dt'", "a number is expected; 'SECONDS' came"]),
    "folder as model": (("analyse", "."), ["Is a directory; name the model.json in it"]),
    "recording as model": (("analyse", "good.csv"), ["is not JSON", "the model.json of an identification is wanted"]),
    "folder as manifest": (("fleet", ".", *GOOD), ["name the CSV or TOML file that lists the axes"]),
    "effect as argument": (("effects", "backlash"), ["extra argument", "For example: brightgrey effects"]),
    "commas in a structure": (
        ("identify", "good.csv", *GOOD[:5], "one_mass,coulomb"),
        ["effects are joined by +, like one_mass+coulomb"],
    ),
    "unit before its column": (("check", "good.csv", *GOOD[:4], "--unit", "rpm=speed"), ["write 'speed=rpm'"]),
    "absurd interval": (("check", "good.csv", *GOOD[:4], "--dt", "1e308", "--window", "0:5"), ["1e+308 s"]),
    "gain too small": (("identify", "good.csv", *GOOD, "--input-gain", "1e-308"), ["'torque' reaches", "no drive"]),
    "blanks in a structure": (("identify", "good.csv", *GOOD[:5], "one_mass", "+", "coulomb"), ["needs quotes"]),
    "seed of text": (("identify", "good.csv", *GOOD, "--seed", "x"), ["'--seed'", "'x' came"]),
    "no workers": (("identify", "good.csv", *GOOD, "--workers=0"), ["'--workers'", "'0' came"]),
    "unknown search": (("identify", "good.csv", *GOOD[:4], "--search", "exhaustiv"), ["Did you mean 'exhaustive'?"]),
    "unknown wish": (
        ("identify", "good.csv", *GOOD[:4], "--require", "colomb"),
        ["Did you mean 'coulomb'?"],
    ),
    "unknown effect": (
        ("identify", "good.csv", *GOOD[:5], "one_mas"),
        ["'one_mas'", "Did you mean 'one_mass'?"],
    ),
    "broken rule": (("identify", "good.csv", *GOOD[:5], "one_mass+backlash"), ["backlash", "no shaft 1"]),
    "two ladders": (("identify", "good.csv", *GOOD[:5], "one_mass+two_mass"), ["exactly one"]),
    "missing column": (
        ("identify", "good.csv", "--input", "torqe", *GOOD[2:]),
        ["good.csv", "'torqe'", "Did you mean 'torque'?"],
    ),
    "unknown kind": (
        ("identify", "good.csv", *GOOD[:3], "speed:velocty", *GOOD[4:]),
        ["'velocty'", "'velocity'"],
    ),
    "text in a number column": (("identify", "text.csv", *GOOD), ["text.csv", "row 100", "speed", "'fast'"]),
    "empty file": (("identify", "empty.csv", *GOOD), ["empty.csv", "empty"]),
    "time backwards": (("identify", "back.csv", *GOOD), ["back.csv", "row 200", "backwards"]),
    "no such file": (("identify", "god.csv", *GOOD), ["god.csv", "'good.csv'"]),
    "a folder": (("identify", ".", *GOOD), ["folder"]),
    "low above high": (("identify", "good.csv", *GOOD, "--bound", "J1=2:1"), ["J1", "low 2", "high 1"]),
    "empty bound": (("identify", "good.csv", *GOOD, "--bound", "J1=1:1"), ["J1", "fix"]),
    "bound of another": (("identify", "good.csv", *GOOD, "--bound", "J2=1:2"), ["'J2'", "'J1'"]),
    "bound without colon": (("identify", "good.csv", *GOOD, "--bound", "J1=1"), ["'J1=1'", "NAME=LOW:HIGH"]),
    "bound of text": (("identify", "good.csv", *GOOD, "--bound", "J1=1:x"), ["J1", "'x'"]),
    "bound in per cent of nothing": (
        ("identify", "good.csv", *GOOD, "--bound", "J1=50%:200%"),
        ["J1=50%:200%", "HIGH% of VALUE"],
    ),
    "bound half in per cent": (
        ("identify", "good.csv", *GOOD, "--bound", "J1=50%:2 of 0.1"),
        ["J1=50%:2 of 0.1", "HIGH% of VALUE"],
    ),
    "initial of another kind": (("identify", "good.csv", *GOOD, "--initial", "restt"), ["'restt'", "'rest'"]),
    "bound twice": (
        ("identify", "good.csv", *GOOD, "--bound", "J1=1:2", "--bound", "J1=1:3"),
        ["more than once"],
    ),
    "negative inertia": (("identify", "good.csv", *GOOD, "--bound", "J1=-1:1"), ["J1", "positive"]),
    "fixed at text": (("identify", "good.csv", *GOOD, "--fix", "J1=big"), ["J1", "'big'"]),
    "fixed below zero": (("identify", "good.csv", *GOOD, "--fix", "J1=-2"), ["J1", "-2"]),
    "fixed and bounded": (("identify", "good.csv", *GOOD, "--fix", "J1=2", "--bound", "J1=1:3"), ["both"]),
    "unknown hold": (("identify", "good.csv", *GOOD, "--hold", "liner"), ["'liner'", "'linear'"]),
    "window of text": (("identify", "good.csv", *GOOD, "--window", "1"), ["--window", "A:B"]),
    "window turned round": (("identify", "good.csv", *GOOD, "--window", "2:1"), ["2:1"]),
    "window elsewhere": (("identify", "good.csv", *GOOD, "--window", "50:60"), ["good.csv"]),
    "no decimation": (("identify", "good.csv", *GOOD, "--decimate", "0"), ["--decimate"]),
    "f_tanh": (("identify", "good.csv", *GOOD, "--f-tanh", "-1"), ["f_tanh", "-1", "s/rad"]),
    "unknown unit": (("identify", "good.csv", *GOOD, "--unit", "speed=rad/sec2x"), ["unit"]),
    "unit of no column": (("identify", "good.csv", *GOOD, "--unit", "sped=rad/s"), ["'sped'", "'speed'"]),
    "unit without equals": (("identify", "good.csv", *GOOD, "--unit", "speed"), ["'speed'", "COLUMN=UNIT"]),
    "start that is no model": (
        ("identify", "good.csv", *GOOD, "--start", "good.csv"),
        ["good.csv", "not JSON"],
    ),
    "test recording": (("identify", "good.csv", *GOOD, "--test-recording", "no.csv"), ["no.csv"]),
    "output folder is a file": (("identify", "good.csv", *GOOD, "--out", "file"), ["'file'", "folder"]),
    "output below a file": (("identify", "good.csv", *GOOD, "--out", "file/out"), ["'file'"]),
    "demo into a file": (("demo", "--out", "file"), ["'file'", "folder"]),
    "unknown option": (("identify", "good.csv", *GOOD, "--hodl", "zoh"), ["--hodl", "--hold"]),
    "unknown command": (("identfy",), ["'identfy'", "'identify'"]),
    "no recording": (("identify", *GOOD), ["RECORDING"]),
    "no input": (("identify", "good.csv", *GOOD[2:]), ["--input"]),
    "no model": (("simulate", "modl.json", "good.csv"), ["modl.json"]),
    "model is no model": (("simulate", "good.csv", "good.csv"), ["not JSON"]),
    "simulate bad file": (("simulate", "model.json", "text.csv"), ["row 100"]),
    "simulate into folder": (("simulate", "model.json", "good.csv", "--out", "."), ["folder"]),
    "simulate below a file": (("simulate", "model.json", "good.csv", "--out", "file/x.csv"), ["'file'"]),
}


@pytest.mark.parametrize("case", CASES)
def test_one_line_exit_code_2_nothing_written(place, call, case):
    arguments, words = CASES[case]
    before = state(place)
    done = call(*arguments)
    assert done.code == 2
    assert done.out == ""
    assert len(done.err.splitlines()) == 1
    for word in words:
        assert word in done.err
    assert str(place) not in done.err
    assert state(place) == before


def test_in_a_process_of_its_own(place):
    before = state(place)
    done = subprocess.run(
        [sys.executable, "-m", "brightgrey", "identify", "text.csv", *GOOD],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("brightgrey: text.csv: row 100")
    assert len(done.stderr.splitlines()) == 1
    assert state(place) == before


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_folder_that_may_not_be_written_to(place, call):
    (place / "locked").mkdir(mode=0o500)
    done = call("identify", "good.csv", *GOOD, "--out", "locked/out")
    assert done.code == 2
    assert "no permission" in done.err


def test_identify__wrong_column__is_told_before_the_simulator_is_compiled(place, call, monkeypatch):
    def compile_kernel(*, silent):
        raise AssertionError("compiled")

    monkeypatch.setattr("brightgrey.cli.terminal.compilation.compile_kernel", compile_kernel)
    done = call("identify", "good.csv", "--input", "torqe", *GOOD[2:])
    assert done.code == 2
    assert "Did you mean 'torque'?" in done.err
