"""Figures of measured and simulated motion, of which any part can be seen in full detail."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from brightgrey.app.plots.channels import shown_over
from brightgrey.model.trace import Trace
from brightgrey.report.charts.chart import Chart, Line, Panel, thin
from brightgrey.report.charts.comparison import comparisons, quantity
from brightgrey.report.drawing.plotly_figure import plot

__all__ = ["beside_figure", "motion_figure"]


def motion_figure(trace: Trace, row: int, span: tuple[float, float] | None) -> dict[str, Any]:
    """Measured and simulated output with the residual below, as in the report: data and layout for plotly.

    Parameters
    ----------
    trace : Trace
    row : int
        Output.
    span : (float, float) or None
        Time in s that is shown; all of it by default.
    """
    return _over(plot(comparisons((_within_span(trace, span),))[row]), trace, span)


def beside_figure(one: Trace, other: Trace, row: int, span: tuple[float, float] | None) -> dict[str, Any]:
    """Measured output with the simulations of two structures, both residuals below; arguments as `motion_figure`."""
    a, b = _within_span(one, span), _within_span(other, span)
    signal = a.outputs[row]
    t, measured, first, second = thin(a.t, a.measured[row], a.simulated[row], b.simulated[row])
    t_residual, residual, other_residual = thin(a.t, a.residual[row], b.residual[row])
    above = Panel(
        y_label=f"{quantity(signal.kind)} in {signal.unit}",
        lines=(
            Line(t, measured, "measured", "measured", width=2.6),
            Line(t, first, "A", "simulated", width=1.6),
            Line(t, second, "B", "second", width=0.9),
        ),
        title=f"{a.name}: {signal.name}",
    )
    below = Panel(
        y_label=f"residual\nin {signal.unit}",
        lines=(
            Line(t_residual, residual, "", "simulated", width=1.6),
            Line(t_residual, other_residual, "", "second", width=0.8),
        ),
        x_label="time in s",
        levels=(0.0,),
        height=0.5,
    )
    return _over(plot(Chart("beside", (above, below))), one, span)


def _within_span(trace: Trace, span: tuple[float, float] | None) -> Trace:
    """Samples within a span, and one on each side."""
    if span is None:
        return trace
    first, last = np.searchsorted(trace.t, span)
    part = slice(max(int(first) - 1, 0), int(last) + 2)
    return replace(
        trace,
        t=trace.t[part],
        u=trace.u[part],
        measured=trace.measured[:, part],
        simulated=trace.simulated[:, part],
    )


def _over(figure: dict[str, Any], trace: Trace, span: tuple[float, float] | None) -> dict[str, Any]:
    """Figure whose axis of time shows the span."""
    return shown_over(figure, span or (float(trace.t[0]), float(trace.t[-1])))
