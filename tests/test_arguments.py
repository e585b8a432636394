"""Natural mistakes in calls from Python are refused with the name of the argument and what came."""

import re

import numpy as np
import pytest

from brightgrey import (
    analyse,
    check,
    design,
    export,
    identify,
    inspect,
    load_model,
    read_recording,
    recording_from,
    simulate,
    watch,
)
from brightgrey.errors import BrightgreyError, SettingsError
from support.models import model_with_values
from support.recordings import make_recording

MODEL = model_with_values("one_mass", {"J1": 0.01})
K = np.arange(200)
RECORDING = make_recording(np.sin(0.1 * K), np.cos(0.1 * K))
COLUMNS = {"t": 1e-3 * K, "u": np.sin(0.1 * K), "v": np.cos(0.1 * K)}


def identified(**options):
    return identify(RECORDING, "one_mass", **options)


def made(**options):
    return recording_from(COLUMNS, **{"input": "u", "outputs": "v", **options})


CASES = {
    "a path as recording": (lambda: identify("a.csv"), "recordings is 'a.csv'"),
    "a path among recordings": (lambda: identify([RECORDING, "a.csv"]), "recordings is"),
    "a path to check": (lambda: check("a.csv"), "recordings is 'a.csv'"),
    "a path as test": (lambda: identified(test="a.csv"), "test is 'a.csv'"),
    "a path as start": (lambda: identified(start="model.json"), "start is 'model.json'; expected: a model"),
    "a path as model": (lambda: analyse("model.json"), "model is 'model.json'"),
    "a path to simulate": (lambda: simulate(MODEL, "a.csv"), "recording is 'a.csv'"),
    "a path as baseline": (lambda: watch(MODEL, RECORDING, baseline="a.csv"), "baseline is 'a.csv'"),
    "no workers": (lambda: identified(workers=0), "workers is 0; expected: a whole number from 1"),
    "no seed": (lambda: identified(seed=None), "seed is None"),
    "seed of 3.0": (lambda: identified(seed=3.0), "seed is 3.0"),
    "search of a number": (lambda: identify(RECORDING, search=3), "search is 3"),
    "half a seed": (lambda: identified(seed=1.5), "seed is 1.5"),
    "negative seed": (lambda: identified(seed=-1), "seed is -1"),
    "three bounds": (lambda: identified(bounds={"J1": (1, 2, 3)}), "bounds is"),
    "bound of text": (lambda: identified(bounds={"J1": "12"}), "bounds is"),
    "fixed text": (lambda: identified(fixed={"J1": "1"}), "fixed is"),
    "one effect": (lambda: identify(RECORDING, require="coulomb"), "require is 'coulomb'"),
    "unknown search": (lambda: identify(RECORDING, search="exhaustve"), "Did you mean 'exhaustive'"),
    "structure of a number": (lambda: identify(RECORDING, 3), "structure is 3"),
    "place of many digits": (lambda: identify(RECORDING, "one_mass+coulomb@" + "9" * 5000), "place '999"),
    "names as header": (lambda: read_recording("a.csv", input="u", outputs="v", header="t,u,v"), "header is 't,u,v'"),
    "delimiter of a number": (lambda: read_recording("a.csv", input="u", outputs="v", delimiter=3), "delimiter is 3"),
    "path of a number": (lambda: read_recording(3, input="u", outputs="v"), "path is 3"),
    "decimate inf": (lambda: made(decimate=float("inf")), "decimate is inf"),
    "decimate text": (lambda: made(decimate="2"), "decimate is '2'"),
    "window of one": (lambda: made(window=(1,)), "window"),
    "units as texts": (lambda: made(units=["u=N m"]), "units is"),
    "constant without unit": (lambda: made(torque_constant=0.05), "torque_constant is 0.05"),
    "output of a number": (lambda: made(outputs=[3]), "outputs is"),
    "array as columns": (lambda: recording_from(np.eye(30), input="1", outputs="2"), "columns is"),
    "huge whole numbers": (
        lambda: recording_from({**COLUMNS, "u": [10**400] * 200}, input="u", outputs="v"),
        "real numbers",
    ),
    "speed of text": (lambda: analyse(MODEL, speed="3"), "speed is '3'"),
    "speed inf": (lambda: analyse(MODEL, speed=float("inf")), "speed is inf"),
    "torque of text": (lambda: design(MODEL, torque="3"), "torque is '3'"),
    "path of a line": (lambda: load_model("x" * 3000), "cannot read model file"),
    "no file": (lambda: load_model(None), "path is None"),
    "recording as path": (lambda: inspect(RECORDING), "path is Recording"),
    "target of a number": (lambda: export(MODEL, 3, "out"), "to is 3"),
}


@pytest.mark.parametrize("name", CASES)
def test_functions__wrong_argument__is_refused_by_name(name):
    wrong, says = CASES[name]
    with pytest.raises(BrightgreyError, match=re.escape(says)):
        wrong()


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: made(unit={"u": "N m"}), "recording_from() has no argument 'unit'. Did you mean 'units'?"),
        (lambda: read_recording("a.csv", input="u", output="v"), "no argument 'output'. Did you mean 'outputs'?"),
        (lambda: export(MODEL, "c"), "export(): missing a required argument: 'folder'"),
    ],
)
def test_functions__argument_that_they_have_not__names_function_and_nearest(wrong, says):
    with pytest.raises(TypeError, match=re.escape(says)):
        wrong()


@pytest.mark.parametrize("start", [np.datetime64("2024-02-28T23:59:59.9"), np.timedelta64(0, "ns")])
def test_recording_from__dates_and_times__are_seconds_from_the_first(start):
    stamps = start + (K * 1_000_000).astype("timedelta64[ns]")
    recording = recording_from({**COLUMNS, "t": stamps}, input="u", outputs="v")
    assert recording.dt == pytest.approx(1e-3)
    assert recording.t[0] == 0.0


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        (COLUMNS | {"v": np.ones((200, 2))}, r"column 'v': .* \(200, 2\) came; give each of its columns a name"),
        (COLUMNS | {"v": np.ones((200, 1))}, r"\(200, 1\) came; give x\.ravel\(\)"),
        (COLUMNS | {"v": ["0,5"] * 200}, r"real numbers are expected \(.*0,5"),
    ],
)
def test_recording_from__column_of_another_kind__says_what_came(columns, says):
    with pytest.raises(BrightgreyError, match=says):
        recording_from(columns, input="u", outputs="v")


def test_functions__numbers_of_numpy__are_taken():
    recording = made(decimate=np.int64(1), input_gain=np.float32(2.0), gear={"v": np.float64(2.0)})
    assert recording.u[3] == pytest.approx(2.0 * np.sin(0.3))


def test_save__bad_path__is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    for path in (tmp_path, tmp_path / "file" / "model.json", None):
        with pytest.raises(SettingsError):
            MODEL.save(path)


def test_watch__other_signals__are_refused():
    other = make_recording(np.sin(0.1 * K), np.cos(0.1 * K), kind="position")
    with pytest.raises(BrightgreyError, match="the model was identified from"):
        watch(MODEL, other, baseline=other)
