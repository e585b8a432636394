"""Small drawings as SVG: trees, the ancestors of the best individual, a range with an interval."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from brightgrey.kit import Structure
from brightgrey.model.schema import ParameterPart
from brightgrey.report.charts.search_progress import ancestors, parents
from brightgrey.report.drawing.trees import edges, positions
from brightgrey.report.options import REPORT_OPTIONS

if TYPE_CHECKING:
    from brightgrey.search.genetic import Evaluation, Node, Run

__all__ = ["effect_numbers", "family", "range_bar", "tree"]

# Pixels: distances between the nodes of a tree, their radius, the margin; cells of the family; size of a range bar.
STEP, LEVEL, RADIUS, EDGE = 46.0, 44.0, 15.0, 20.0
CELL, ROW = 136.0, 54.0
BAR, TALL = 140.0, 16.0


@dataclass(frozen=True)
class _Spot:
    x: float
    y: float
    text: str
    title: str
    kind: str


def tree(root: Node) -> str:
    """Tree of effects by their numbers (the paper's figures 7 and 8)."""
    places = positions(root)
    spots = []
    for node, (x, depth) in zip(root.nodes(), places, strict=True):
        effect = node.type.effect
        text = str(effect.number) if node.type.place == 1 else f"{effect.number}@{node.type.place}"
        kind = "carrier" if effect.masses else "part"
        spots.append(_Spot(EDGE + STEP * x, EDGE + LEVEL * depth, text, str(node.type), kind))
    lines = [(spots[a], spots[b]) for a, b in edges(root)]
    shapes = "".join(f'<circle class="{s.kind}" cx="{s.x:g}" cy="{s.y:g}" r="{RADIUS:g}"/>' for s in spots)
    return _svg(spots, lines, shapes, (EDGE, EDGE), ("tree", "Tree of the numbers of the effects"))


def family(run: Run) -> str:
    """Ancestors of the best individual, the generations one below the other, the oldest on top."""
    found = [e for e in ancestors(run) if e.generation > run.best.generation - REPORT_OPTIONS.generations]
    spots: dict[tuple[int, int], _Spot] = {}
    shown = sorted({e.generation for e in found})
    for row, generation in enumerate(shown):
        for column, e in enumerate(
            sorted((e for e in found if e.generation == generation), key=_generation_and_number)
        ):
            kind = "carrier" if e is run.best else "part"
            x, y = EDGE + CELL * (column + 0.5), EDGE + ROW * row
            title = f"generation {generation}: {e.job.structure}, {e.operator}, criterion {e.value:.6g}"
            spots[_generation_and_number(e)] = _Spot(x, y, effect_numbers(e.job.structure), title, kind)
    lines = [
        (spots[_generation_and_number(parent)], spots[_generation_and_number(e)])
        for e in found
        for parent in parents(run, e)
        if _generation_and_number(parent) in spots
    ]
    half = (0.47 * CELL, 11.0)
    shapes = "".join(
        f'<rect class="{s.kind}" x="{s.x - half[0]:g}" y="{s.y - half[1]:g}" width="{2 * half[0]:g}" '
        f'height="{2 * half[1]:g}" rx="4"/>'
        for s in spots.values()
    )
    return _svg(list(spots.values()), lines, shapes, (0.5 * CELL, EDGE), ("family", "Ancestors of the best individual"))


def _generation_and_number(e: Evaluation) -> tuple[int, int]:
    return e.generation, e.individual


def effect_numbers(structure: Structure) -> str:
    """Structure as the paper writes it, ``(2,5,6,7)``."""
    return f"({','.join(str(p.effect.number) for p in structure.placed)})"


def _svg(
    spots: Sequence[_Spot],
    lines: Sequence[tuple[_Spot, _Spot]],
    shapes: str,
    rim: tuple[float, float],
    name: tuple[str, str],
) -> str:
    width, height = max(s.x for s in spots) + rim[0], max(s.y for s in spots) + rim[1]
    drawn = "".join(f'<line x1="{a.x:g}" y1="{a.y:g}" x2="{b.x:g}" y2="{b.y:g}"/>' for a, b in lines)
    words = "".join(
        f'<text x="{s.x:g}" y="{s.y + 4:g}">{html.escape(s.text)}<title>{html.escape(s.title)}</title></text>'
        for s in spots
    )
    size = f'width="{width:g}" height="{height:g}" viewBox="0 0 {width:g} {height:g}"'
    return f'<svg class="{name[0]}" role="img" {size}><title>{name[1]}</title>{drawn}{shapes}{words}</svg>'


def range_bar(part: ParameterPart, bounds: tuple[float, float] | None, *, log: bool) -> str:
    """Estimate and interval within the searched range; nothing where there is no range."""
    if bounds is None or not bounds[1] > bounds[0] or (log and not bounds[0] > 0.0):
        return ""

    def place(value: float) -> float:
        low, high = bounds
        share = math.log(max(value, low) / low) / math.log(high / low) if log else (value - low) / (high - low)
        return 4.0 + (BAR - 8.0) * min(max(share, 0.0), 1.0)

    middle = 0.5 * TALL
    parts = [f'<line class="whole" x1="4" x2="{BAR - 4:g}" y1="{middle:g}" y2="{middle:g}"/>']
    if part.ci95 is not None:
        low, high = (place(end) for end in part.ci95)
        parts.append(f'<line class="interval" x1="{low:.1f}" x2="{high:.1f}" y1="{middle:g}" y2="{middle:g}"/>')
    at = place(part.value)
    parts.append(f'<line class="estimate" x1="{at:.1f}" x2="{at:.1f}" y1="2" y2="{TALL - 2:g}"/>')
    label = f"{part.value:.4g} between {bounds[0]:.2g} and {bounds[1]:.2g} {part.unit}"
    scale = "logarithmic" if log else "linear"
    size = f'width="{BAR:g}" height="{TALL:g}" viewBox="0 0 {BAR:g} {TALL:g}"'
    return (
        f'<svg class="range" role="img" {size} aria-label="{html.escape(label)}">'
        f"<title>{html.escape(f'{label} ({scale})')}</title>{''.join(parts)}</svg>"
    )
