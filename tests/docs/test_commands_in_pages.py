"""Commands in the pages are commands of the program, and the ten recipes run as they stand."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from brightgrey.cli.program import app
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.simulation.reference import reference

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "docs" / "how-to" / "recipes.md"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("[!v]*/*.md")))
CHANNELS = ("v1", "q1", "q2")


def commands(text):
    """Lines of indented blocks that call the program, with those that go on after a backslash."""
    text = re.sub(r"\\\n\s*", "", text)
    return [shlex.split(line, comments=True) for line in re.findall(r"^    (brightgrey .*)$", text, re.MULTILINE)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_page__its_commands__are_understood(page):
    group = typer.main.get_command(app)
    for _, name, *arguments in (words for words in commands(page.read_text(encoding="utf-8")) if len(words) > 1):
        assert name in group.commands, name
        group.commands[name].make_context(name, arguments, resilient_parsing=False).close()


def recorded(folder):
    """Files of the recipes: the drive of the paper's experiment under every name that they use."""
    torque = np.round(E.torque(), 3)
    moved = reference(E.structure, E.values, torque, E.dt, f_tanh=E.f_tanh, outputs=CHANNELS)
    noise = 1e-3 * np.random.default_rng(4).standard_normal(moved.shape)
    v, q, load = moved + noise * np.max(np.abs(moved), axis=1, keepdims=True)
    t = E.dt * np.arange(torque.size)
    channels = {"t [s]": t, "torque [N m]": torque, "velocity [rad/s]": v, "position [rad]": q}
    tables = {
        "scope": {"t [s]": t, "torque [%]": 100.0 * torque / 9.84, "position [rad]": q},
        "run": channels | {"motor [rad]": q, "load [rad]": load},
        "axis": {"t [s]": t, "force [N]": torque, "position": 10.0 * q},
        "joint": {"t [s]": t, "motor_torque [N m]": torque / 120.0, "position [rad]": q},
        **dict.fromkeys(("before", "after"), channels),
    }
    for name, table in tables.items():
        rows = np.column_stack(list(table.values()))
        np.savetxt(folder / f"{name}.csv", rows, fmt="%.9g", delimiter=",", header=",".join(table), comments="")
    axes = "".join(
        f'[[axis]]\nname = "{name}"\nrecording = "{name}.csv"\ninput = "torque"\noutput = "velocity"\n'
        for name in ("before", "after")
    )
    (folder / "fleet.toml").write_text(axes, encoding="utf-8")


def run(folder, *words):
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout}\n{done.stderr}"


@pytest.mark.long
def test_recipes__every_one__runs_as_it_stands(tmp_path):
    _, *recipes = RECIPES.read_text(encoding="utf-8").split("\n## ")
    assert len(recipes) == 10
    for number, recipe in enumerate(recipes):
        folder = tmp_path / str(number)
        folder.mkdir()
        recorded(folder)
        for words in commands(recipe):
            run(folder, "-m", *words)
        for python in re.findall(r"```python\n(.*?)```", recipe, re.DOTALL):
            run(folder, "-c", python)
