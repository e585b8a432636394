"""Tables and sparklines as HTML, for notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["sparkline", "table"]

WIDTH, HEIGHT = 180.0, 28.0  # pixels


def table(header: Sequence[str], rows: Iterable[Sequence[object]], unbroken: Sequence[str] = ()) -> str:
    """HTML table. Every cell is escaped, except the drawings that :func:`sparkline` returns.

    Cells of the columns `unbroken` stay in one line.
    """
    head = "".join(f'<th style="text-align:left">{html.escape(name)}</th>' for name in header)
    kept = [name in unbroken for name in header]
    body = "".join(f"<tr>{''.join(map(_cell, row, kept))}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class _Drawing(str):
    """HTML that may stand in a cell."""


def _cell(value: object, kept: bool) -> str:
    style = "text-align:left;white-space:nowrap" if kept else "text-align:left"
    return f'<td style="{style}">{value if isinstance(value, _Drawing) else html.escape(str(value))}</td>'


def sparkline(values: ArrayLike) -> str:
    """Line without axes through `values`, shape (samples,), for a cell of a :func:`table`."""
    y = np.asarray(values, float)
    edges = np.linspace(0, y.size, min(int(WIDTH), y.size) + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(y, edges), np.maximum.reduceat(y, edges)
    span = float(high.max() - low.min()) or 1.0
    x = np.repeat(np.linspace(1.0, WIDTH - 1.0, edges.size), 2)
    drawn = 1.0 + (HEIGHT - 2.0) * (1.0 - (np.column_stack([low, high]).ravel() - low.min()) / span)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), drawn.tolist(), strict=True))
    return _Drawing(
        f'<svg width="{WIDTH:g}" height="{HEIGHT:g}" role="img">'
        f'<polyline points="{points}" fill="none" stroke="currentColor" stroke-width="1"/></svg>'
    )
