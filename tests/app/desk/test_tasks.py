"""What the desk answers, as plain data."""

import json

import pytest

from brightgrey.app.desk.drives import check_drive, drive_picture, effect_choices
from brightgrey.app.desk.recordings import apply_remedy, check_files, inspect_file, recording_course
from brightgrey.app.desk.results import gains, live_fit, result_parts, run_status
from brightgrey.app.workspace.project import AxisChoice
from brightgrey.errors import SettingsError
from support.small_runs import STRUCTURE, VALUES, recording_csv

pytestmark = pytest.mark.xdist_group("small searches")  # made once


@pytest.fixture
def toml(tmp_path):
    (tmp_path / "a.csv").write_text(recording_csv(samples=6000))
    path = tmp_path / "a.toml"
    path.write_text('recording = ["a.csv"]\ninput = "torque"\noutput = ["velocity:velocity"]\nwindow = "0.1:0.5"\n')
    return path


def test_inspect_file__suggests_options_as_a_recording_toml_has_them(tmp_path):
    (tmp_path / "a.csv").write_text(recording_csv())
    found = inspect_file(str(tmp_path / "a.csv"))
    assert found["options"] == {"input": "torque", "output": ["velocity:velocity"]}
    assert json.loads(json.dumps(found)) == found
    assert found["channels"][1]["spark"].startswith("<svg")


def test_recording_course__zoomed__shows_more_of_less(toml):
    whole = recording_course(str(toml), None, "a")
    part = recording_course(str(toml), (0.2, 0.3), "a")
    assert whole["layout"]["xaxis"]["range"][1] == pytest.approx(1.799)
    assert part["layout"]["xaxis"]["range"] == [0.2, 0.3]
    assert len(part["data"][0]["x"]) in range(100, 105)  # every sample, and one on each side
    assert len(whole["layout"]["annotations"]) == 4  # both ends of the window, in both panels
    assert len(part["layout"]["annotations"]) == 0


def test_recording_course__window_that_is_none__is_refused(toml):
    toml.write_text(toml.read_text().replace("0.1:0.5", "soon:"))
    with pytest.raises(SettingsError, match="'soon' is not a number"):
        recording_course(str(toml), None, "a")


def test_recording_course__option_that_is_no_number__is_refused(toml):
    toml.write_text(toml.read_text() + 'dt = "often"\n')
    with pytest.raises(SettingsError, match="dt 'often' is not a number"):
        recording_course(str(toml), None, "a")


def test_check_files__unreadable_recording__is_said_by_its_label(toml):
    toml.write_text(toml.read_text().replace('"torque"', '"torc"'))
    found = check_files([str(toml)], {"a.csv": "My axis"})
    assert found["grade"] == "stop"
    assert found["problems"][0].startswith("My axis")


def test_apply_remedy__twice__multiplies():
    once = apply_remedy({"input": "u", "input_gain": -1.0}, {"input_gain": -1.0, "gear": ["q=2"]})
    assert once == {"input": "u", "input_gain": 1.0, "gear": ["q=2"]}
    assert apply_remedy(once, {"gear": ["q=3"]})["gear"] == ["q=6"]


def test_check_drive__contradictions__are_said():
    def said(**more):
        return check_drive(AxisChoice(**more).model_dump())

    assert said() == ""
    assert "backlash" in said(certain=("backlash",), most_masses=1)
    assert "J9" in said(known=({"name": "J9", "low": "1"},))
    assert "not a number" in said(known=({"name": "J1", "low": "one"},))


def test_drive_picture__follows_the_choices():
    rotary = drive_picture("rotary", 2, 2, ["coulomb"], ["delay"])
    assert "Coulomb friction ?" not in rotary
    assert "Dead time" not in rotary
    assert "Viscous friction ?" in rotary
    assert "Linear axis" in drive_picture("linear", 1, 4, [], [])
    assert {"coulomb", "backlash"} <= {effect["name"] for effect in effect_choices()["effects"]}


def test_live_fit__of_a_structure__is_a_figure_or_nothing(toml):
    figure = live_fit([str(toml)], STRUCTURE, {**VALUES, "friction_width": 0.1}, "a")
    assert {"data", "layout", "label"} == set(figure)
    assert live_fit([str(toml)], STRUCTURE, {"J1": 0.02}, "a") is None


def test_live_fit__wide_reversal_of_friction__is_simulated_as_in_the_search(toml):
    def last_speed(width):
        figure = live_fit([str(toml)], STRUCTURE, {**VALUES, "M_C": 50.0, "friction_width": width}, "a")
        return abs(figure["data"][1]["y"][-1])

    assert last_speed(100.0) > 1.0
    assert last_speed(1e-3) < 1e-3  # it sticks


def test_run_status__and_result_parts__of_nothing(tmp_path):
    (status,) = run_status([str(tmp_path / "run-1")])
    assert (status["state"], status["has_results"]) == ("missing", False)
    with pytest.raises(SettingsError, match="report cannot be read"):
        result_parts(str(tmp_path), {})


def test_result_parts__names_of_recordings__are_those_that_came(small):
    found = result_parts(str(small.folder / "exhaustive"), {"a.csv": 'My "axis" <1>'})
    assert "My &quot;axis&quot; &lt;1&gt;" in found["sections"]["motion"]
    assert "<1>" not in found["sections"]["motion"]
    (status,) = run_status([str(small.folder / "exhaustive")])
    assert status["state"] == "finished"
    assert status["stage"]["minimal_words"] == ["one mass with Coulomb and viscous friction"]


def test_gains__of_a_model__come_with_margins_and_a_bode_plot(small):
    found = gains(str(small.folder / "exhaustive" / "model.json"), 5.0, None, 0.0)
    units = {name: unit for name, _, unit in found["gains"]}
    assert units == {
        "Position gain": "1/s",
        "Speed gain": "N m s/rad",
        "Reset time": "ms",
        "State feedback: speed of mass 1": "N m s/rad",
        "State feedback: integral of the speed error": "N m/rad",
    }
    assert [row[0] for row in found["margins"]] == ["speed loop", "whole cascade"]
    assert len(found["figure"]["data"]) == 4
    (slowed,) = gains(str(small.folder / "exhaustive" / "model.json"), 5.0, 0.5, 0.0)["notes"]
    assert "was slowed down to a settling time" in slowed
