"""Projects on the disk."""

import subprocess
import sys

import pytest

from brightgrey.app.workspace.folder import Workspace, recording_file_name, slug
from brightgrey.app.workspace.project import AxisChoice, KnownParameter
from brightgrey.errors import SettingsError
from brightgrey.recordings.recording_toml import load_recording_toml

HOSTILE = ["../../x.csv", "..\\..\\x.csv", "/etc/passwd", "a\0b.csv", "CON", ".", "", "x" * 500, "<b>.csv", "a\nb.csv"]


def test_workspace__project_saved_and_loaded__is_the_same(tmp_path):
    workspace = Workspace(tmp_path)
    made = workspace.create('X axis "5" – Fräse\x7f\U0001f600')
    assert made.name == "x-axis-5-frase-x7f"
    known = (KnownParameter(name="J1", low="0.1", high="0.2"), KnownParameter(name="c1", low="7"))
    changed = workspace.change(
        made.name, lambda d: d.model_copy(update={"drive": AxisChoice(known=known, limits={"torque": "5"})})
    )
    assert Workspace(tmp_path).load(made.name) == changed
    assert workspace.create(made.title).name == f"{made.name}-2"
    assert set(workspace.names()) == {made.name, f"{made.name}-2"}


@pytest.mark.parametrize("label", HOSTILE)
def test_add_recording__hostile_name__stays_below_the_project(tmp_path, label):
    workspace = Workspace(tmp_path / "w")
    name = workspace.create("a").name
    source = workspace.path(name) / "recordings" / ".upload"
    source.write_text("t,u\n")
    file = workspace.add_recording(name, source, label, "0" * 64, {"input": "u", "output": ["y:velocity"]})
    (entry,) = workspace.load(name).recordings
    assert entry.file == file
    assert entry.label.isprintable()
    assert entry.label
    assert {p.name for p in tmp_path.iterdir()} == {"w"}
    files, options = load_recording_toml(workspace.path(name) / "recordings" / f"{file.rpartition('.')[0]}.toml")
    assert files[0].is_file()
    assert options == {"input": "u", "output": ["y:velocity"]}
    workspace.remove_recording(name, file)
    assert list((workspace.path(name) / "recordings").iterdir()) == []


def test_recording_file_name__keeps_only_a_known_ending():
    assert recording_file_name("Axis 1.MAT", 3).startswith("recording-3-")
    assert recording_file_name("Axis 1.MAT", 3).endswith(".mat")
    assert recording_file_name("x.exe", 1).endswith(".dat")
    assert recording_file_name("x.csv", 1) != recording_file_name("x.csv", 1)


@pytest.mark.parametrize("name", ["..", "a/b", "a\\b", "", "A", "-a", "a" + "\0"])
def test_workspace__name_of_another_form__is_refused(tmp_path, name):
    with pytest.raises(SettingsError, match="small letters"):
        Workspace(tmp_path).load(name)


def test_workspace__damaged_document__names_what_is_wrong(tmp_path):
    workspace = Workspace(tmp_path)
    name = workspace.create("a").name
    file = workspace.path(name) / "project.toml"
    file.write_text(file.read_text().replace('motion = "rotary"', 'motion = "round"'))
    with pytest.raises(SettingsError, match=r"field 'drive\.motion'"):
        workspace.load(name)
    file.write_text("= 5")
    with pytest.raises(SettingsError, match="cannot be read"):
        workspace.load(name)
    with pytest.raises(SettingsError, match="no project 'b'"):
        workspace.load("b")


def test_usable_limits__leave_out_what_is_no_number_above_zero():
    given = {"torque": "5", "speed": "fast", "travel": "-1", "twist": "inf", "acceleration": "nan"}
    assert AxisChoice(limits=given).usable_limits == {"torque": 5.0}


def test_slug__of_any_title__is_a_name():
    assert slug("  X axis / 2 ") == "x-axis-2"
    assert slug("日本") == "project"


def test_workspace__held_by_another_process__is_refused_until_that_is_killed(tmp_path):
    held = "import sys, time; from brightgrey.app.workspace.folder import Workspace\n"
    held += "with Workspace(sys.argv[1]).only_here(): print('held', flush=True); time.sleep(60)"
    command = [sys.executable, "-c", held, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with (
            pytest.raises(SettingsError, match=r"open in .* already; go on in its page"),
            Workspace(tmp_path).only_here(),
        ):
            pass
        other.kill()
        other.wait()
        with Workspace(tmp_path).only_here():  # a lock ends with its process
            assert Workspace(tmp_path).names() == []
