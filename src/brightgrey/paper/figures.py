"""Outputs of a population's models beside the reference (the paper's figures 6 and 9)."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from brightgrey.arrays import Array
from brightgrey.recordings import Recording
from brightgrey.report.drawing.matplotlib_figure import STYLE, quantity, thin

__all__ = ["outputs"]

SIZE = (7.6, 6.4)  # inches
REFERENCE = "#BBBBBB"
# Okabe and Ito's palette without yellow; dashes distinguish lines that lie on each other.
LINE_COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = ("-", "--", "-.", ":", (0, (6, 1, 1, 1, 1, 1)), (0, (3, 3)))


def outputs(recording: Recording, simulated: Sequence[Array], labels: Sequence[str], until: float = np.inf) -> Figure:
    """First output of several models over that of the reference; their distance from the reference below.

    Parameters
    ----------
    recording : Recording
    simulated : sequence of ndarray, each of shape (samples,)
        In SI.
    labels : sequence of str
        One per model.
    until : float
        Last time in s that is drawn.
    """
    signal = recording.outputs[0]
    shown = recording.t <= until
    t, measured = recording.t[shown], recording.y[0][shown] * signal.factor
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]})
        top.plot(*thin(t, measured), color=REFERENCE, linewidth=4.5, label="reference")
        for number, (y, label) in enumerate(zip(simulated, labels, strict=True)):
            style = {
                "color": LINE_COLOURS[number % len(LINE_COLOURS)],
                "linestyle": DASHES[number % len(DASHES)],
                "linewidth": 1.1,
            }
            line = y[shown] * signal.factor
            top.plot(*thin(t, line), label=label, **style)
            distance = np.maximum(np.abs(line - measured), 1e-12)
            bottom.plot(*thin(t, distance), **style)
        top.set_ylabel(f"{quantity(signal.kind)} in {signal.unit}")
        bottom.set_ylabel(f"distance from the\nreference in {signal.unit}")
        bottom.set_yscale("log")
        largest = max(float(np.abs(measured).max()), 1e-12)
        bottom.set_ylim(1e-5 * largest, 2.0 * largest)
        bottom.set_xlabel("time in s")
        figure.legend(loc="outside lower center", ncols=2, fontsize=7.5)
        for axes in (top, bottom):
            axes.margins(x=0.01)
    return figure
