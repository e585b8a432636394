"""Charts as the page draws them: data and layout of plotly.js, colours by the names of the page's own."""

from __future__ import annotations

import base64
import gzip
import html
import json
import math
import struct
import zlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brightgrey.errors import SettingsError
from brightgrey.model.files import write_file
from brightgrey.report.charts.chart import Chart, Line, Panel
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.simulation.kernel.machine.compilation import cache_folder

__all__ = ["library", "plot", "script"]

HEIGHT, BETWEEN, BELOW, ABOVE, MARKED = 250, 26, 52, 34, 14  # pixels: panel of height 1, gaps, margins, words of marks


@cache
def library() -> str:
    """plotly.js, which the page carries in itself: packed by gzip, in base64. It has 4.6 MB of text.

    Packing would be a third of the time of every page, so what is packed is kept beside the compiled kernel.
    """
    from plotly.offline import get_plotlyjs

    text = get_plotlyjs().encode()
    end = struct.pack("<II", zlib.crc32(text), len(text))  # of a gzip file, which so is that of this text, and whole
    kept, packed = cache_folder().parent / "plotly.js.gz", b""
    with suppress(OSError):
        packed = kept.read_bytes()
    if not packed.endswith(end):
        packed = gzip.compress(text, mtime=0, compresslevel=6)
        with suppress(OSError, SettingsError):  # a cache that cannot be written costs time and nothing else
            write_file(kept, packed)
    return base64.b64encode(packed).decode()


def script(value: Any) -> str:
    """JSON that may stand in a script element."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def plot(chart: Chart) -> dict[str, Any]:
    """Figure of plotly.js; colours are written ``var(--name)`` and are filled in by the page.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    dict
        ``data`` and ``layout``.
    """
    sizes = [HEIGHT * panel.height for panel in chart.panels]
    gaps = [BETWEEN if not panel.x_label else BELOW for panel in chart.panels[:-1]]
    inner = sum(sizes) + sum(gaps)
    above = ABOVE + (MARKED if any(mark.label for mark in chart.panels[0].marks) else 0)
    layout: dict[str, Any] = {
        "height": round(inner + above + BELOW),
        "margin": {"l": 64, "r": 12, "t": above, "b": BELOW},
        "paper_bgcolor": "var(--card)",
        "plot_bgcolor": "var(--card)",
        "font": {"color": "var(--ink)", "size": 12, "family": "system-ui, sans-serif"},
        "legend": {
            "orientation": "h",
            "x": 0,
            "xanchor": "left",
            "y": 1.0 + (above - ABOVE) / inner,
            "yanchor": "bottom",
        },
        "hovermode": "closest",
        "dragmode": "zoom",
        "shapes": [],
        "annotations": [],
    }
    data: list[dict[str, Any]] = []
    top = inner
    for number, (panel, size) in enumerate(zip(chart.panels, sizes, strict=True)):
        tag = "" if number == 0 else str(number + 1)
        below = str(number + 2) if not panel.x_label else ""
        domain = [max((top - size) / inner, 0.0), min(top / inner, 1.0)]
        layout[f"xaxis{tag}"] = _x_axis_layout(panel, tag, below)
        layout[f"yaxis{tag}"] = _y_axis_layout(panel, tag) | {"domain": domain}
        data += [part for line in panel.lines for part in _plotly_traces(line, tag)]
        layout["shapes"] += _shapes(panel, tag)
        layout["annotations"] += _annotations(panel, tag)
        top -= size + (gaps[number] if number < len(gaps) else 0.0)
    return {"data": data, "layout": layout}


def _axis_layout(label: str, log: bool) -> dict[str, Any]:
    return {
        "title": {"text": html.escape(label, quote=False).replace("\n", "<br>"), "standoff": 8},
        "type": "log" if log else "linear",
        "gridcolor": "var(--line)",
        "linecolor": "var(--soft)",
        "zeroline": False,
        "automargin": True,
        "exponentformat": "power" if log else "e",
        **({"dtick": 1} if log else {}),
    }


def _y_axis_layout(panel: Panel, tag: str) -> dict[str, Any]:
    axis = _axis_layout(panel.y_label, panel.y_log) | {"anchor": f"x{tag}"}
    values = np.concatenate([line.y[line.y > 0.0] for line in panel.lines])
    few = panel.y_log and values.size > 0 and values.max() < REPORT_OPTIONS.few_decades * values.min()
    if not few:
        return axis
    powers = range(math.floor(math.log10(values.min())), math.ceil(math.log10(values.max())) + 1)
    ticks = [float(f"{digit}e{power}") for power in powers for digit in (1, 2, 5)]
    return axis | {"tickvals": ticks, "ticktext": [f"{tick:g}" for tick in ticks]}


def _x_axis_layout(panel: Panel, tag: str, below: str) -> dict[str, Any]:
    axis = _axis_layout(panel.x_label, panel.x_log) | {"anchor": f"y{tag}"}
    return axis | {"matches": f"x{below}", "showticklabels": False} if below else axis


def _json_numbers(values: NDArray[np.float64]) -> list[float | None]:
    """Values with seven digits, which no screen can tell from more; None for those that are not finite."""
    return [float(f"{v:.7g}") if math.isfinite(v) else None for v in values.tolist()]


def _plotly_traces(line: Line, tag: str) -> Iterable[dict[str, Any]]:
    """Traces of plotly.js; a band takes two, of which the first is its lower edge."""
    colour = f"var(--{line.colour})"
    base: dict[str, Any] = {
        "type": "scatter",
        "x": _json_numbers(line.x),
        "y": _json_numbers(line.y),
        "xaxis": f"x{tag}",
        "yaxis": f"y{tag}",
        "name": html.escape(line.label, quote=False),
        "showlegend": bool(line.label),
    }
    if line.style == "bars":
        yield base | {"type": "bar", "marker": {"color": colour}}
    elif line.style == "points":
        texts = [html.escape(text, quote=False) for text in line.texts]
        hover = {"text": texts, "hovertemplate": "%{text}<br>%{x}, %{y}<extra></extra>"} if texts else {}
        yield base | {"mode": "markers", "marker": {"color": colour, "size": 2.2 * line.width}} | hover
    elif line.style == "band" and line.low is not None:
        edge = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
        yield base | edge | {"y": _json_numbers(line.low), "showlegend": False}
        yield base | edge | {"fill": "tonexty", "fillcolor": f"var(--{line.colour}-band)"}
    else:
        dash = "dash" if line.style == "dashed" else "solid"
        yield base | {"mode": "lines", "line": {"color": colour, "width": line.width, "dash": dash}}


def _shapes(panel: Panel, tag: str) -> Sequence[dict[str, Any]]:
    thin = {"type": "line", "layer": "below", "line": {"color": "var(--soft)", "width": 1}}
    levels = [
        thin | {"xref": f"x{tag} domain", "x0": 0, "x1": 1, "yref": f"y{tag}", "y0": y, "y1": y} for y in panel.levels
    ]
    dotted = {"line": {"color": "var(--soft)", "width": 1, "dash": "dot"}}
    marks = [
        thin | dotted | {"xref": f"x{tag}", "x0": m.x, "x1": m.x, "yref": f"y{tag} domain", "y0": 0, "y1": 1}
        for m in panel.marks
    ]
    return levels + marks


def _annotations(panel: Panel, tag: str) -> list[dict[str, Any]]:
    return [
        {
            "text": html.escape(mark.label, quote=False),
            "x": math.log10(mark.x) if panel.x_log else mark.x,
            "xref": f"x{tag}",
            "y": 1,
            "yref": f"y{tag} domain",
            "yanchor": "bottom",
            "xanchor": "right" if mark.left else "left",
            "showarrow": False,
            "font": {"size": 10, "color": "var(--soft)"},
        }
        for mark in panel.marks
        if mark.label
    ]
