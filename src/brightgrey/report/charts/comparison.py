"""Measured against simulated motion, and the correlations of the residuals between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.estimation.noise.residual_analysis import LAGS, residual_analysis
from brightgrey.model.trace import Trace
from brightgrey.report.charts.chart import Chart, Line, Panel, thin
from brightgrey.report.options import REPORT_OPTIONS

__all__ = ["comparisons", "correlations", "quantity"]

_CAPTION = (
    "The simulated line lies on the measured one where the model holds. The residual below should look like noise; a"
    " shape that follows the motion is something that the model lacks."
)


def quantity(kind: str) -> str:
    """Name the quantity of a signal: ``velocity-differenced`` is a velocity."""
    return kind.partition("-")[0]


def comparisons(traces: Sequence[Trace]) -> tuple[Chart, ...]:
    """Measured against simulated output with the residual below, one chart per recording and output.

    Parameters
    ----------
    traces : sequence of Trace
        Outputs in their own units, time in s.
    """
    rows = [(trace, row) for trace in traces for row in range(len(trace.outputs))]
    o = REPORT_OPTIONS
    most = max(o.min_line_points, min(o.line_points, o.page_points // max(len(rows), 1)))
    return tuple(_comparison_chart(trace, row, most) for trace, row in rows)


def _comparison_chart(trace: Trace, row: int, most: int) -> Chart:
    signal = trace.outputs[row]
    t, measured, simulated = thin(trace.t, trace.measured[row], trace.simulated[row], most=most)
    t_residual, residual = thin(trace.t, trace.residual[row], most=most)
    above = Panel(
        y_label=f"{quantity(signal.kind)} in {signal.unit}",
        lines=(
            Line(t, measured, "measured", "measured", width=2.6),
            Line(t, simulated, "simulated", "simulated", width=0.9),
        ),
        title=f"{trace.name}: {signal.name}" + (" (test recording)" if trace.test else ""),
    )
    below = Panel(
        y_label=f"residual\nin {signal.unit}",
        lines=(Line(t_residual, residual, "", "residual", width=0.8),),
        x_label="time in s",
        levels=(0.0,),
        height=1.0 / 3.0,
    )
    return Chart("comparison", (above, below), _CAPTION)


def correlations(traces: Sequence[Trace]) -> tuple[Chart, ...]:
    """Correlations of the residuals with themselves and with the input, one chart per recording and output.

    Outputs whose simulation diverged, or that are too short for the lags, are left out.
    """
    drawn = (_correlation_chart(trace, row) for trace in traces for row in range(len(trace.outputs)))
    return tuple(chart for chart in drawn if chart is not None)


def _correlation_chart(trace: Trace, row: int) -> Chart | None:
    residual = trace.residual[row]
    if not np.isfinite(residual).all() or residual.size <= 4 * LAGS:
        return None
    found = residual_analysis(residual, trace.u)
    dt = float(trace.t[1] - trace.t[0])
    own = np.array(found.autocorrelation)
    cross = np.array(found.cross_correlation)
    lags = dt * np.arange(own.size, dtype=np.float64)
    both = dt * (np.arange(cross.size, dtype=np.float64) - cross.size // 2)
    with_itself = Panel(
        y_label="autocorrelation",
        lines=(Line(lags, own, "", "residual", "bars", 2.0),),
        x_label="lag in s",
        title=f"{trace.name}: {trace.outputs[row].name}" + (" (test recording)" if trace.test else ""),
        levels=(0.0, found.band, -found.band),
        height=0.6,
    )
    with_input = Panel(
        y_label="correlation\nwith the input",
        lines=(Line(both, cross, "", "second", "bars", 2.0),),
        x_label="lag in s (positive: the input's past)",
        levels=(0.0, found.cross_band, -found.cross_band),
        height=0.6,
    )
    white = "Nothing speaks against white residuals" if found.white else "The residuals are not white"
    follows = "depend on the input" if found.follows_input else "do not depend on the input"
    caption = (
        f"{white} (Ljung-Box test, p {_chance(found.ljung_box)}); they {follows}. Between the lines lie 95 % of the"
        f" correlations of white residuals that do not depend on the input. The {trace.t.size} samples count as"
        f" {found.effective_samples:.0f} independent ones."
    )
    return Chart("residuals", (with_itself, with_input), caption)


def _chance(p: float) -> str:
    """A probability as text, none of them zero."""
    return f"= {p:.2g}" if p >= REPORT_OPTIONS.min_p else f"< {REPORT_OPTIONS.min_p:g}"
