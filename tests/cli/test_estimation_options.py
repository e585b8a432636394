"""Estimator, profile and findings, as a user meets them."""

import json

import numpy as np
import pytest

import brightgrey


def model_of(folder):
    return json.loads((folder / "model.json").read_text(encoding="utf-8"))


def test_pattern_search_with_a_profile(drive, tmp_path, call):
    around = [f"--bound={name}={0.5 * value}:{2 * value}" for name, value in drive.truth.items()]
    done = call(
        *("identify", drive.folder / "a.csv", *drive.options, *around),
        *("--estimator", "pattern-search", "--profile", "M_C", "--out", tmp_path),
    )
    assert done.code == 0, done.err
    assert "profile of M_C confirms the quadratic interval" in done.out
    model, squares = model_of(tmp_path), model_of(drive.out)
    for name, part in squares["parameters"].items():
        assert model["parameters"][name]["value"] == pytest.approx(part["value"], abs=0.3 * part["std"])
    profile = model["parameters"]["M_C"]["profile"]
    assert profile["quadratic"]
    assert profile["ci95"] == pytest.approx(model["parameters"]["M_C"]["ci95"], rel=0.01)
    assert model["parameters"]["J1"]["profile"] is None


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [("--estimator", "least-square", "Did you mean 'least-squares'"), ("--profile", "M_c", "Did you mean 'M_C'")],
)
def test_wrong_names_are_refused_in_one_line(drive, tmp_path, call, option, value, says):
    done = call("identify", drive.folder / "a.csv", *drive.options, option, value, "--out", tmp_path)
    assert done.code != 0
    assert says in done.err
    assert "Traceback" not in done.err


def test_several_recordings_show_their_scatter(drive, tmp_path, call):
    done = call("identify", drive.folder / "a.csv", drive.folder / "b.csv", *drive.options, "--out", tmp_path)
    assert done.code == 0, done.err
    assert "Standard deviation between the recordings" in done.out
    part = model_of(tmp_path)["parameters"]["J1"]
    assert 0.0 < part["between_recordings"] < 5 * part["std"]
    assert model_of(drive.out)["parameters"]["J1"]["between_recordings"] is None


def test_useless_recording_is_said_and_no_error(drive, tmp_path, call):
    rows = "".join(f"{0.002 * k:.3f},2.0,{0.01 * k:.2f}\n" for k in range(300))
    (tmp_path / "still.csv").write_text("t [s],torque [N m],speed [rad/s]\n" + rows)
    done = call("identify", tmp_path / "still.csv", *drive.options, "--out", tmp_path / "out")
    assert done.code == 0, done.err
    assert "torque never changes" in done.out
    assert model_of(tmp_path / "out")["outcome"]["kind"] == "not identifiable"


def test_result_analyses_its_residuals(drive):
    recording = brightgrey.read_recording(drive.folder / "a.csv", input="torque", outputs=["speed"])
    found = brightgrey.identify(recording, "one_mass+coulomb+viscous", f_tanh=4.0, starts=1).residuals()
    ((name, output),) = found
    assert (name, output) == ("a.csv", "speed")
    analysis = found[name, output]
    assert analysis.autocorrelation[0] == 1.0
    assert np.max(np.abs(analysis.autocorrelation[1:])) < 4 * analysis.band  # white noise was added
    assert not analysis.follows_input


def test_a_recording_that_begins_in_motion(drive, tmp_path, call):
    done = call("identify", drive.folder / "a.csv", *drive.options, "--window", "0.2:0.9", "--out", tmp_path)
    assert done.code == 0, done.err
    model = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
    assert set(model["settings"]["bounds"]) == set(drive.truth)
    assert abs(model["initial_state"][0]["state"]["v1"]["value"]) > 10 * drive.noise
    for name, truth in drive.truth.items():
        part = model["parameters"][name]
        # Normal errors stay within five standard deviations in all but 6e-7 of the seeds.
        assert abs(part["value"] - truth) < 5 * part["std"], name
