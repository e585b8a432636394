"""Structures of a run: its motion in any detail, and two of them side by side."""

import json
from pathlib import Path

import numpy as np
import pytest

from brightgrey.app.desk.structures import beside_course, beside_tables, result_course, run_structures

pytestmark = pytest.mark.xdist_group("small searches")  # made once

FOUND, LESS = "one_mass+coulomb+viscous", "one_mass+viscous"


@pytest.fixture
def run(small):
    return str(small.folder / "exhaustive")


def test_run_structures__best_first__with_words_status_and_fit(run):
    found = run_structures(run)
    assert found[0]["name"] == FOUND
    assert found[0]["words"] == "one mass with Coulomb and viscous friction"
    assert found[0]["status"] == "one of the simplest that explain the recording"
    assert {"name", "words", "status", "fit"} == set(found[-1])
    assert json.loads(json.dumps(found)) == found
    assert LESS in [row["name"] for row in found]


def test_result_course__zoomed__has_every_sample_of_the_part_and_the_report_s_numbers(run):
    whole = result_course(run, None, 0, None)
    part = result_course(run, None, 0, (0.2, 0.25))
    assert part["layout"]["xaxis"]["range"] == [0.2, 0.25]
    assert len(part["data"][0]["x"]) in range(51, 54)
    model = json.loads((Path(run) / "model.json").read_text())
    residual = np.array(whole["data"][-1]["y"])  # of 600 samples none is left out
    assert np.sum(residual**2) == pytest.approx(model["fit"]["train"]["velocity"]["rss"], rel=1e-3)


def test_beside_tables__structure_without_an_effect__shows_what_it_changes(run):
    found = beside_tables(run, FOUND, LESS)
    assert ("Coulomb friction", "yes", "no", "needed") in found["effects"]
    assert [row[0] for row in found["parameters"]] == ["J1", "M_C", "f_v"]
    coulomb = next(row for row in found["parameters"] if row[0] == "M_C")
    assert coulomb[2] == coulomb[4] == ""
    ((recording, output, better, worse, *_),) = found["fits"]
    assert (recording, output) == ("a.csv", "velocity")
    assert float(better) > float(worse)
    assert found["status"][1] == "does not explain the recording"


def test_beside_course__zoomed__shows_both_and_their_residuals(run):
    figure = beside_course(run, FOUND, LESS, 0, (0.2, 0.3))
    assert [line["name"] for line in figure["data"]] == ["measured", "A", "B", "", ""]
    assert figure["layout"]["xaxis"]["range"] == [0.2, 0.3]
    residuals = [np.square(line["y"]).sum() for line in figure["data"][-2:]]
    assert residuals[0] < residuals[1]
