"""The figure shows what it says, with units, and in colours that everybody can tell apart."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.model.trace import Trace
from brightgrey.recordings import Signal
from brightgrey.report.charts.chart import COLOURS, Chart, Line, Mark, Panel
from brightgrey.report.drawing.matplotlib_figure import (
    comparison,
    draw,
    picture,
    thin,
)
from brightgrey.report.options import REPORT_OPTIONS

TORQUE = Signal("torque", "input", "N m")
OUTPUTS = (Signal("q $_1$", "position", "mm"), Signal("v", "velocity-differenced", "mm/s"))


@pytest.fixture(scope="module")
def trace():
    generator = np.random.default_rng(0)
    t = 2.0 + 0.001 * np.arange(300)
    simulated = np.array([np.sin(20 * t), 20 * np.cos(20 * t)])
    measured = simulated + 0.05 * generator.normal(size=simulated.shape)
    return Trace("a.csv", t, np.sin(t), measured, simulated, TORQUE, OUTPUTS)


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def test_comparison__measured_simulated_and_residual__have_units(trace):
    axes = comparison([trace, replace(trace, name="b.csv", test=True)]).axes
    assert len(axes) == 8
    position, position_residual, velocity, _ = axes[:4]
    assert position.get_ylabel() == "position in mm"
    assert position_residual.get_ylabel() == "residual\nin mm"
    assert velocity.get_ylabel() == "velocity in mm/s"
    assert all(ax.get_xlabel() == "time in s" for ax in axes[1::2])
    assert [ax.get_title(loc="left") for ax in axes[::4]] == [
        r"a.csv: q \$_1\$",
        r"b.csv: q \$_1\$ (test recording)",
    ]
    drawn = lines(position)
    np.testing.assert_array_equal(drawn["measured"].get_ydata(), trace.measured[0])
    np.testing.assert_array_equal(drawn["simulated"].get_ydata(), trace.simulated[0])
    np.testing.assert_array_equal(position_residual.get_lines()[-1].get_ydata(), trace.residual[0])


def test_thin__long_lines__keep_their_extremes():
    generator = np.random.default_rng(1)
    t = np.arange(100_000.0)
    line, other = generator.normal(size=(2, t.size))
    line[12_345], other[54_321] = 50.0, -50.0
    kept, thinned, thinned_other = thin(t, line, other)
    assert kept.size <= REPORT_OPTIONS.line_points
    assert (kept[0], kept[-1]) == (0.0, 99_999.0)
    assert (np.diff(kept) > 0).all()
    assert thinned.max() == 50.0
    assert kept[np.argmax(thinned)] == 12_345
    assert kept[np.argmin(thinned_other)] == 54_321
    np.testing.assert_array_equal(thinned, line[kept.astype(int)])


def test_comparison__diverged_simulation__is_drawn(trace):
    broken = trace.simulated.copy()
    broken[:, 100:] = np.nan
    assert picture(comparison([replace(trace, simulated=broken)]), "png").startswith(b"\x89PNG")


def test_picture__same_figure__gives_the_same_bytes(trace):
    for kind in ("svg", "png", "pdf"):
        assert picture(comparison([trace]), kind) == picture(comparison([trace]), kind)


def test_picture__svg__loads_nothing(trace):
    svg = picture(comparison([trace])).decode()
    assert re.findall(r'href="(?!#)[^"]*"', svg) == []


def lightness(colour):
    """CIE L* of an sRGB colour (IEC 61966-2-1)."""
    channels = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    return 116 * np.cbrt(y) - 16 if y > 0.008856 else 903.3 * y


def test_colours__differ_in_lightness():
    # 10 is a step that everybody sees, also in grey print.
    for one, other in itertools.combinations(("measured", "simulated", "residual"), 2):
        assert abs(lightness(COLOURS[one]) - lightness(COLOURS[other])) > 10


def test_draw__word_at_a_mark_below_the_legend__both_can_be_read():
    x = np.linspace(0.0, 1.0, 5)
    lines = tuple(Line(x, x, f"a line of some length, number {k}", "measured") for k in range(2))
    figure = draw([Chart("any", (Panel("y", lines, "x", marks=(Mark(0.7, "crossover"),)),))])
    figure.canvas.draw()
    (axes,) = figure.axes
    (word,) = (text for text in axes.texts if text.get_text() == "crossover")
    assert not word.get_window_extent().overlaps(axes.get_legend().get_window_extent())
