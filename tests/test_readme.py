"""What the README tells a newcomer to type works as it stands there."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from brightgrey.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [shlex.split(line, comments=True) for line in re.findall(r"^    (brightgrey .*)$", README, re.MULTILINE)]
(PYTHON,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def run(folder, *command):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.long
def test_readme__commands_and_python__run_in_their_order(tmp_path):
    """After the demo, whose recording stands for the drive's."""
    run(tmp_path, sys.executable, "-m", "brightgrey", "demo", "--out", "demo")
    shutil.copy(tmp_path / "demo" / "recording.csv", tmp_path / "drive.csv")
    assert {command[1] for command in COMMANDS} >= {"inspect", "check", "identify", "export", "plan", "selftest"}
    for command in COMMANDS:
        assert run(tmp_path, sys.executable, "-m", *command)
    shutil.rmtree(tmp_path / "out")
    assert float(run(tmp_path, sys.executable, "-c", PYTHON).splitlines()[-1]) > 99.0
    for name in ("drive.svg", "fit.pdf", "out/report.html", "out/model.json", "out/ranking.csv", "out/run.json"):
        assert (tmp_path / name).stat().st_size > 100


def test_readme__python__gives_what_it_prints(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "src" / "brightgrey" / "excitation" / "data", "demo")
    shutil.move("demo/demo.csv", "demo/recording.csv")
    exec(compile(PYTHON, "README.md", "exec"), {"__name__": "readme"})
    assert float(capsys.readouterr().out.splitlines()[-1]) > 99.0


def test_readme__names_options_that_exist(capsys):
    main(["identify", "--help"])
    offered = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out))
    named = set(re.findall(r"`(--[a-z][a-z-]+)", README))
    assert named <= offered


def test_readme__links_to_files_that_are_there():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).is_file(), target


def test_readme__at_most_150_lines():
    assert len(README.splitlines()) <= 150
