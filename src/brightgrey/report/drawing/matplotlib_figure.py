"""Figures, all through this one module: the same style everywhere, units on every axis, colour-blind safe."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
from matplotlib.figure import Figure

from brightgrey.model.trace import Trace
from brightgrey.report.charts.chart import COLOURS, Chart, Line, Panel, thin
from brightgrey.report.charts.comparison import comparisons, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "STYLE",
    "comparison",
    "draw",
    "picture",
    "quantity",
    "thin",
]

STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.hashsalt": "brightgrey",  # the same figure gives the same bytes
    "svg.fonttype": "path",
}
WIDTH, HEIGHT = 7.6, 2.85  # inches; the height is that of a panel of height 1


class Drawing(Figure):
    """A figure that a notebook shows although pyplot does not manage it."""

    def _repr_png_(self) -> bytes:
        return picture(self, "png")


def comparison(traces: Sequence[Trace]) -> Figure:
    """Measured against simulated output with the residual below, one panel per recording and output.

    Parameters
    ----------
    traces : sequence of Trace
        Outputs in their own units, time in s.

    Returns
    -------
    matplotlib.figure.Figure
        ``figure.savefig`` writes it, notebooks show it.
    """
    return draw(comparisons(traces))


def draw(charts: Sequence[Chart]) -> Figure:
    """Draw charts one below the other.

    Parameters
    ----------
    charts : sequence of Chart

    Returns
    -------
    matplotlib.figure.Figure
        ``figure.savefig`` writes it, notebooks show it.
    """
    panels = [panel for chart in charts for panel in chart.panels]
    heights = [panel.height for panel in panels]
    with mpl.rc_context(STYLE):
        figure = Drawing(figsize=(WIDTH, HEIGHT * sum(heights)), layout="constrained")
        every = figure.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
        for axes, panel in zip(every, panels, strict=True):
            _draw_panel(axes, panel)
        for number, panel in enumerate(panels):
            if not panel.x_label:
                every[number].sharex(every[number + 1])
                every[number].tick_params(labelbottom=False)
        figure.align_ylabels()
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    axes.set_title(_without_math(panel.title), loc="left", fontsize=10)
    if panel.x_log:
        axes.set_xscale("log")
    if panel.y_log:
        axes.set_yscale("log")
    for level in panel.levels:
        axes.axhline(level, color="#888888", linewidth=0.8)
    for line in panel.lines:
        _draw_line(axes, line)
    for mark in panel.marks:
        axes.axvline(mark.x, color="#888888", linewidth=0.8, linestyle=":")
        axes.annotate(
            _without_math(mark.label),
            (mark.x, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-2 if mark.left else 2, 2),
            textcoords="offset points",
            ha="right" if mark.left else "left",
            fontsize=7,
        )
    axes.set_ylabel(_without_math(panel.y_label))
    axes.set_xlabel(_without_math(panel.x_label))
    axes.margins(x=0.01)
    labelled = [line for line in panel.lines if line.label]
    if len(labelled) > 1:
        above = 1.5 if any(mark.label for mark in panel.marks) else 0.2  # sizes of the font; words of marks are lower
        axes.legend(loc="lower right", ncols=len(labelled), bbox_to_anchor=(1.0, 1.0), borderaxespad=above, fontsize=8)


def _draw_line(axes: Axes, line: Line) -> None:
    colour, label = COLOURS[line.colour], _without_math(line.label) if line.label else "_nolegend_"
    if line.style == "band" and line.low is not None:
        axes.fill_between(line.x, line.low, line.y, color=colour, alpha=0.25, linewidth=0.0, label=label)
    elif line.style == "bars":
        axes.vlines(line.x, 0.0, line.y, color=colour, linewidth=line.width, label=label)
    elif line.style == "points":
        axes.plot(line.x, line.y, ".", color=colour, markersize=2.5 * line.width, label=label)
    else:
        dashes = "--" if line.style == "dashed" else "-"
        axes.plot(line.x, line.y, dashes, color=colour, linewidth=line.width, label=label)


def _without_math(text: str) -> str:
    """Keep matplotlib from reading a dollar sign in a column's name as mathematics."""
    return text.replace("$", r"\$")


def picture(figure: Figure, kind: Literal["svg", "png", "pdf"] = "svg") -> bytes:
    """Figure as file content, without a date in it."""
    stream = io.BytesIO()
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context(STYLE):
        figure.savefig(stream, format=kind, metadata=metadata, dpi=150)
    return stream.getvalue()
