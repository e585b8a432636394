"""What a folder with a run says to those who come later."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from brightgrey import identify_resumable, read_recording
from brightgrey.runs import Stop, read_status
from support.small_runs import call, results

pytestmark = pytest.mark.xdist_group("small searches")  # made once


def copied(small, tmp_path):
    return shutil.copytree(small.folder / "exhaustive", tmp_path / "copy")


def test_a_finished_run_prints_its_result_and_evaluates_nothing(small, tmp_path):
    folder = copied(small, tmp_path)
    before = read_status(folder)
    assert before.state == "finished"
    (folder / "model.json").unlink()
    (folder / "ranking.csv").write_text("changed")
    done = call(*small.searches["exhaustive"], "--workers", 1, "--out", folder)
    assert done.code == 0, done.err
    assert "was finished before" in done.out
    assert "One mass of " in done.out
    assert results(folder) == small.whole["exhaustive"]
    assert read_status(folder) == before
    done = call(*small.searches["exhaustive"], "--out", folder, "--json")
    assert done.out.encode() == small.whole["exhaustive"]["model.json"]


def test_another_request_is_refused_with_what_differs(small, tmp_path):
    folder = copied(small, tmp_path)
    before = results(folder)
    done = call(*small.searches["exhaustive"], "--seed", 7, "--exclude", "delay", "--out", folder)
    assert done.code == 2
    assert "seed was 0 and is 7" in done.err
    assert 'exclude was ["current_control", "two_mass"] and is ["current_control", "delay", "two_mass"]' in done.err
    assert "--restart" in done.err
    assert results(folder) == before
    other = tmp_path / "a.csv"
    text = (small.folder / "a.csv").read_text()
    other.write_text(text[:-2] + "9\n")
    done = call("identify", other, *small.searches["exhaustive"][2:], "--out", folder)
    assert done.code == 2
    assert "recording 1 has other samples, units or columns" in done.err
    assert "seed" not in done.err


def test_restart_begins_anew(small, tmp_path):
    folder = copied(small, tmp_path)
    arguments = (*small.searches["exhaustive"], "--seed", 1, "--out", folder, "--quiet")
    assert call(*arguments).code == 2
    assert call(*arguments, "--restart").code == 0
    assert json.loads((folder / "model.json").read_text())["seed"] == 1


def test_wrong_use_leaves_no_run_behind(small, tmp_path):
    done = call(*small.searches["exhaustive"], "--bound", "J9=1:2", "--out", tmp_path / "out")
    assert done.code == 2
    assert not (tmp_path / "out").exists()


def test_runs_are_listed(small, monkeypatch):
    done = call("runs", small.folder, "--json")
    assert done.code == 0, done.err
    rows = json.loads(done.out)
    assert [row["state"] for row in rows] == ["finished", "finished"]
    assert [row["request"]["search"] for row in rows] == ["auto", "genetic"]
    exhaustive, genetic = rows
    assert exhaustive["evaluations"] > 16
    assert genetic["generations"] == 4
    assert "one_mass" in exhaustive["stage"]["best"]
    for row in rows:  # the best that was tried on the way may have more than it needs
        model = json.loads((Path(row["folder"]) / "model.json").read_text(encoding="utf-8"))
        assert row["structure"].split("+") == model["structure"]
    stage = exhaustive["stage"]  # the border, for those who watch the search
    assert (stage["decided"], stage["left"]) == (len(stage["minimal"]) + len(stage["refuted"]), 0)
    assert all(ratio >= 1.0 for _, ratio in stage["refuted"])
    assert 50.0 < stage["fit_percent"] <= 100.0
    assert stage["values"]["J1"] > 0.0
    monkeypatch.chdir(small.folder)  # a long path would fold the table
    shown = call("runs", "genetic")
    assert "generations 3 of 3" in shown.out
    assert "genetic population: 6" in shown.out
    assert "versions: brightgrey " in shown.out
    assert not any(line.endswith((": None", ": []", ": {}")) for line in shown.out.splitlines())
    assert call("runs", small.folder / "nowhere").code == 2


def test_generations_are_kept_with_the_state_of_the_random_numbers(small):
    import sqlite3

    database = sqlite3.connect(f"file:{small.folder / 'genetic' / 'run.sqlite'}?mode=ro", uri=True)
    states = [json.loads(text) for (text,) in database.execute("SELECT state FROM generations ORDER BY number")]
    database.close()
    assert len(states) == 4
    rng = np.random.default_rng()
    for state in states:
        rng.bit_generator.state = state["random"]
        assert len(state["population"]) == 6
    assert len({str(s["random"]) for s in states}) == 4


def test_a_stop_that_did_not_interrupt_the_fit_of_a_given_structure__nothing_is_written(small, tmp_path):
    """Python drops a KeyboardInterrupt that is raised in a destructor; the request to stop is still there."""
    recording = read_recording(small.columns[0], input="torque", outputs=["velocity"])
    stop = Stop()
    stop.request()
    with pytest.raises(KeyboardInterrupt):
        identify_resumable(tmp_path / "out", recording, "one_mass+coulomb+viscous", stop=stop)
    assert not (tmp_path / "out").exists()


def test_a_given_structure_keeps_its_result_too(small, tmp_path):
    arguments = ("identify", *small.columns, "--structure", "one_mass+coulomb+viscous", "--out", tmp_path)
    assert call(*arguments).code == 0
    before = results(tmp_path)
    done = call(*arguments)
    assert "was finished before" in done.out
    assert results(tmp_path) == before
    other = call(*arguments, "--seed", 3)  # seconds of work are no loss
    assert other.code == 0, other.err
    assert json.loads((tmp_path / "model.json").read_text())["seed"] == 3
    assert call(*small.searches["exhaustive"], "--out", tmp_path, "--max-evaluations", 4).code == 0
    assert "structure was not given" in call(*arguments).err  # but those of a search are
    refused = call(*arguments[:-2], "--max-evaluations", 3, "--out", tmp_path)
    assert refused.code == 2
    assert "belong to a search" in refused.err
