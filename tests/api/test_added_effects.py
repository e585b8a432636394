"""A model with an effect that no verdict demands, added for the fit, which left-out recordings do not contradict.

The choice itself is replaced here: any optional effect will do to see what is made of it.
"""

import csv
import json

import pytest

from brightgrey import identify, load_model, plan, selftest
from brightgrey.app.desk.structures import run_structures
from brightgrey.search import decision
from support.planning import QUICK
from support.self_tests import LEFT_OUT, read_small
from support.small_runs import recording_csv

FIRST, ADDED = "one_mass+coulomb+viscous", "stribeck"
SEARCH = {"grammar": "paper", "require": ("one_mass",), "exclude": [e for e in LEFT_OUT if e != ADDED]}


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder, recordings = tmp_path_factory.mktemp("three"), []
    for k in range(3):
        (folder / f"{k}.csv").write_text(recording_csv(seed=k))
        recordings.append(read_small(folder / f"{k}.csv"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decision, "extended_unless_contradicted", lambda d, _, first, *more: d.with_effect(first, ADDED))
        return identify(recordings, **SEARCH)


@pytest.fixture(scope="module")
def run(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    result.write(folder)
    return folder


def test_model__effect_added__is_that_of_all_files(run):
    model = load_model(run / "model.json")
    assert model.structure.names == ("one_mass", "coulomb", "viscous", ADDED)
    assert model.ties.minimal == (FIRST,)
    assert set(model.ties.left_out) == {FIRST, str(model.structure)}
    assert all(len(fits) == 3 and min(fits) > 95.0 for fits in model.ties.left_out.values())
    with (run / "ranking.csv").open(encoding="utf-8", newline="") as file:
        assert next(csv.DictReader(file))["structure"] == str(model.structure)
    assert json.loads((run / "run.json").read_text())["fits"][0]["structure"] == str(model.structure)
    assert run_structures(str(run))[0]["name"] == str(model.structure)


def test_words__effect_added__say_what_it_predicts(result, run):
    page = (run / "report.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert "The model adds Stribeck friction. Then it predicts each recording from the others to 99.6, 99.6" in page
    (card,) = (c for c in result.evidence.cards if c.effect == ADDED)
    assert card.verdict != "needed"
    assert card.reason.endswith("with it the fit is notably better, and predictions do not contradict.")


def test_plan__effect_added__questions_are_those_of_the_model(run):
    planned = plan(run, limits={"torque": 2.5, "travel": 3.0}, effort=QUICK)
    assert planned.drive.model.structure == load_model(run / "model.json").structure


def test_selftest__effect_added__simulates_the_model(result):
    tested = selftest(result, draws=1, fast=True)
    assert tested.structure == str(result.model.structure)
