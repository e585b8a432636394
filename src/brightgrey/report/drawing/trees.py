"""Drawings of a population's trees (the paper's figures 7 and 8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from brightgrey.effects import registry

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from brightgrey.search.genetic import Node

__all__ = ["edges", "positions", "trees"]

TREES_PER_ROW, PANEL, LEGEND = 3, (2.5, 2.1), 0.55  # trees; width and height of one and height of the legend in inches
CARRIER, PART = "#D9EAF7", "#FFFFFF"  # colours of the effect with the masses, and of the others


def positions(tree: Node) -> tuple[tuple[float, int], ...]:
    """Place of every node in pre-order: across, in widths of a node, and depth.

    Leaves stand side by side, a parent above the middle of its children.
    """
    places: list[tuple[float, int]] = []
    _position_branch(tree, 0, 0.0, places)
    return tuple(places)


def _position_branch(node: Node, depth: int, left: float, places: list[tuple[float, int]]) -> float:
    """Place `node` and its branch from `left` on; returns where the next branch begins."""
    own = len(places)
    places.append((left, depth))
    right, across = left, []
    for child in node.children:
        at = len(places)
        right = _position_branch(child, depth + 1, right, places)
        across.append(places[at][0])
    if across:
        places[own] = (0.5 * (across[0] + across[-1]), depth)
    return max(right, left + 1.0)


def trees(population: Sequence[Node], titles: Sequence[str]) -> Figure:
    """One tree per individual; a node shows the number of its effect, with the place if it is not the first.

    Parameters
    ----------
    population : sequence of Node
    titles : sequence of str
        One per tree.

    Returns
    -------
    matplotlib.figure.Figure
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from brightgrey.report.drawing.matplotlib_figure import STYLE

    rows = -(-len(population) // TREES_PER_ROW)
    with mpl.rc_context(STYLE | {"axes.grid": False}):
        height = rows * PANEL[1] + LEGEND
        figure = Figure(figsize=(TREES_PER_ROW * PANEL[0], height))
        figure.subplots_adjust(left=0.01, right=0.99, bottom=LEGEND / height, top=1.0 - 0.3 / height, hspace=0.2)
        grid = figure.subplots(rows, TREES_PER_ROW, squeeze=False).ravel()
        for axes in grid:
            axes.set_axis_off()
        for axes, tree, title in zip(grid, population, titles, strict=False):
            axes.set_title(title, fontsize=8)
            _draw_tree(axes, tree)
        names = [f"{effect.number} {effect.name}" for effect in registry().values()]
        half = -(-len(names) // 2)
        legend = "\n".join("    ".join(part).replace("_", " ") for part in (names[:half], names[half:]))
        figure.text(0.5, 0.1 / height, f"{legend}\nThe order has no meaning.", ha="center", va="bottom", fontsize=7.5)
    return figure


def _draw_tree(axes: Axes, tree: Node) -> None:
    places = positions(tree)
    for parent, child in edges(tree):
        (x0, y0), (x1, y1) = places[parent], places[child]
        axes.plot([x0, x1], [-y0, -y1], color="#666666", linewidth=1.0, zorder=1)
    for node, (x, depth) in zip(tree.nodes(), places, strict=True):
        effect = node.type.effect
        text = str(effect.number) if node.type.place == 1 else f"{effect.number}@{node.type.place}"
        box = {"boxstyle": "circle,pad=0.35", "facecolor": CARRIER if effect.masses else PART, "edgecolor": "#222222"}
        axes.text(x, -depth, text, ha="center", va="center", fontsize=9, bbox=box, zorder=2)
    width = max(x for x, _ in places)
    depth = max(d for _, d in places)
    pad = max(0.0, 3.0 - width) / 2
    axes.set_xlim(-0.6 - pad, width + 0.6 + pad)
    axes.set_ylim(-max(depth, 3) - 0.5, 0.5)


def edges(tree: Node) -> list[tuple[int, int]]:
    """Parent and child of every edge, as positions in pre-order."""
    found, at = [], 1
    for child in tree.children:
        found.append((0, at))
        found += [(at + a, at + b) for a, b in edges(child)]
        at += child.size
    return found
