"""What a terminal shows while a search runs; and that scripts, pipes and colourless windows get plain text."""

import os
import re
import subprocess
import sys

import pytest

pty = pytest.importorskip("pty", reason="no pseudo terminals on this system")
FAST = [
    word for name in ("two_mass", "stribeck", "gravity", "current_control", "delay") for word in ("--exclude", name)
]


def on_terminal(*arguments, width, **environment):
    """Run the program on a pseudo terminal; all that it wrote there."""
    ours, theirs = pty.openpty()
    env = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(width), "LINES": "40", **environment}
    env.pop("CI", None)
    program = subprocess.Popen(
        [sys.executable, "-m", "brightgrey", *map(str, arguments)], stdin=theirs, stdout=theirs, stderr=theirs, env=env
    )
    os.close(theirs)
    parts = []
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        parts.append(part)
    os.close(ours)
    assert program.wait() == 0, b"".join(parts).decode()
    return b"".join(parts).decode()


@pytest.mark.system
@pytest.mark.parametrize("width", [80, 40])
def test_a_search_shows_how_far_it_is_and_the_time_left(drive, tmp_path, width):
    shown = on_terminal(
        *(
            "identify",
            drive.folder / "a.csv",
            *drive.options[:4],
            "--f-tanh",
            4,
            *FAST,
            "--search",
            "exhaustive",
            "--out",
            tmp_path,
        ),
        width=width,
    )
    assert re.search(r"\d+ s left", shown)
    assert re.search(r"\d+/4", shown)
    final = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown).replace("\r", "\n").splitlines()
    assert any(line.startswith("Coulomb") and "times as" in line for line in final)


@pytest.mark.system
def test_without_colour_there_is_none(drive):
    shown = on_terminal("simulate", drive.out / "model.json", drive.folder / "a.csv", width=80, NO_COLOR="1")
    codes = {code for found in re.findall(r"\x1b\[([0-9;]*)m", shown) for code in found.split(";") if code}
    assert not codes & {str(n) for n in (*range(30, 48), *range(90, 108))}


@pytest.mark.system
def test_what_is_piped_has_no_control_characters(drive, tmp_path):
    command = [
        sys.executable,
        "-m",
        "brightgrey",
        "identify",
        drive.folder / "a.csv",
        *drive.options,
        "--out",
        tmp_path,
    ]
    env = {k: v for k, v in os.environ.items() if k != "FORCE_COLOR"}
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True, env=env)
    assert "\x1b" not in done.stdout
    assert done.stderr == ""
    assert "J1" in done.stdout


def test_colour_that_is_forced_into_a_pipe__no_progress_and_no_complaint(drive, tmp_path, call, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    done = call("identify", drive.folder / "a.csv", *drive.options, "--out", tmp_path)
    assert (done.code, done.err) == (0, "")
    assert "J1" in done.out


def test_the_report_says_the_command_that_was_given(drive, tmp_path, call):
    done = call("identify", drive.folder / "a.csv", *drive.options, "--seed", 5, "--quiet", "--out", tmp_path)
    assert done.code == 0
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    (shown,) = re.findall(r'<pre id="command">(.*?)</pre>', html, re.DOTALL)
    command = re.sub("<.*?>", "", shown)
    assert command.startswith(f"brightgrey identify {drive.folder / 'a.csv'} --input torque --output speed")
    assert command.endswith("--f-tanh 4.0 --seed 5")
    for absent in ("--out", "--quiet", "--workers"):
        assert f"{absent} " not in command


def test_a_window_of_no_columns_gets_the_text_of_a_pipe(drive, call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "0")
    assert "sign of the input" in call("check", drive.folder / "a.csv", *drive.options[:4], "--all").out
