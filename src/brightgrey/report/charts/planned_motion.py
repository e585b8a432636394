"""Planned motion: position, velocity and torque over time."""

from __future__ import annotations

from collections.abc import Mapping

from brightgrey.arrays import Array
from brightgrey.report.charts.chart import Chart, Line, Panel, thin

__all__ = ["planned_motion"]

_HEIGHT = 0.55  # of a panel


def planned_motion(columns: Mapping[str, Array]) -> Chart:
    """Figure of a plan.

    Parameters
    ----------
    columns : mapping of str to ndarray
        Time first, then quantities with their units in brackets, as plan.csv has them.
    """
    (_, t), *rest = columns.items()
    shown = [(name, x) for name, x in rest if "acceleration [" not in name]
    panels = []
    for k, (name, x) in enumerate(shown):
        quantity, _, unit = name.partition(" [")
        short_t, short_x = thin(t, x)
        panels.append(
            Panel(
                y_label=f"{quantity}\nin {unit[:-1]}",
                lines=(Line(short_t, short_x, "", "simulated"),),
                x_label="time in s" if k == len(shown) - 1 else "",
                levels=(0.0,),
                height=_HEIGHT,
            )
        )
    return Chart("plan", tuple(panels))
