"""Parameters that differ between recordings: the friction of a drive that was recorded cold and warm."""

import json

import numpy as np
import pytest

from brightgrey import identify
from brightgrey.api.to_si import identification_task
from brightgrey.errors import SettingsError
from brightgrey.estimation import fit
from brightgrey.kit import Structure
from brightgrey.search.fitting.structure_fit import Options, fit_multistart
from support.drives import recorded, values_of

TEXT = "one_mass+coulomb+viscous"
TRUE = values_of(TEXT)
FRICTION = tuple(factor * TRUE["f_v"] for factor in (1.4, 1.0, 0.7))
CHANGED_WEIGHT = (-2.0, 0.5, 3.0)


def recordings(parameter="f_v", values=FRICTION, text=TEXT):
    return [recorded(text, seed, **{parameter: value}) for seed, value in enumerate(values)]


@pytest.fixture(scope="module")
def differing():
    return fit(Structure.parse(TEXT), recordings(), per_recording=("f_v",), starts=4, patience=1)


def test_viscous_friction_that_differs__each_value_is_within_its_interval(differing):
    for truth, found in zip(FRICTION, differing.in_recordings["f_v"], strict=True):
        assert found.ci95[0] < truth < found.ci95[1]
        assert 0.0 < found.std < 0.1 * truth


def test_viscous_friction_that_differs__estimate_is_geometric_mean_with_spread(differing):
    mean = differing.estimates["f_v"]
    assert mean.value == pytest.approx(np.prod([e.value for e in differing.in_recordings["f_v"]]) ** (1 / 3), rel=1e-9)
    assert mean.between == pytest.approx(np.std(FRICTION, ddof=1), rel=0.1)
    assert differing.values_in(2)["f_v"] == differing.in_recordings["f_v"][2].value
    assert differing.values_in(2)["J1"] == differing.estimates["J1"].value


def test_viscous_friction_that_differs__residual_is_the_noise(differing):
    common = fit(Structure.parse(TEXT), recordings(), starts=4, patience=1)
    (own,), (together,) = differing.train.values(), common.train.values()
    assert own.rmse == pytest.approx(0.02, rel=0.05)
    assert together.rmse > 1.4 * own.rmse
    assert common.outcome.kind == "recordings disagree"
    assert "--per-recording f_v" in common.outcome.text
    assert differing.outcome.kind == "converged"


def test_gravity_that_differs__mean_and_values_are_arithmetic():
    text = f"{TEXT}+gravity"
    found = fit(
        Structure.parse(text), recordings("M_G", CHANGED_WEIGHT, text), per_recording=("M_G",), starts=4, patience=1
    )
    for truth, estimate in zip(CHANGED_WEIGHT, found.in_recordings["M_G"], strict=True):
        assert estimate.ci95[0] < truth < estimate.ci95[1]
    assert found.estimates["M_G"].value == pytest.approx(np.mean([e.value for e in found.in_recordings["M_G"]]))


@pytest.mark.long
def test_intervals_in_recordings__cover_95_percent():
    covered = []
    for seed in range(20):
        several = [recorded(TEXT, 100 * seed + k, f_v=value) for k, value in enumerate(FRICTION)]
        found = fit(Structure.parse(TEXT), several, per_recording=("f_v",), start=TRUE, starts=1, patience=0)
        covered += [
            e.ci95[0] < truth < e.ci95[1] for truth, e in zip(FRICTION, found.in_recordings["f_v"], strict=True)
        ]
    assert np.mean(covered) >= 0.87  # less than one in a thousand of 60 with coverage 0.95 falls below


def test_search_with_a_parameter_that_differs__every_structure_has_its_deviations():
    task = identification_task(recordings(), None, {}, {}, None, ("f_v",))
    found = fit_multistart(task, Structure.parse(TEXT), Options(fresh=4, patience=0), 0)
    assert {"f_v#1", "f_v#2"} <= set(found.values)
    assert found.values["f_v#1"] == pytest.approx(np.log(FRICTION[0] / np.prod(FRICTION) ** (1 / 3)), abs=0.05)
    assert "f_v#1" not in task.space(Structure.parse("one_mass+coulomb"), nuisances=True).names


def test_model_of_a_parameter_that_differs__has_each_value_and_predicts_each_recording():
    several = recordings()
    result = identify(several, TEXT, per_recording=["f_v"], starts=4)
    part = json.loads(result.model.text())["parameters"]["f_v"]
    assert [own["value"] for own in part["in_recordings"]] == pytest.approx(FRICTION, rel=0.05)
    assert part["in_recordings"][0]["ci95"][0] < part["in_recordings"][0]["value"]
    for trace in result.traces:
        assert np.std(trace.residual[0]) == pytest.approx(0.02, rel=0.15)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"per_recording": ["f_w"]}, "unknown parameter 'f_w'"),
        ({"per_recording": ["f_v"], "fixed": {"f_v": 1.0}}, "f_v is fixed and may differ"),
        ({"per_recording": "f_v"}, "several parameters"),
    ],
)
def test_parameter_that_cannot_differ__is_refused_by_name(asked, said):
    with pytest.raises(SettingsError, match=said):
        identify(recordings(), TEXT, **asked)


def test_parameter_that_may_differ__one_recording__more_are_asked_for():
    with pytest.raises(SettingsError, match="one recording came"):
        identify(recordings()[0], TEXT, per_recording=["f_v"])
