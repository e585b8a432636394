"""Charts of lines as an SVG file of their own, without the second that the import of matplotlib takes."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.report.charts.chart import COLOURS, Chart, Line, Panel

__all__ = ["svg_figure"]

WIDTH, HEIGHT = 760.0, 270.0  # pixels; the height is that of a panel of height 1
LEFT, RIGHT, ABOVE, BELOW, BETWEEN = 84.0, 12.0, 26.0, 44.0, 10.0  # margins around a panel
TICK_STEPS = (1.0, 2.0, 5.0, 10.0)
FONT = 12.0


@dataclass(frozen=True)
class _Axis:
    """Linear axis: values from `low` to `high` on pixels from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float

    def pixels(self, values: Array | float) -> Array:
        return np.asarray(
            self.start + (np.asarray(values) - self.low) * (self.end - self.start) / (self.high - self.low)
        )

    def ticks(self, pixels: float) -> list[float]:
        """Round values with at least so many pixels between them."""
        wanted = (self.high - self.low) * pixels / abs(self.end - self.start)
        power = 10.0 ** math.floor(math.log10(wanted))
        step = power * next(s for s in TICK_STEPS if s * power >= wanted * (1.0 - 1e-9))
        first, last = math.ceil(self.low / step), math.floor(self.high / step)
        return [step * n for n in range(first, last + 1)]


def svg_figure(charts: Sequence[Chart]) -> str:
    """Draw charts of lines on linear axes, one panel below the other.

    Parameters
    ----------
    charts : sequence of Chart

    Returns
    -------
    str
        Content of an SVG file. The same charts give the same text.
    """
    parts: list[str] = []
    top = 0.0
    for panel in (panel for chart in charts for panel in chart.panels):
        top += ABOVE if panel.title else BETWEEN
        bottom = top + HEIGHT * panel.height
        parts += _panel(panel, top, bottom)
        top = bottom + (BELOW if panel.x_label else 0.0)
    size = f'width="{WIDTH:g}" height="{top:g}" viewBox="0 0 {WIDTH:g} {top:g}"'
    font = f'font-family="sans-serif" font-size="{FONT:g}"'
    background = f'<rect width="{WIDTH:g}" height="{top:g}" fill="white"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {font}>\n{background}\n' + "\n".join(parts) + "\n</svg>\n"


def _panel(panel: Panel, top: float, bottom: float) -> Iterator[str]:
    x = _Axis(*_range([line.x for line in panel.lines], 0.01), LEFT, WIDTH - RIGHT)
    y = _Axis(*_range([np.array(panel.levels), *(line.y for line in panel.lines)], 0.05), bottom, top)
    for value in x.ticks(60.0):
        at = float(x.pixels(value))
        yield f'<path d="M{at:.1f} {top:.1f}V{bottom:.1f}" stroke="#dddddd"/>'
        if panel.x_label:
            yield _text(f"{value:.6g}", at, bottom + 16.0)
    for value in y.ticks(25.0):
        at = float(y.pixels(value))
        yield f'<path d="M{LEFT:g} {at:.1f}H{WIDTH - RIGHT:g}" stroke="#dddddd"/>'
        yield _text(f"{value:.6g}", LEFT - 6.0, at + 4.0, "end")
    for level in panel.levels:
        yield f'<path d="M{LEFT:g} {float(y.pixels(level)):.1f}H{WIDTH - RIGHT:g}" stroke="#888888"/>'
    yield f'<path d="M{LEFT:g} {top:.1f}V{bottom:.1f}H{WIDTH - RIGHT:g}" stroke="black" fill="none"/>'
    yield from (_line(line, x, y) for line in panel.lines)
    yield _text(panel.title, LEFT, top - 10.0, "start")
    yield _text(panel.x_label, 0.5 * (LEFT + WIDTH - RIGHT), bottom + 36.0)
    words = panel.y_label.split("\n")
    for number, word in enumerate(words):
        yield _text(word, 16.0 + 14.0 * (number + 1 - 0.5 * len(words)), 0.5 * (top + bottom), turned=True)
    named = [line for line in panel.lines if line.label]
    for number, line in enumerate(named if len(named) > 1 else []):
        at = WIDTH - RIGHT - 100.0 * (len(named) - number)
        yield f'<path d="M{at:g} {top - 14.0:.1f}h24" stroke="{COLOURS[line.colour]}" stroke-width="{line.width:g}"/>'
        yield _text(line.label, at + 30.0, top - 10.0, "start")


def _range(values: Sequence[Array], margin: float) -> tuple[float, float]:
    """Range of all finite values, widened by a part of it on both sides."""
    every = np.concatenate(values)
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if every.size else (0.0, 1.0)
    wider = margin * (high - low) or 0.5
    return low - wider, high + wider


def _line(line: Line, x: _Axis, y: _Axis) -> str:
    """Path through the points; one that is not finite interrupts it."""
    points = zip(x.pixels(line.x).tolist(), y.pixels(line.y).tolist(), strict=True)
    words, pen = [], "M"
    for across, up in points:
        finite = math.isfinite(up)
        if finite:
            words.append(f"{pen}{across:.1f} {up:.1f}")
        pen = "L" if finite else "M"
    dashes = ' stroke-dasharray="5 3"' if line.style == "dashed" else ""
    stroke = f'stroke="{COLOURS[line.colour]}" stroke-width="{line.width:g}" stroke-linejoin="round"'
    return f'<path d="{"".join(words)}" fill="none" {stroke}{dashes}/>'


def _text(text: str, x: float, y: float, anchor: str = "middle", *, turned: bool = False) -> str:
    rotation = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{rotation}>{html.escape(text)}</text>' if text else ""
