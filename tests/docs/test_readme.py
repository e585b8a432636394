"""The README: its commands and its Python run as they stand there."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
COMMANDS = [line.split(" #")[0].strip() for line in re.findall(r"^    (brightgrey .*)$", README, re.MULTILINE)]
PYTHON = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)


def run(folder, *command):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_readme__short_enough_and_has_its_picture():
    assert len(README.splitlines()) <= 150
    for picture in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README):
        assert (Path(__file__).parents[2] / picture).is_file()


@pytest.mark.long
def test_readme__commands_and_python__run_one_after_the_other(tmp_path):
    run(tmp_path, sys.executable, "-m", "brightgrey", "demo", "--out", "demo")
    shutil.copy(tmp_path / "demo" / "recording.csv", tmp_path / "drive.csv")
    assert len(COMMANDS) >= 6
    for command in COMMANDS:
        assert run(tmp_path, sys.executable, "-m", *shlex.split(command))
    shutil.rmtree(tmp_path / "out")
    assert float(run(tmp_path, sys.executable, "-c", PYTHON).splitlines()[-1]) > 99.0
    for name in ("drive.svg", "fit.pdf", "out/report.html", "out/model.json"):
        assert (tmp_path / name).stat().st_size > 1000
