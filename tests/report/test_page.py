"""report.html: self-contained, with the numbers of model.json, and nothing in it that does not apply."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from brightgrey.estimation.diagnostics.second_opinion import TermOpinion
from brightgrey.kit import Placed
from brightgrey.model.model import Model
from brightgrey.model.ranking import Row
from brightgrey.model.trace import Trace
from brightgrey.recordings import Signal
from brightgrey.report.content import Content
from brightgrey.report.notebook import result_html
from brightgrey.report.page import page
from brightgrey.report.quantities.assembled_model import AssembledModel
from brightgrey.report.text.commissioning_sheet import commissioning_sheet
from brightgrey.report.text.headline import headline
from brightgrey.report.text.tables import parameter_rows, remarks
from brightgrey.search.evidence import EffectVerdict
from brightgrey.search.verdicts import Reason
from support.evidence import evidence_of
from support.html_reader import read

DOC = Path(__file__).parents[2] / "docs" / "reference" / "model-json.md"
ALWAYS = {"next", "drawing", "motion", "values", "commissioning", "model", "recording", "repeat"}
CARDS = (
    EffectVerdict("coulomb", "needed", 0.4, None, Reason("loss", {"ratio": 1.4})),
    EffectVerdict("delay", "not decidable", None, 0.0, Reason("masked", names=("<friction>",))),
)


@pytest.fixture
def data():
    """The example of the documentation."""
    return json.loads(re.findall(r"```json\n(.*?)```", DOC.read_text(encoding="utf-8"), re.DOTALL)[-1])


def trace_for(model, samples=400):
    t = 0.001 * np.arange(samples)
    measured = np.sin(30 * t)[None, :]
    simulated = 0.99 * measured + 1e-3 * np.random.default_rng(0).normal(size=measured.shape)
    return Trace("recording.csv", t, np.cos(7 * t), measured, simulated, model.input, model.outputs)


def content_for(model, **more):
    return Content(model, [trace_for(model)], **more)


def test_page__is_complete_and_loads_nothing(data):
    model = Model.check(data)
    html = page(content_for(model, notes=["a note"]))
    reader = read(html)
    assert reader.loads == []
    assert set(reader.tables) == {"parameters", "fit", "sheet", "effects", "signals", "settings"}
    assert len(html.encode()) < 5e6
    assert html.startswith("<!DOCTYPE html>")


def test_page__sections_that_do_not_apply__are_absent(data):
    model = Model.check(data)
    reader = read(page(content_for(model)))
    # This example has friction and a linear model; the recording is long enough for correlations.
    assert set(reader.sections) == ALWAYS | {"friction", "frequency", "residuals"}
    assert set(read(page(Content(model))).sections) == ALWAYS | {"friction"}
    data["structure"], data["parameters"] = ["one_mass"], {"J1": data["parameters"]["J1"]}
    assert "friction" not in read(page(content_for(Model.check(data)))).sections
    for text in reader.text.values():
        assert len(text.split()) > 5


def test_page__numbers__are_those_of_the_model(data):
    data["fit"]["test"] = {"velocity": {"rss": 8.1, "rmse": 0.0712, "fit_percent": 97.31}}
    model = Model.check(data)
    reader = read(page(content_for(model)))
    header, *rows = reader.tables["parameters"]
    columns = [dict(zip(header, row, strict=True)) for row in rows]
    for row in columns:
        part = model.parameters[row["Name"]]
        half_width = (part.ci95[1] - part.ci95[0]) / 2
        assert float(row["Value"]) == pytest.approx(part.value, abs=0.051 * half_width)
        assert float(row["±"]) == pytest.approx(half_width, rel=0.051)
        low, high = map(float, row["95 % interval"].split(" … "))
        assert (low, high) == pytest.approx(part.ci95, abs=0.051 * half_width)
        assert row["Unit"] == part.unit
    assert [row[:5] for row in reader.tables["fit"][1:]] == [
        ["velocity", "identified", "99.80", "0.04050", "rad/s"],
        ["velocity", "test", "97.31", "0.07120", "rad/s"],
    ]


def test_page__numbers__are_there_to_the_last_digit(data):
    data["fit"]["test"] = {"velocity": {"rss": 8.1 / 3, "rmse": 0.1 / 3, "fit_percent": 97.3 / 3}}
    model = Model.check(json.loads(Model.check(data).text()))
    exact = read(page(content_for(model))).exact
    assert exact["values"] == [part["value"] for part in data["parameters"].values()]
    fits = [data["fit"][on]["velocity"] for on in ("train", "test")]
    assert exact["motion"] == [
        *(fit[name] for fit in fits for name in ("fit_percent", "rmse", "rss")),
        data["criterion"]["value"],
    ]
    assert exact["commissioning"] == [entry.value for entry in commissioning_sheet(AssembledModel(model), {})]


def test_page__model_read_back__gives_the_same_text(data):
    model = Model.check(data)
    again = Model.check(json.loads(model.text()))
    assert page(content_for(model)) == page(content_for(again))


def test_page__markup_in_names_and_notes__is_escaped(data):
    data["signals"][1]["name"] = "<b>v & w</b>"
    data["fit"]["train"] = {"<b>v & w</b>": data["fit"]["train"].pop("velocity")}
    model = Model.check(data)
    html = page(content_for(model, notes=["note with <script>alert</script>"]))
    assert "<b>v" not in html
    assert "<script>alert" not in html
    assert read(html).tables["signals"][2][0] == "<b>v & w</b>"


def test_parameter_rows__bound_fixed_and_unknown__are_noted(data):
    data["parameters"]["J1"] |= {"at_bound": "high"}
    data["parameters"]["f_v"] |= {"std": None, "ci95": None}
    data["settings"]["fixed"] = {"M_C": 0.897}
    model = Model.check(data)
    notes = {row.name: row.note for row in parameter_rows(model)}
    assert notes == {"J1": "at its upper bound", "M_C": "fixed", "f_v": "uncertainty unknown"}
    assert [text.split(". ")[0].rstrip(".") for text in remarks(model)] == [
        "At its upper bound: inertia of mass 1 (J1)",
        "No uncertainty can be given for viscous friction (f_v)",
    ]
    html = page(content_for(model))
    assert all(text in html for text in remarks(model))


def test_parameter_rows__interval_drowns_the_estimate__not_identifiable(data):
    """As on the EMPS axis: 32 N with a half width of 9100 N is no zero."""
    data["parameters"]["M_C"] |= {"value": 32.4, "std": 4600.0, "ci95": [-9067.6, 9132.4]}
    model = Model.check(data)
    row = next(row for row in parameter_rows(model) if row.name == "M_C")
    assert (row.estimate, row.note) == ("32 ± 9100", "not identifiable")
    assert remarks(model) == [
        "Not identifiable: Coulomb friction (M_C). Half of the 95 % interval exceeds ten times the estimate."
    ]
    reader = read(page(content_for(model)))
    shown = next(cells for cells in reader.tables["parameters"] if cells[0] == "M_C")
    assert shown[1:3] == ["32", "9100"]
    assert "not identifiable" in shown
    assert "32 ± 9100" in result_html(content_for(model))


def test_page__diverged_model__says_so(data):
    data["fit"]["train"]["velocity"] = {"rss": None, "rmse": None, "fit_percent": None}
    data["criterion"] = None
    data["outcome"] = {"kind": "diverged", "text": "the simulation diverged at 0.1 s"}
    model = Model.check(data)
    assert headline(content_for(model)).fit == "The simulation of velocity diverges."
    lost = trace_for(model)
    simulated = np.where(lost.t > 0.1, np.nan, lost.simulated)
    html = page(Content(model, [replace(lost, simulated=simulated)]))
    assert "The simulation diverged at 0.1 s." in html
    assert "residuals" not in read(html).sections


def test_page__differenced_velocity__is_shown_as_such(data):
    data["signals"][1]["kind"] = "velocity-differenced"
    model = Model.check(data)
    assert model.outputs == (Signal("velocity", "velocity-differenced", "rad/s"),)
    assert read(page(content_for(model))).tables["signals"][2][1] == "velocity from encoder differences"


def test_page__after_a_search__shows_evidence_ties_and_ranking(data):
    data["evidence"] = {card.effect: card.verdict for card in CARDS}
    data["ties"] = {"minimal": ["one_mass+coulomb", "one_mass+stribeck"], "optional": ["delay"]}
    model = Model.check(data)
    evidence = evidence_of(CARDS)
    rows = [
        Row("one_mass+coulomb", 2, 1.0, 99.5, -10.0, True),
        Row("one_mass", 1, 4.0, 90.0, None),
        Row("one_mass+coulomb+viscous", 3, 1.0, 99.5, -9.0),
    ]
    reader = read(page(content_for(model, evidence=evidence, ranking=rows)))
    for card in CARDS:
        assert card.reason in reader.text["evidence"]
        assert card.verdict in reader.text["evidence"]
    assert "one mass with Stribeck friction" in reader.text["ties"]
    row = ["one mass with Coulomb friction", "2", "99.500", "-10.0000", "tied"]
    assert reader.tables["ranking"][1][1:] == row
    assert "structures" in reader.sections
    assert "structures" not in read(page(content_for(model, ranking=rows[:1]))).sections


def test_page__symptoms_and_differences__are_shown(data):
    data["ties"] = {"minimal": ["one_mass+coulomb", "one_mass+stribeck"], "optional": []}
    symptom = SimpleNamespace(title="Late input", observation="The torque comes 2 ms late.", advice="Look at the bus.")
    differences = [
        SimpleNamespace(structure="one_mass+coulomb", rows=(("delay margin", "1 ms"),)),
        SimpleNamespace(structure="one_mass+stribeck", rows=(("delay margin", "2 ms"),)),
    ]
    model = Model.check(data)
    reader = read(page(content_for(model, symptoms=[symptom], differences=differences)))
    for text in (symptom.title, symptom.observation, symptom.advice):
        assert text in reader.text["next"]
    assert "B one mass with Stribeck friction" in reader.text["ties"]
    assert reader.tables["differences"] == [
        ["Quantity", "A", "B"],
        ["delay margin", "1 ms", "2 ms"],
    ]


def test_page__second_opinion__in_units_of_the_model(data):
    model = Model.check(data)
    viscous = model.parameters["f_v"]
    opinions = [  # in SI, in which this model is, too
        TermOpinion((Placed("one_mass"),), ("J1",), model.parameters["J1"].value, model.parameters["J1"].value, 1e-5),
        TermOpinion((Placed("viscous"),), ("f_v",), viscous.value, -viscous.value, 0.1 * viscous.value),
    ]
    reader = read(page(content_for(model, second_opinion=opinions)))
    head, inertia, friction = reader.tables["opinions"]
    assert head[-1] == "Second opinion"
    assert inertia[0] == "Total inertia"
    assert inertia[-1] == "agrees"
    assert friction[0] == "Viscous friction"
    assert friction[-1] == "contradicts the fit"
    assert float(friction[3]) == pytest.approx(-viscous.value, rel=0.1)


def test_page__command__is_the_given_one_or_derived_from_the_model(data):
    model = Model.check(data)
    assert (
        "brightgrey demo --seed 3" in read(page(content_for(model, request="brightgrey demo --seed 3"))).text["repeat"]
    )
    made = read(page(content_for(model))).text["repeat"]
    for word in ("--input torque", "--output velocity:velocity", "--structure", "--seed 0"):
        assert word in made
    assert "--f-tanh" not in made  # the width is estimated again
    given = Model.check(data | {"settings": data["settings"] | {"friction_width_ci95": None}})
    assert "--f-tanh 2.5" in read(page(content_for(given))).text["repeat"]


def test_page__many_structures_that_differ_for_control__the_first_six_are_shown(data):
    data["ties"] = {"minimal": ["one_mass+coulomb"], "optional": []}
    differences = [
        SimpleNamespace(structure="one_mass+coulomb", rows=(("delay margin", f"{k} ms"),)) for k in range(30)
    ]
    reader = read(page(content_for(Model.check(data), differences=differences)))
    assert reader.tables["differences"] == [
        ["Quantity", *"ABCDEF"],
        ["delay margin", *(f"{k} ms" for k in range(6))],
    ]
    assert "24 more structures, which are ranked lower, are left out." in reader.text["ties"]
