"""Figure of a recording over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brightgrey.option_texts import window as window_ends
from brightgrey.recordings import Recording
from brightgrey.report.charts.chart import Chart, Line, Mark, Panel, thin
from brightgrey.report.drawing.plotly_figure import plot

__all__ = ["channel_figure", "shown_over"]


@dataclass(frozen=True)
class _ChannelFigure:
    """Form of the figure."""

    points: int = 2400  #: Of a line; a screen shows no more.


CHANNEL_FIGURE = _ChannelFigure()


def channel_figure(
    recording: Recording, span: tuple[float, float] | None, window: str | None, label: str
) -> dict[str, Any]:
    """Input and outputs over time: data and layout for plotly.

    Parameters
    ----------
    recording : Recording
        Whole, without a window.
    span : (float, float) or None
        Time in s that is shown; all of it by default.
    window : str or None
        As ``A:B`` in s; its ends are marked.
    label : str
        Name of the recording.

    Raises
    ------
    SettingsError
        For a window that cannot be read.
    """
    t = recording.t
    low, high = span or (float(t[0]), float(t[-1]))
    first, last = np.searchsorted(t, [low, high])
    part = slice(max(int(first) - 1, 0), int(last) + 2)
    ends = [end for end in window_ends(window) or () if end is not None]
    marks = tuple(Mark(end, "window") for end in ends if low <= end <= high)
    rows = [(recording.input, recording.u * recording.input.factor, "second")]
    rows += [(s, y * s.factor, "measured") for s, y in zip(recording.outputs, recording.y, strict=True)]
    panels = []
    for number, (signal, values, colour) in enumerate(rows):
        shown_t, shown = thin(t[part], values[part], most=CHANNEL_FIGURE.points)
        last_one = number == len(rows) - 1
        panels.append(
            Panel(
                f"{signal.name}\nin {signal.unit}",
                (Line(shown_t, shown, signal.name, colour),),  # type: ignore[arg-type]
                x_label="time in s" if last_one else "",
                marks=marks,
                height=0.7,
            )
        )
    return shown_over(plot(Chart("recording", tuple(panels), label)), (low, high))


def shown_over(figure: dict[str, Any], span: tuple[float, float]) -> dict[str, Any]:
    """Figure of which all panels show a span of time: one that is left out would widen the others."""
    for name, axis in figure["layout"].items():
        if name.startswith("xaxis"):
            axis["range"] = list(span)
    return figure
