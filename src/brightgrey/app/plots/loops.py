"""Bode plots of the speed loop: the drive alone, and with the suggested controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brightgrey.api.control import Design
from brightgrey.control.linear.margins import frequency_response
from brightgrey.report.charts.chart import Chart, Line, Mark, Panel
from brightgrey.report.drawing.plotly_figure import plot

__all__ = ["loop_chart", "loop_figure"]


@dataclass(frozen=True)
class _LoopFigure:
    """Form of the figure."""

    points: int = 600
    decades_below: float = 2.0  #: Of frequency, below the crossover.
    decades_above: float = 0.7  #: The phase passes -180° here; far above, the sampled controller does nothing.


LOOP_FIGURE = _LoopFigure()


def loop_figure(found: Design) -> dict[str, Any]:
    """Figure of :func:`loop_chart` for the page."""
    return plot(loop_chart(found))


def loop_chart(found: Design) -> Chart:
    """Gain and phase from torque to speed before, and of the open loop with the controller after.

    The gain before is scaled so that both meet at the crossover: only its shape is compared.
    """
    form = LOOP_FIGURE
    analysis, cascade = found.analyses[0], found.cascade
    crossover = cascade.speed_margins[0].crossover
    omega = crossover * np.logspace(-form.decades_below, form.decades_above, form.points)
    row = analysis.outputs.index("velocity")
    plant = frequency_response(analysis.linear, omega, analysis.dead_time + found.delay)[row]
    loop = plant * cascade.controller.response(omega)
    at = int(np.argmin(np.abs(omega - crossover)))
    before = plant / abs(plant[at])
    f = omega / (2.0 * np.pi)
    marks = (Mark(crossover / (2.0 * np.pi), "crossover"),)
    panels = (
        Panel(
            "gain of the\nspeed loop",
            (
                Line(f, np.abs(before), "drive alone, scaled", "measured", width=2.0),
                Line(f, np.abs(loop), "with the speed controller", "simulated"),
            ),
            marks=marks,
            levels=(1.0,),
            x_log=True,
            y_log=True,
        ),
        Panel(
            "phase in degrees",
            (
                Line(f, np.degrees(np.unwrap(np.angle(before))), "", "measured", width=2.0),
                Line(f, np.degrees(np.unwrap(np.angle(loop))), "", "simulated"),
            ),
            "frequency in Hz",
            marks=(Mark(crossover / (2.0 * np.pi), ""),),
            levels=(-180.0,),
            x_log=True,
            height=0.7,
        ),
    )
    return Chart("loop", panels)
