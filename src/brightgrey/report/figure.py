"""Figures, all through this one module: the same style everywhere, units on every axis, colour-blind safe."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from brightgrey.export.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["MEASURED", "RESIDUAL", "SIMULATED", "comparison", "picture"]

Array = NDArray[np.float64]

# Okabe and Ito's palette: told apart with every common colour vision, and by lightness in print.
MEASURED = "#56B4E9"
SIMULATED = "#000000"
RESIDUAL = "#D55E00"

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
PANEL = (7.6, 3.8)  # inches, per recording and output
MOST_POINTS = 3000  # per line; more than any page has pixels across


def comparison(traces: Sequence[Trace]) -> Figure:
    """Measured against simulated output with the residual below, one panel per recording and output.

    Parameters
    ----------
    traces : sequence of Trace
        Outputs in their own units, time in s.

    Returns
    -------
    matplotlib.figure.Figure
        Not registered with pyplot; ``figure.savefig`` writes it, notebooks show it.
    """
    panels = [(trace, row) for trace in traces for row in range(len(trace.outputs))]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PANEL[0], PANEL[1] * len(panels)), layout="constrained")
        axes = figure.subplots(2 * len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": [3, 1] * len(panels)})[
            :, 0
        ]
        for number, (trace, row) in enumerate(panels):
            _panel(axes[2 * number], axes[2 * number + 1], trace, row)
        figure.align_ylabels()
    return figure


def _panel(top: Axes, bottom: Axes, trace: Trace, row: int) -> None:
    signal = trace.outputs[row]
    title = f"{trace.name}: {signal.name}" + (" (test recording)" if trace.test else "")
    top.set_title(_plain(title), loc="left", fontsize=10)
    t, measured, simulated = thin(trace.t, trace.measured[row], trace.simulated[row])
    top.plot(t, measured, color=MEASURED, linewidth=2.6, label="measured")
    top.plot(t, simulated, color=SIMULATED, linewidth=0.9, label="simulated")
    top.set_ylabel(_plain(f"{quantity(signal.kind)} in {signal.unit}"))
    top.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    top.tick_params(labelbottom=False)
    top.sharex(bottom)
    t, residual = thin(trace.t, trace.residual[row])
    bottom.axhline(0.0, color="#888888", linewidth=0.8)
    bottom.plot(t, residual, color=RESIDUAL, linewidth=0.8)
    bottom.set_ylabel(_plain(f"residual\nin {signal.unit}"))
    bottom.set_xlabel("time in s")
    for axes in (top, bottom):
        axes.margins(x=0.01)


def quantity(kind: str) -> str:
    """Name the quantity of a signal: ``velocity-differenced`` is a velocity."""
    return kind.partition("-")[0]


def _plain(text: str) -> str:
    """Keep matplotlib from reading a dollar sign in a column's name as mathematics."""
    return text.replace("$", r"\$")


def thin(t: Array, *lines: Array) -> tuple[Array, ...]:
    """Fewer points that draw the same: of each bin the samples where some line has its extremes.

    Parameters
    ----------
    t : ndarray, shape (samples,)
    *lines : ndarray, shape (samples,)

    Returns
    -------
    tuple of ndarray
        t and the lines at the samples that were kept.
    """
    bins = MOST_POINTS // (2 * len(lines) + 1)
    if t.size <= MOST_POINTS:
        return (t, *lines)
    edges = np.linspace(0, t.size, bins + 1).astype(int)
    keep = {0, t.size - 1}
    for low, high in itertools.pairwise(edges):
        for line in lines:
            part = np.where(np.isfinite(line[low:high]), line[low:high], 0.0)
            keep |= {int(low + np.argmin(part)), int(low + np.argmax(part))}
    index = np.array(sorted(keep))
    return (t[index], *(line[index] for line in lines))


def picture(figure: Figure, kind: Literal["svg", "png", "pdf"] = "svg") -> bytes:
    """Figure as file content, without a date in it."""
    stream = io.BytesIO()
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context(STYLE):
        figure.savefig(stream, format=kind, metadata=metadata, dpi=150)
    return stream.getvalue()
