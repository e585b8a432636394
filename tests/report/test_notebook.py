"""How recordings, models and results show themselves in a notebook."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from brightgrey import Recording, Result
from brightgrey.errors import SettingsError
from brightgrey.notebook_html import sparkline, table
from brightgrey.recordings import Signal
from support.html_reader import read
from support.models import DT, independent, model_with_intervals, trace_of


@pytest.fixture(scope="module")
def result():
    model = model_with_intervals()
    fit = SimpleNamespace(correlation=independent(model), symptoms=(), second_opinion=())
    return Result(model, (trace_of(model),), (), ("a <note>",), fit)


def test_recording_html__shows_its_signals():
    t = DT * np.arange(100)
    signals = Signal("u <1>", "input", "N m"), (Signal("v", "velocity", "rpm"),)
    recording = Recording("a.csv", t, np.sin(t), 2 * np.pi * np.cos(t)[None] / 60, *signals, notes=("one & two",))
    html = recording._repr_html_()
    (header, torque, speed) = read(html).tables[None]
    assert header == ["Signal", "Kind", "Unit", "Least", "Largest", "Over time"]
    assert torque[:5] == ["u <1>", "input", "N m", "0", f"{np.sin(t[-1]):.4g}"]
    assert speed[:5] == ["v", "velocity", "rpm", f"{np.cos(t[-1]):.4g}", "1"]
    assert html.count("<polyline") == 2
    assert "one &amp; two" in html


def test_model_html__shows_its_parameters(result):
    model = result.model
    rows = read(model._repr_html_()).tables[None]
    for row, (name, part) in zip(rows[1:], model.parameters.items(), strict=False):
        assert row[:4] == [name, f"{part.value:.5g}", "0", part.unit]


def test_result_html__shows_verdict_parameters_and_figure(result):
    html = result._repr_html_()
    rows = read(re.sub(r"<svg.*?</svg>", "", html, flags=re.DOTALL)).tables[None]
    assert [row[0] for row in rows[1 : 1 + len(result.model.parameters)]] == list(result.model.parameters)
    assert "Two masses, coupled by a shaft" in html
    assert html.count('class="drive"') == 3
    assert html.count("<svg") > 3
    assert "<script" not in html


@pytest.mark.parametrize("what", ["comparison", "residuals", "friction", "frequency", "backlash"])
def test_plot__gives_a_figure_that_notebooks_show(result, what):
    figure = result.plot(what)
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert all(axes.get_ylabel() for axes in figure.axes)


def test_plot__figure_that_does_not_apply__is_refused(result):
    with pytest.raises(SettingsError, match="friction"):
        result.plot("fricton")
    with pytest.raises(SettingsError, match="comparison"):
        result.plot("history")


def test_table_and_sparkline__escape_cells_and_keep_extremes():
    assert "<td" in table(("a",), [("<b>",)])
    assert "&lt;b&gt;" in table(("a",), [("<b>",)])
    y = np.zeros(10_000)
    y[4321] = 1.0
    heights = [float(pair.split(",")[1]) for pair in re.search(r'points="([^"]+)"', sparkline(y))[1].split()]
    assert min(heights) == 1.0
    assert max(heights) == 27.0


def test_drawing__has_the_values_of_the_model(result):
    drawing = result.drawing()
    shown = {name: value for part in drawing.drive.parts for name, value in part.values}
    assert set(shown) == set(result.model.parameters)
    for name, part in result.model.parameters.items():
        assert float(shown[name].value) == pytest.approx(part.value, rel=1e-3)
        assert shown[name].unit == part.unit
        assert bool(shown[name].half_width) == (part.ci95 is not None and part.ci95[1] > part.ci95[0])
    assert drawing.drive.sensors[0].name == result.model.outputs[0].name
    assert drawing.svg() == result.model.drawing().svg()
