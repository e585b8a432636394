"""fit.svg shows the lines of its charts, their labels and round ticks."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from brightgrey.report.charts.chart import COLOURS, Chart, Line, Panel
from brightgrey.report.drawing.svg_figure import svg_figure

X = np.linspace(0.0, 2.0, 21)
Y = np.where(X < 1.0, 10.0 * X, 10.0)
SVG = "{http://www.w3.org/2000/svg}"


def chart(y=Y, title="a.csv: speed <1>"):
    above = Panel(
        "velocity in\nrad/s",
        (Line(X, y, "measured", "measured"), Line(X, y + 1, "simulated", "simulated")),
        title=title,
    )
    below = Panel("residual", (Line(X, y - Y, "", "residual", "dashed"),), "time in s", levels=(0.0,), height=0.3)
    return Chart("comparison", (above, below))


def lines(root, colour):
    return [p.get("d") for p in root.iter(f"{SVG}path") if p.get("stroke") == COLOURS[colour] and "L" in p.get("d")]


def test_svg_figure__has_lines_labels_and_ticks():
    root = ET.fromstring(svg_figure([chart()]))
    words = [text.text for text in root.iter(f"{SVG}text")]
    for word in (
        "a.csv: speed <1>",
        "velocity in",
        "rad/s",
        "residual",
        "time in s",
        "measured",
        "simulated",
        "0",
        "10",
    ):
        assert word in words
    points = re.findall(r"[ML]([\d.]+) ([\d.]+)", lines(root, "measured")[0])
    assert len(points) == X.size
    across, up = np.array(points, float).T
    # Positions are written to a tenth of a pixel; both axes are linear.
    assert np.polynomial.Polynomial.fit(X, across, 1)(X) == pytest.approx(across, abs=0.1)
    assert np.polynomial.Polynomial.fit(Y, up, 1)(Y) == pytest.approx(up, abs=0.1)
    assert up[0] > up[-1]


def test_svg_figure__of_a_diverged_simulation_interrupts_the_line():
    y = Y.copy()
    y[5:8] = np.nan
    root = ET.fromstring(svg_figure([chart(y)]))
    (path,) = lines(root, "measured")
    assert path.count("M") == 2
    assert "nan" not in path
    ET.fromstring(svg_figure([chart(np.full(X.size, np.nan))]))


def test_svg_figure__of_the_same_charts_is_the_same_text():
    assert svg_figure([chart()]) == svg_figure([chart()])
