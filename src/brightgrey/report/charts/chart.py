"""Data of a figure, independent of how it is drawn: computed once, drawn for paper and for the page."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from brightgrey.arrays import Array
from brightgrey.report.options import REPORT_OPTIONS

__all__ = ["COLOURS", "Chart", "Colour", "Line", "Mark", "Panel", "thin"]

Colour = Literal["measured", "simulated", "residual", "second", "soft"]
Style = Literal["line", "dashed", "points", "bars", "band"]
# Okabe and Ito's palette, which every common colour vision can distinguish; in print its lightness differs.
COLOURS: Mapping[Colour, str] = {
    "measured": "#56B4E9",
    "simulated": "#000000",
    "residual": "#D55E00",
    "second": "#009E73",
    "soft": "#888888",
}


@dataclass(frozen=True, eq=False)
class Line:
    """Numbers that are drawn together.

    Attributes
    ----------
    x, y : ndarray, shape (points,)
    label : str
        For the legend; empty for none.
    colour : str
        Meaning of the line; each way of drawing has a colour for it.
    style : {'line', 'dashed', 'points', 'bars', 'band'}
        A band lies between `low` and `y`.
    width : float
        Of the line, in points.
    low : ndarray, shape (points,), optional
    texts : tuple of str
        One per point, shown where the page is pointed at.
    """

    x: Array
    y: Array
    label: str
    colour: Colour
    style: Style = "line"
    width: float = 1.2
    low: Array | None = None
    texts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Mark:
    """A vertical line at `x` with a word above it, on its right or on its left."""

    x: float
    label: str
    left: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes; quantities and their units stand in the labels.

    Attributes
    ----------
    y_label : str
    lines : tuple of Line
    x_label : str
        Empty where the panel below has the same axis and is zoomed with it.
    title : str
    marks : tuple of Mark
    levels : tuple of float
        Values of y with a thin horizontal line.
    x_log, y_log : bool
    height : float
        Relative to the other panels of a chart.
    """

    y_label: str
    lines: tuple[Line, ...]
    x_label: str = ""
    title: str = ""
    marks: tuple[Mark, ...] = ()
    levels: tuple[float, ...] = ()
    x_log: bool = False
    y_log: bool = False
    height: float = 1.0


@dataclass(frozen=True)
class Chart:
    """Panels one above the other, and a sentence below."""

    name: str
    panels: tuple[Panel, ...]
    caption: str = ""


def thin(t: Array, *lines: Array, most: int = REPORT_OPTIONS.line_points) -> tuple[Array, ...]:
    """Fewer points that draw the same: of each bin the samples where some line has its extremes.

    Parameters
    ----------
    t : ndarray, shape (samples,)
    *lines : ndarray, shape (samples,)
    most : int
        Number of points that are left at most.

    Returns
    -------
    tuple of ndarray
        t and the lines at the samples that were kept.
    """
    bins = most // (2 * len(lines) + 1)
    if t.size <= most:
        return (t, *lines)
    edges = np.linspace(0, t.size, bins + 1).astype(int)
    keep = {0, t.size - 1}
    for low, high in itertools.pairwise(edges):
        for line in lines:
            part = np.where(np.isfinite(line[low:high]), line[low:high], 0.0)
            keep |= {int(low + np.argmin(part)), int(low + np.argmax(part))}
    index = np.array(sorted(keep))
    return (t[index], *(line[index] for line in lines))
