"""Exports of models with exact dry friction: each is run by its own tool chain."""

import importlib.util
import math
import re
import shutil

import numpy as np
import pytest

from brightgrey.exports.numeric_model import numeric_model
from brightgrey.exports.registry import EXPORTS, export, exporter
from brightgrey.exports.verification import deviation, verification_of, verification_run
from brightgrey.model.files import write_files
from support.models import first_period, random_model

NEEDS = {"c": "gcc", "fmu": "gcc", "matlab": "octave-cli"}
PACKAGES = {"fmu": "fmpy", "control": "control", "modelica": "rumoca"}
ALL = ("position", "velocity", "acceleration")


def dry(model):
    return numeric_model(model, math.inf)


def needs(to):
    if to in NEEDS and shutil.which(NEEDS[to]) is None:
        pytest.skip(f"{NEEDS[to]} is not installed")
    if to in PACKAGES and importlib.util.find_spec(PACKAGES[to]) is None:
        pytest.skip(f"{PACKAGES[to]} is not installed")


@pytest.mark.system
@pytest.mark.parametrize("to", ["c", "fmu", "matlab", "modelica"])
@pytest.mark.parametrize(
    ("structure", "hold"),
    [
        ("two_mass+coulomb+viscous+stribeck+gravity+current_control+delay", "linear"),
        ("one_mass+coulomb+stribeck", "zoh"),
        ("two_mass+coulomb+backlash", "linear"),
        ("two_mass+coulomb+coulomb@2+viscous@2+directional_viscous@2", "linear"),
    ],
)
def test_export__dry_friction__stops_and_moves_like_the_model(to, structure, hold, tmp_path):
    needs(to)
    numeric = dry(random_model(structure, 11, kinds=ALL, hold=hold))
    run = first_period(verification_of(numeric))
    assert (run.y[1, 10:] == 0.0).any()
    write_files(tmp_path, exporter(to).files(numeric))
    assert deviation(run.y, exporter(to).verify(tmp_path, numeric, run).y) <= 1e-6


@pytest.mark.system
@pytest.mark.parametrize("to", ["c", "fmu", "matlab", "modelica"])
@pytest.mark.parametrize("push", [0.9, 1.5])
def test_export__pushed_from_the_first_sample__breaks_away_at_once_or_never(to, push, tmp_path):
    needs(to)
    model = random_model("one_mass+coulomb+viscous", 11, kinds=ALL)
    numeric = dry(model)
    u = np.full(100, push * model.parameters["M_C"].value)
    run = verification_run(numeric, u, np.zeros(numeric.n), "a push")
    assert (run.y[:, 1:] > 0.0).all() if push > 1.0 else not run.y.any()
    write_files(tmp_path, exporter(to).files(numeric))
    y = exporter(to).verify(tmp_path, numeric, run).y
    np.testing.assert_allclose(y, run.y, atol=1e-6 * np.abs(run.y).max())


def test_export__solver_cannot_stop_a_mass__smooths_the_sign_and_says_so(tmp_path):
    needs("control")
    done = export(random_model("one_mass+coulomb+viscous", 11), "control", tmp_path, f_tanh=math.inf)
    assert done.good
    assert "sign smoothed within 0.004 rad/s" in done.text


@pytest.mark.parametrize("to", EXPORTS)
def test_export__dry_friction__writes_numbers_only(to):
    needs(to)
    files = exporter(to).files(dry(random_model("two_mass+coulomb+stribeck+backlash", 11)))
    for name, content in files.items():
        if name.endswith((".c", ".m", ".mo", ".py", ".tex")):
            assert re.search(r"\b(nan|inf|f_tanh = HUGE_VAL)\b", content.decode()) is None, name
