"""``brightgrey inspect``: a table, plain in pipes and narrow windows, and a command that runs."""

import json
import shlex

import pytest


def test_inspect__recording__its_command_identifies_it(drive, tmp_path, call):
    done = call("inspect", drive.folder / "a.csv")
    assert (done.code, done.err) == (0, "")
    program, *words = shlex.split(done.out.splitlines()[-1])
    assert program == "brightgrey"
    ran = call(*words, "--structure", "one_mass+coulomb+viscous", "--out", tmp_path / "out", "--quiet")
    assert (ran.code, ran.err) == (0, "")
    assert (tmp_path / "out" / "model.json").is_file()


@pytest.mark.parametrize("width", [40, 80, 200])
def test_inspect__any_window__shows_names_and_the_whole_command(drive, call, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    out = call("inspect", drive.folder / "a.csv", drive.folder / "b.csv").out
    assert "\x1b" not in out
    lines = out.splitlines()
    assert all(len(line) <= width for line in lines if not line.startswith("brightgrey "))
    assert sum(line.startswith("brightgrey identify ") for line in lines) == 2
    assert "torque" in out
    assert ("█" in out) == (width >= 90)


def test_inspect__json__holds_the_same(drive, call):
    (found,) = json.loads(call("inspect", drive.folder / "a.csv", "--json").out)
    assert found["command"].endswith("--input torque --output speed:velocity")
    assert [channel["quantity"] for channel in found["channels"]] == ["time", "torque", "velocity"]


def test_inspect__control_characters_of_a_file__do_not_reach_the_terminal(tmp_path, call):
    path = tmp_path / "a.csv"
    path.write_text("t,\x1b[31mtorque\x07,speed\n" + "".join(f"{i},{i % 3},{i % 5}\n" for i in range(30)))
    out = call("inspect", path).out
    assert "\x1b" not in out
    assert "\x07" not in out


def test_inspect__missing_file__ends_with_one_line(tmp_path, call):
    done = call("inspect", tmp_path / "no.csv")
    assert done.code == 2
    assert done.err.count("\n") == 1
