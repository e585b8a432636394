"""What the readme tells a newcomer to type works as it stands there."""

import re
import shlex
from pathlib import Path

import pytest

from brightgrey.cli import main

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def commands():
    text = README.replace("\\\n", " ")
    lines = re.findall(r"^    brightgrey (.*)$", text, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


@pytest.mark.usefixtures("capsys")
def test_readme__commands_and_python_run_in_their_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert [command[0] for command in commands()] == ["demo", "effects", "identify", "simulate", "export"]
    for command in commands():
        assert main(command) == 0, command
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(code, "README.md", "exec"), {"__name__": "readme"})
    written = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    results = {"report.html", "model.json", "ranking.csv", "fit.svg", "run.json"}
    expected = {f"{folder}/{name}" for folder in ("demo", "out") for name in results}
    expected |= {f"out/export/drive.{kind}" for kind in ("c", "h", "fmu")}
    expected |= {"out/run.sqlite", "out/run.lock"}
    assert written == expected | {
        "demo/recording.csv",
        "out/simulated.csv",
        "demo/undecided.json",
        "fit.pdf",
        "friction.svg",
    }


def test_readme__names_options_that_exist(capsys):
    main(["identify", "--help"])
    offered = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out))
    named = set(re.findall(r"`(--[a-z][a-z-]+)", README))
    assert named <= offered


def test_readme__links_to_files_that_are_there():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (Path(__file__).parents[1] / target).is_file(), target
