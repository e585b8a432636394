"""What the figures show is computed once: closed forms, physics, and that both ways of drawing take it."""

import json
import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest
from scipy.signal import lfilter

from brightgrey import Model
from brightgrey.kit import assemble
from brightgrey.model.ranking import Row, front
from brightgrey.model.trace import Trace
from brightgrey.report.charts.backlash import gap_charts, loop
from brightgrey.report.charts.comparison import comparisons, correlations
from brightgrey.report.charts.frequency_response import measured_response, response_chart
from brightgrey.report.charts.friction import friction_charts
from brightgrey.report.charts.position_torque import position_torque_charts
from brightgrey.report.charts.search_progress import ancestors, front_chart, history_chart
from brightgrey.report.content import Content
from brightgrey.report.drawing.matplotlib_figure import draw, picture
from brightgrey.report.drawing.plotly_figure import plot, script
from brightgrey.report.drawing.svg import family, range_bar, tree
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.report.page import page
from brightgrey.report.quantities.assembled_model import AssembledModel
from brightgrey.simulation import response
from support.genetic_runs import individual, small_run
from support.models import DT, F_TANH, FULL, TOP, VALUES, independent, model_with_intervals, trace_of

EFFECTS = ("one_mass", "coulomb", "viscous", "stribeck", "gravity")


@pytest.fixture(scope="module")
def content():
    model = model_with_intervals()
    rows = [Row("+".join(EFFECTS[: k + 1]), k + 1, 1.0, 99.0 + 0.1 * k, -1.0 * k, k == 2) for k in range(5)]
    return Content(model, [trace_of(model)], ranking=rows, correlation=independent(model), run=small_run())


def test_charts__full_model__has_every_figure(content):
    assert list(content.charts) == [
        *("comparison", "residuals", "friction", "frequency", "backlash", "pareto", "history"),
    ]


def test_charts__axes__name_quantity_and_unit(content):
    pure = {"autocorrelation", "correlation with the input", "criterion (larger is better)", "estimated parameters"}
    for charts in content.charts.values():
        for chart in charts:
            assert chart.panels[-1].x_label
            for panel in chart.panels:
                for label in (panel.y_label, panel.x_label):
                    plain = label.replace("\n", " ")
                    assert " in " in plain or plain in pure | {"", "generation"}


def coloured(value):
    """A figure with one colour for all that the page colours."""
    if isinstance(value, dict):
        return {k: coloured(v) for k, v in value.items()}
    if isinstance(value, list):
        return [coloured(v) for v in value]
    return "#123456" if isinstance(value, str) and value.startswith("var(--") else value


def test_charts__are_drawn_for_paper_and_for_the_page(content):
    for name, charts in content.charts.items():
        assert picture(draw(charts)) == picture(draw(charts)), name
        for chart in charts:
            made = json.loads(script(plot(chart)))
            figure = go.Figure(coloured(made))  # refuses what plotly does not know
            assert len(figure.data) >= sum(len(panel.lines) for panel in chart.panels)


def test_page__colours__are_defined_in_it(content):
    html = page(content)
    for name in set(re.findall(r"var\((--[a-z-]+)\)", html)):
        assert f"{name}:" in html.replace(f"var({name})", "")


def test_drawings__for_paper_and_page__have_the_same_numbers(content):
    (chart,) = content.charts["friction"]
    drawn = draw([chart]).axes[0].get_lines()
    shown = plot(chart)["data"][-1]
    curve = next(line for line in drawn if line.get_label() == "estimate")
    np.testing.assert_allclose(shown["x"], curve.get_xdata(), rtol=1e-6)
    np.testing.assert_allclose(shown["y"], curve.get_ydata(), rtol=1e-6)


def test_friction_chart__is_the_sum_of_the_laws():
    model = model_with_intervals()
    (chart,) = friction_charts(AssembledModel(model), independent(model))
    band, curve = chart.panels[0].lines
    v = curve.x
    size = VALUES["M_C"] + VALUES["M_S"] * np.exp(-np.abs(v) / VALUES["omega_S"])
    np.testing.assert_allclose(curve.y, VALUES["f_v"] * v + np.tanh(F_TANH * v) * size, atol=1e-12)
    assert (v.min(), v.max()) == (-TOP, TOP)
    assert (band.low <= curve.y + 1e-12).all()
    assert (curve.y <= band.y + 1e-12).all()
    assert friction_charts(AssembledModel(model_with_intervals("one_mass")), {}) == ()
    (alone,) = friction_charts(AssembledModel(model), {})
    assert [line.label for line in alone.panels[0].lines] == ["estimate"]


def test_friction_chart__exact_sign__jumps_at_standstill():
    model = model_with_intervals("one_mass+coulomb")
    exact = model.settings.model_copy(update={"friction_width": 0.0})
    (chart,) = friction_charts(AssembledModel(model.model_copy(update={"settings": exact})), {})
    (line,) = chart.panels[0].lines
    np.testing.assert_allclose(line.y, VALUES["M_C"] * np.sign(line.x), rtol=1e-12)


def test_measured_response__of_a_known_filter__is_its_response():
    rng = np.random.default_rng(3)
    u = rng.normal(size=(1, 20_000))
    y = lfilter([0.1], [1.0, -0.9], u)
    model = model_with_intervals("one_mass")
    found = measured_response([Trace("a", DT * np.arange(u.size), u[0], y, y, model.input, model.outputs)], 0)
    z = np.exp(2j * np.pi * found.frequency * DT)
    # Welch's leakage at nine segments: some percent.
    np.testing.assert_allclose(found.response, 0.1 / (1.0 - 0.9 / z), rtol=0.05)
    assert found.coherence.min() > 0.99
    noise = Trace("b", DT * np.arange(u.size), u[0], rng.normal(size=u.shape), y, model.input, model.outputs)
    assert np.mean(measured_response([noise], 0).coherence > 0.8) < 0.01
    assert measured_response([trace_of(model, samples=200)], 0) is None


def test_response_chart__linear_drive__model_and_measurement_agree():
    model = model_with_intervals("two_mass+viscous")
    (chart,) = response_chart(AssembledModel(model), [trace_of(model, samples=8000, noise=1e-3)])
    measured, modelled = chart.panels[0].lines
    assert (measured.label, modelled.label) == ("measured", "linearised model")
    near = measured.x < 100.0
    ratio = measured.y / np.interp(measured.x, modelled.x, modelled.y)
    assert near.sum() > 20
    assert np.median(np.abs(np.log(ratio[near]))) < 0.1
    analysis = AssembledModel(model).analysis
    marks = [mark.x for mark in chart.panels[0].marks]
    assert marks == [analysis.resonances[0].frequency, analysis.antiresonances()[0].frequency]
    peak = modelled.x[np.argmax(modelled.y * (np.abs(modelled.x - marks[0]) < 5.0))]
    assert peak == pytest.approx(marks[0], rel=0.02)


def test_gap_loop__shaft_torque__accelerates_the_load():
    model = model_with_intervals("two_mass+backlash")
    settings = model.settings_si()
    system = assemble(model.structure, model.values_si(), settings.f_tanh)
    n = len(system.states)
    every = replace(system, C=np.eye(n), D=np.zeros((n, 1)), outputs=system.state_names, derivative_rows=(-1,) * n)
    t = 1e-4 * np.arange(6000)
    x = response(every, 2.0 * np.sin(9.0 * t), 1e-4, system.rest(), settings).y[:, :, 0]
    gap = next(e for e in system.elements if e.limits is not None)
    twist, torque = loop(system, gap, model.values_si(), x)
    behind = VALUES["J2"] * np.gradient(x[system.state_names.index("v2")], 1e-4)
    assert np.median(np.abs(behind - torque)) < 1e-3 * np.abs(torque).max()
    np.testing.assert_array_equal(twist, x[0] - x[1])
    inside = (twist < -0.2 * VALUES["alpha"]) & (twist > -1.8 * VALUES["alpha"])
    assert inside.any()
    assert np.abs(torque[inside]).max() < 0.1 * np.abs(torque).max()


def test_gap_chart__marks__are_two_alpha_apart():
    model = model_with_intervals(FULL, units=("N m", "deg"))
    (chart,) = gap_charts(AssembledModel(model), [trace_of(model)])
    low, high = (mark.x for mark in chart.panels[0].marks)
    assert high - low == pytest.approx(np.degrees(2 * VALUES["alpha"]))
    assert (
        gap_charts(AssembledModel(model_with_intervals("two_mass")), [trace_of(model_with_intervals("two_mass"))]) == ()
    )


def test_correlations__diverged_or_short__are_left_out():
    model = model_with_intervals("one_mass+coulomb")
    good = trace_of(model)
    lost = replace(good, simulated=np.full_like(good.simulated, np.nan))
    assert len(correlations([good, lost, trace_of(model, samples=100)])) == 1


def test_front_chart__random_rows__has_the_undominated():
    rng = np.random.default_rng(0)
    rows = [Row(str(k), int(rng.integers(1, 9)), float(rng.uniform(1, 9)), 90.0, 0.0) for k in range(60)]
    brute = {
        r.structure
        for r in rows
        if not any(o.n_parameters <= r.n_parameters and o.rss <= r.rss and o is not r for o in rows)
    }
    assert {r.structure for r in front(rows)} == brute
    assert front_chart(rows[:2], "0") == ()


def test_history_chart_and_family__small_run__show_the_ancestors():
    run = small_run()
    (chart,) = history_chart(run)
    so_far, best = chart.panels[0].lines
    assert best.y.tolist() == [2.0, 2.0, 3.0]
    assert so_far.y.tolist() == [2.0, 2.0, 3.0]
    assert [(e.generation, e.individual) for e in ancestors(run)] == [(2, 0), (1, 1), (0, 0)]
    drawn = family(run)
    assert drawn.count("<rect") == 3
    assert drawn.count("<line") == 2
    assert "(1,5,6)" in drawn
    assert history_chart(None) == ()


def test_tree_svg__shows_the_numbers_of_its_effects():
    drawn = tree(individual(0, 0, 1.0, structure="two_mass+coulomb+delay").tree)
    assert [f">{number}<" in drawn for number in (2, 5, 11)] == [True] * 3
    assert drawn.count("<line") == 2


def test_range_bar__is_at_the_value():
    part = model_with_intervals("one_mass").parameters["J1"]
    value = part.value
    middle = range_bar(part, (value / 100, 100 * value), log=True)
    assert 'class="estimate" x1="70.0"' in middle
    assert range_bar(part, None, log=True) == ""
    assert 'class="estimate" x1="136.0"' in range_bar(part, (0.0, 0.5 * value), log=False)


def test_page__long_and_many_recordings__stays_below_six_megabytes():
    model = model_with_intervals("one_mass+coulomb+viscous")
    rng = np.random.default_rng(0)
    t = DT * np.arange(20_000)
    y = rng.normal(size=(1, t.size))
    traces = [Trace(f"{k}.csv", t, y[0], y, 0.9 * y, model.input, model.outputs) for k in range(12)]
    charts = comparisons(traces)
    assert sum(line.x.size for chart in charts for line in chart.panels[0].lines[:1]) <= REPORT_OPTIONS.page_points + 12
    assert all(
        line.x.size <= REPORT_OPTIONS.line_points for chart in charts for panel in chart.panels for line in panel.lines
    )
    assert len(page(Content(model, traces)).encode()) < 6e6


def test_position_chart__hardening_shaft__is_the_spring_with_its_linear_part():
    model = model_with_intervals("two_mass+cubic_spring", units=("N m", "deg"))
    (chart,) = position_torque_charts(AssembledModel(model), [trace_of(model)])
    linear, whole = chart.panels[0].lines
    twist = np.radians(whole.x)
    np.testing.assert_allclose(linear.y, VALUES["c1"] * twist, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(whole.y - linear.y, VALUES["c_cubic"] * twist**3, rtol=1e-9, atol=1e-12)
    assert "a hardening spring" in chart.caption


def test_position_chart__arm__is_the_sine_over_the_positions():
    model = model_with_intervals("one_mass+viscous+pendulum")
    trace = trace_of(model)
    (chart,) = position_torque_charts(AssembledModel(model), [trace])
    (line,) = chart.panels[0].lines
    v = VALUES
    np.testing.assert_allclose(line.y, v["G"] * np.sin(v["k"] * line.x + v["phi_0"]), rtol=1e-9, atol=1e-12)
    assert position_torque_charts(AssembledModel(model_with_intervals("one_mass")), [trace]) == ()


def test_response_chart__undamped_resonance__stays_finite():
    """As of an arm without friction: the response at the resonance itself is infinite."""
    model = model_with_intervals("two_mass")
    data = model.model_dump(mode="json")
    data["parameters"]["d1"] |= {"value": 1e-300}
    undamped = Model.check(data)
    (chart,) = response_chart(AssembledModel(undamped), [trace_of(model)])
    gain = chart.panels[0].lines[-1].y
    assert np.isfinite(gain).all()
    assert gain.max() > 1e3 * np.median(gain)


def test_plot__logarithmic_axis_of_few_decades__every_tick_is_written_in_full():
    rows = [Row("+".join(EFFECTS[: k + 1]), k + 1, 1.0, fit, 0.0, k == 2) for k, fit in enumerate((96.0, 99.0, 99.8))]
    (chart,) = front_chart(rows, rows[2].structure)
    axis = plot(chart)["layout"]["yaxis"]
    assert {"0.2", "0.5", "1", "2", "5"} <= set(axis["ticktext"])
    assert list(map(float, axis["ticktext"])) == axis["tickvals"]
