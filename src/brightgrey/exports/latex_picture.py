"""Drawing of a drive as a picture of plain LaTeX, which needs no package: straight lines are degenerate curves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from brightgrey.drawing.items import STYLE, DrawnItem, Label, PlacedSymbol, Wire
from brightgrey.drawing.layout import Layout

__all__ = ["escaped", "latex_picture"]

_ESCAPES = str.maketrans({c: f"\\{c}" for c in "_%#&${}"} | {"\\": r"\textbackslash{}"})
_SIGNS = {
    "²": "$^2$",
    "³": "$^3$",
    "°": r"$^\circ$",
    "µ": r"$\mu$",
    "μ": r"$\mu$",
    "·": r"$\cdot$",
    "⁻¹": "$^{-1}$",
    "\u00a0": "~",
    "±": r"$\pm$",
    "α": r"$\alpha$",
    "ω": r"$\omega$",
    "φ": r"$\varphi$",
    "λ": r"$\lambda$",
    "Ω": r"$\Omega$",
}


@dataclass(frozen=True)
class _Policy:
    """Measures of the picture on paper."""

    scale: float = 0.7  #: Points per pixel: texts of 8 points, and rows of 640 pixels fit a page with 25 mm margins.
    page_height: float = 640.0  #: Points that a page has for the drawing.
    circle_sides: int = 24  #: Sides of a polygon that looks like a circle.
    line: float = 1.0  #: Thickness in pixels; what is made of dots looks thicker than it is.


POLICY = _Policy()
Points = Sequence[tuple[float, float]]


def escaped(text: str) -> str:
    """Text with the characters that mean something to LaTeX, or that its fonts lack, written as commands."""
    text = text.translate(_ESCAPES)
    for sign, spelled in _SIGNS.items():
        text = text.replace(sign, spelled)
    return text


def latex_picture(layout: Layout) -> str:
    """Environment ``picture`` with the drawing; a high one is made smaller so that it fits the page.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    str
    """
    scale = min(POLICY.scale, POLICY.page_height / layout.height)
    head = [
        rf"{{\setlength{{\unitlength}}{{{scale:.3f}pt}}\linethickness{{{POLICY.line * scale:.2f}pt}}\sffamily",
        rf"\noindent\begin{{picture}}({layout.width:.1f},{layout.height:.1f})",
    ]
    lines = [line for item in layout.items for line in _commands(item, layout.height, scale)]
    return "\n".join([*head, *lines, r"\end{picture}\par}"])


def _commands(item: DrawnItem, height: float, scale: float) -> Iterator[str]:
    if isinstance(item, Label):
        yield rf"\put({item.x:.1f},{height - item.y:.1f}){{{_label_commands(item, scale)}}}"
        return
    if isinstance(item, Wire):
        yield from _curves([(item.x1, height - item.y1), (item.x2, height - item.y2)], item.dashed)
        if item.arrow:
            x, y = item.x2, height - item.y2
            yield from _curves([(x - 9.0, y - 4.0), (x, y), (x - 9.0, y + 4.0)], dashed=False)
        return
    yield from _symbol_commands(item, height, scale)


def _symbol_commands(mark: PlacedSymbol, height: float, scale: float) -> Iterator[str]:
    symbol = mark.symbol
    for line in symbol.lines:
        yield from _curves([(mark.x + x, height - mark.y - y) for x, y in line], mark.dashed)
    for x, y, radius in symbol.circles:
        angles = [2.0 * math.pi * i / POLICY.circle_sides for i in range(POLICY.circle_sides + 1)]
        centre = mark.x + x, height - mark.y - y
        ring = [(centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in angles]
        yield from _curves(ring, mark.dashed)
    if symbol.letters:
        middle = mark.x + 0.5 * symbol.width, height - mark.y - 0.5 * symbol.height
        text = _sized(escaped(mark.letters), STYLE.size * scale)
        yield rf"\put({middle[0]:.1f},{middle[1]:.1f}){{\makebox(0,0){{{text}}}}}"


def _curves(points: Points, dashed: bool) -> Iterator[str]:
    """Pieces of a polygon, or its dashes."""
    for (x1, y1), (x2, y2) in pairwise(points):
        length = math.hypot(x2 - x1, y2 - y1)
        pieces = [(0.0, 1.0)]
        if dashed:
            count = max(1, round(length / (2.0 * STYLE.dash)))
            pieces = [((i + 0.25) / count, (i + 0.75) / count) for i in range(count)]
        for ends in pieces:
            (a, b), (c, d) = ((x1 + t * (x2 - x1), y1 + t * (y2 - y1)) for t in ends)
            yield rf"\qbezier({a:.2f},{b:.2f})({0.5 * (a + c):.2f},{0.5 * (b + d):.2f})({c:.2f},{d:.2f})"


def _label_commands(label: Label, scale: float) -> str:
    pieces = []
    for text, low in label.runs:
        size = label.size * scale * (STYLE.subscript if low else 1.0)
        piece = _sized(escaped(text), size)
        pieces.append(rf"\raisebox{{-{STYLE.drop * label.size * scale:.2f}pt}}{{{piece}}}" if low else piece)
    return "".join(pieces)


def _sized(text: str, size: float) -> str:
    return rf"{{\fontsize{{{size:.2f}}}{{{1.2 * size:.2f}}}\selectfont{{}}{text}}}"
