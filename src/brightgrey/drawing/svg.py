"""Layout as SVG: text stays text, colours follow light and dark, and nothing is loaded from outside."""

from __future__ import annotations

import html
from collections.abc import Iterator

from brightgrey.drawing.items import STYLE, Label, PlacedSymbol, Wire
from brightgrey.drawing.layout import Layout
from brightgrey.effects import Symbol

__all__ = ["svg", "symbol_svg"]

# Inside a page the variables of the page are used where there are any.
_CSS = (
    ".drive{--drive-ink:var(--ink,#1d1d1f);--drive-soft:var(--soft,#5f5f66);--drive-paper:var(--paper,#fff);"
    "background:var(--drive-paper);font-family:system-ui,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif}"
    "@media (prefers-color-scheme:dark){.drive{--drive-ink:var(--ink,#ececf0);--drive-soft:var(--soft,#a5a5ad);"
    "--drive-paper:var(--paper,#17171a)}}"
    "@media print{.drive{--drive-ink:#000;--drive-soft:#444;--drive-paper:#fff}}"
    f".drive .stroke{{fill:none;stroke:var(--drive-ink);stroke-width:{STYLE.line};stroke-linejoin:round;"
    "stroke-linecap:round}"
    f".drive .dashed{{stroke-dasharray:{STYLE.dash:g} {STYLE.dash:g}}}.drive .head{{fill:var(--drive-ink)}}"
    ".drive text{fill:var(--drive-ink)}.drive .soft{fill:var(--drive-soft)}"
)


def svg(layout: Layout) -> str:
    """Text of an SVG file, which may also stand inside a page.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    str
        The same layout gives the same text.
    """
    title = html.escape(layout.title)
    described = " ".join(f"{item.about}." for item in layout.items if isinstance(item, PlacedSymbol) and item.effect)
    body = "".join([*_wires(layout), *(_item(item) for item in layout.items)])
    size = f"{layout.width:.1f}", f"{layout.height:.1f}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="drive" role="img" viewBox="0 0 {size[0]} {size[1]}" '
        f'width="{size[0]}" height="{size[1]}" style="max-width:100%;height:auto">'
        f"<title>{title}</title><desc>{html.escape(described)}</desc><style>{_CSS}</style>{body}</svg>"
    )


def symbol_svg(symbol: Symbol) -> str:
    """Symbol alone, as SVG."""
    return svg(Layout("Symbol", symbol.width + 4.0, symbol.height + 4.0, (PlacedSymbol(2.0, 2.0, symbol),)))


def _wires(layout: Layout) -> Iterator[str]:
    """All wires as one path of each kind: where two of a kind meet, no spot is darker."""
    for dashed in (False, True):
        wires = [item for item in layout.items if isinstance(item, Wire) and item.dashed == dashed]
        if wires:
            ends = "".join(_path([(wire.x1, wire.y1), (wire.x2, wire.y2)]) for wire in wires)
            yield f'<path {_stroke(dashed)} d="{ends}"/>'


def _item(item: PlacedSymbol | Wire | Label) -> str:
    if isinstance(item, Label):
        return _label_text(item)
    if isinstance(item, Wire):
        return _arrow_head(item) if item.arrow else ""
    effect = f' data-effect="{html.escape(item.effect)}"' if item.effect else ""
    about = f"<title>{html.escape(item.about)}</title>" if item.about else ""
    return f"<g{effect}>{about}{''.join(_symbol_shapes(item))}</g>"


def _symbol_shapes(mark: PlacedSymbol) -> Iterator[str]:
    symbol = mark.symbol
    kind = _stroke(mark.dashed)
    if symbol.lines:
        points = [[(mark.x + x, mark.y + y) for x, y in line] for line in symbol.lines]
        yield f'<path {kind} d="{"".join(map(_path, points))}"/>'
    for x, y, radius in symbol.circles:
        yield f'<circle {kind} cx="{mark.x + x:.1f}" cy="{mark.y + y:.1f}" r="{radius:.1f}"/>'
    if symbol.letters:
        x, y = mark.x + 0.5 * symbol.width, mark.y + 0.5 * symbol.height + 0.36 * STYLE.size
        letters = html.escape(mark.letters)
        yield f'<text x="{x:.1f}" y="{y:.1f}" font-size="{STYLE.size:g}" text-anchor="middle">{letters}</text>'


def _stroke(dashed: bool) -> str:
    return f'class="stroke{" dashed" if dashed else ""}"'


def _path(points: list[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _arrow_head(wire: Wire) -> str:
    """Arrow head at the right end of a level wire."""
    x, y = wire.x2, wire.y2
    return f'<path class="head" d="{_path([(x, y), (x - 9.0, y - 4.0), (x - 9.0, y + 4.0)])}Z"/>'


def _label_text(text: Label) -> str:
    drop = STYLE.drop * text.size
    pieces, lowered = [], False
    for piece, low in text.runs:
        shift = f' dy="{drop if low else -drop:.1f}"' if low != lowered else ""
        size = f' font-size="{STYLE.subscript * text.size:.1f}"' if low else ""
        pieces.append(f"<tspan{shift}{size}>{html.escape(piece)}</tspan>" if shift or size else html.escape(piece))
        lowered = low
    kind = ' class="soft"' if text.soft else ""
    return f'<text{kind} x="{text.x:.1f}" y="{text.y:.1f}" font-size="{text.size:g}">{"".join(pieces)}</text>'
