"""Units of drives on the command line: a model of scaled columns is simulated, and its command is repeated."""

import json

import numpy as np
import pytest

from brightgrey import read_manifest
from brightgrey.cli.options.recording import RecordingOptions

# The drive of these tests has --f-tanh 4 in s/rad; here speeds stand in turns.
STRUCTURE = ("--structure", "one_mass+coulomb+viscous", "--f-tanh", str(8 * np.pi))


@pytest.fixture(scope="module")
def scaled(drive, tmp_path_factory):
    """Recording of the drive with its torque in % of 4 N m and its speed in increments, and the same in SI."""
    folder = tmp_path_factory.mktemp("scaled")
    t, torque, speed = np.loadtxt(drive.folder / "a.csv", delimiter=",", skiprows=1).T
    counts = speed / (2 * np.pi) * 10_000
    header = "t [s],torque [%],speed [inc/s]"
    path = folder / "scaled.csv"
    np.savetxt(path, np.column_stack([t, 25.0 * torque, counts]), fmt="%.9g", delimiter=",", header=header, comments="")
    return path


def test_identify__columns_in_percent_and_increments__gives_the_model_in_units(drive, scaled, tmp_path, call):
    options = ("--input", "torque", "--output", "speed", "--rated", "torque=4 N m", "--counts", "speed=10000")
    done = call("identify", scaled, *options, *STRUCTURE, "--out", tmp_path / "out")
    assert (done.code, done.err) == (0, "")
    model = json.loads((tmp_path / "out" / "model.json").read_text())
    plain = json.loads((drive.out / "model.json").read_text())
    for name in ("J1", "M_C"):
        # The motion is shown in turns; a torque is the same, an inertia 2 pi times as large.
        factor = 2 * np.pi if name == "J1" else 1.0
        assert model["parameters"][name]["value"] == pytest.approx(
            factor * plain["parameters"][name]["value"], rel=1e-4
        )
    simulated = call("simulate", tmp_path / "out" / "model.json", scaled, "--json")
    assert (simulated.code, simulated.err) == (0, "")
    fit = json.loads(simulated.out)["speed"]["fit_percent"]
    assert fit == pytest.approx(model["fit"]["train"]["speed"]["fit_percent"], abs=1e-3)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--rated", "torque=4"), "expected a number and a unit"),
        (("--rated", "torqe=4 N m"), "Did you mean 'torque'"),
        (("--counts", "speed=many"), "--counts speed: 'many' is not a number"),
        (("--gear", "speed=0"), "not a finite number other than zero"),
        (("--torque-constant", "0.1 V"), "no torque or force per current"),
    ],
)
def test_identify__value_that_does_not_fit__ends_with_one_line(scaled, tmp_path, call, option, message):
    columns = ("--input", "torque", "--output", "speed", "--unit", "torque=A")
    done = call("identify", scaled, *columns, *option, *STRUCTURE, "--out", tmp_path / "out")
    assert done.code == 2
    assert message in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_identify__output_in_increments__asks_for_their_number(scaled, tmp_path, call):
    done = call("identify", scaled, "--input", "torque", "--output", "speed:velocity", "--out", tmp_path / "out")
    assert done.code == 2
    assert "--counts 'speed=4096'" in done.err
    assert done.err.count("\n") == 1


@pytest.mark.parametrize("form", ["csv", "toml"])
def test_manifest__units_of_drives__are_those_of_the_axis(scaled, tmp_path, form):
    if form == "csv":
        rows = f"recording,input,output,rated,counts\n{scaled},torque,speed,torque=4 N m,speed=10000\n"
    else:
        rows = (
            f"[[axis]]\nrecording = '{scaled}'\ninput = 'torque'\noutput = 'speed'\n"
            "rated = ['torque=4 N m']\ncounts = 'speed=10000'\n"
        )
    manifest = tmp_path / f"fleet.{form}"
    manifest.write_text(rows)
    (axis,) = read_manifest(manifest)
    recording = RecordingOptions().read(axis.recordings[0], axis.options)
    assert recording.input.unit == "N m"
    assert recording.outputs[0].unit == "rev/s"
