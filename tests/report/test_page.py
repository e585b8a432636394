"""report.html: self-contained, and with the numbers of model.json."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from brightgrey.export.model import Model
from brightgrey.export.ranking import Row
from brightgrey.export.trace import Trace
from brightgrey.recordings import Signal
from brightgrey.report.page import page
from brightgrey.report.tables import parameter_rows, remarks, verdict
from brightgrey.search.evidence import Card, Evidence

DOC = Path(__file__).parents[2] / "docs" / "model-json.md"


@pytest.fixture
def data():
    """The example of the documentation."""
    return json.loads(re.findall(r"```json\n(.*?)```", DOC.read_text(encoding="utf-8"), re.DOTALL)[0])


def trace_for(model):
    t = 0.001 * np.arange(200)
    measured = np.sin(30 * t)[None, :]
    return Trace("recording.csv", t, np.cos(t), measured, 0.99 * measured, model.input, model.outputs)


class Reader(HTMLParser):
    """Cells of the tables by id, what the page loads, and whether every element is closed."""

    void = frozenset({"meta", "link", "br", "img", "hr", "input"})

    def __init__(self):
        super().__init__()
        self.open, self.loads, self.tables, self.table = [], [], {}, None

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.loads += [v for k, v in attrs if k in ("src", "href", "xlink:href") and not v.startswith("#")]
        if tag not in self.void:
            self.open.append(tag)
        if tag == "table":
            self.table = self.tables.setdefault(attributes.get("id"), [])
        if tag == "tr":
            self.table.append([])
        if tag in ("td", "th"):
            self.table[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        if self.open and {"td", "th"} & set(self.open):
            self.table[-1][-1] += text


def read(html):
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader


def test_page_is_whole_and_loads_nothing(data):
    model = Model.check(data)
    reader = read(page(model, [trace_for(model)], ["a note"]))
    assert reader.loads == []
    assert set(reader.tables) == {"parameters", "fit", "effects", "signals", "settings"}


def test_numbers_are_those_of_the_model(data):
    data["fit"]["test"] = {"velocity": {"rss": 8.1, "rmse": 0.0712, "fit_percent": 97.31}}
    model = Model.check(data)
    tables = read(page(model, [trace_for(model)])).tables
    header, *rows = tables["parameters"]
    columns = [dict(zip(header, row, strict=True)) for row in rows]
    for row in columns:
        part = model.parameters[row["Name"]]
        half_width = (part.ci95[1] - part.ci95[0]) / 2
        assert float(row["Value"]) == pytest.approx(part.value, abs=0.051 * half_width)
        assert float(row["±"]) == pytest.approx(half_width, rel=0.051)
        low, high = map(float, row["95 % interval"].split(" … "))
        assert (low, high) == pytest.approx(part.ci95, abs=0.051 * half_width)
        assert row["Unit"] == part.unit
    assert [row[:5] for row in tables["fit"][1:]] == [
        ["velocity", "train", "99.80", "0.04050", "rad/s"],
        ["velocity", "test", "97.31", "0.07120", "rad/s"],
    ]


def test_texts_of_the_user_are_shown_as_they_are(data):
    data["signals"][1]["name"] = "<b>v & w</b>"
    data["fit"]["train"] = {"<b>v & w</b>": data["fit"]["train"].pop("velocity")}
    model = Model.check(data)
    html = page(model, [trace_for(model)], ["note with <script>"])
    assert "<b>v" not in html
    assert "<script>" not in html
    assert read(html).tables["signals"][2][0] == "<b>v & w</b>"


def test_bounds_fixed_values_and_unknown_uncertainty_are_said(data):
    data["parameters"]["J1"] |= {"at_bound": "high"}
    data["parameters"]["f_v"] |= {"std": None, "ci95": None}
    data["settings"]["fixed"] = {"M_C": 0.897}
    model = Model.check(data)
    notes = {row.name: row.note for row in parameter_rows(model)}
    assert notes == {"J1": "at its upper bound", "M_C": "fixed", "f_v": "uncertainty unknown"}
    assert [text.split(":")[0] for text in remarks(model)] == [
        "J1 at its upper bound",
        "no uncertainty can be given for f_v",
    ]
    html = page(model, [trace_for(model)])
    assert all(text in html for text in remarks(model))


def test_verdict_says_model_fit_and_outcome(data):
    text = verdict(Model.check(data))
    assert text == (
        "The model is one_mass+coulomb+viscous; it fits velocity to 99.80 % (RMSE 0.04050 rad/s). Converged."
    )


def test_diverged_model_has_a_report_that_says_so(data):
    data["fit"]["train"]["velocity"] = {"rss": None, "rmse": None, "fit_percent": None}
    data["criterion"] = None
    data["outcome"] = {"kind": "diverged", "text": "the simulation diverged at 0.1 s"}
    model = Model.check(data)
    assert "diverges" in verdict(model)
    html = page(model, [trace_for(model)])
    assert "The simulation diverged at 0.1 s." in html


def test_same_model_gives_same_page(data):
    model = Model.check(data)
    assert page(model, [trace_for(model)]) == page(model, [trace_for(model)])


def test_signal_kind_velocity_differenced_is_shown(data):
    data["signals"][1]["kind"] = "velocity-differenced"
    model = Model.check(data)
    assert model.outputs == (Signal("velocity", "velocity-differenced", "rad/s"),)
    assert read(page(model, [trace_for(model)])).tables["signals"][2][1] == "velocity-differenced"


def test_evidence_and_ranking_are_shown_after_a_search(data):
    model = Model.check(data)
    cards = (
        Card("coulomb", "needed", 0.4, None, "without it the residual is 1.4 times as large"),
        Card("delay", "not decidable", None, 0.0, "this recording <would> not have shown it"),
    )
    evidence = Evidence((), ("delay",), cards, {}, {}, 100.0)
    rows = [Row("one_mass+coulomb", 2, 1.0, 99.5, -10.0, True), Row("one_mass", 1, 4.0, 90.0, None)]
    html = page(model, [trace_for(model)], (), evidence, rows)
    tables = read(html).tables
    assert tables["evidence"][1] == ["coulomb", "needed", cards[0].reason]
    assert tables["evidence"][2] == ["delay", "not decidable", cards[1].reason]
    assert tables["ranking"][1][1:] == ["one_mass + coulomb", "2", "99.500", "-10.0000", "yes"]
    assert "<would>" not in html
    assert "ranking" not in read(page(model, [trace_for(model)], (), None, rows[:1])).tables
