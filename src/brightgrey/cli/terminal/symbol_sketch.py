"""Symbols of effects in the terminal: their lines and circles as dots of braille characters, their letters as text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from brightgrey.effects import Symbol, registry

__all__ = ["effect_sketch", "symbol_sketch"]

PIXELS_PER_DOT = 2.6
DOT_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the two dots in each of the four rows of a braille character, which begin at U+2800."""


def effect_sketch(name: str) -> list[str]:
    """Lines that show the parts of an effect of a rotary drive in their order; dampers apart."""
    parts = [s for s in registry()[name].symbols if s.motion != "linear" and s.at != "damper"]
    return symbol_sketch(sorted(parts, key=lambda part: (part.place, part.at != "body")))


def symbol_sketch(symbols: Sequence[Symbol]) -> list[str]:
    """Lines of text that show symbols side by side, as high as the highest of them.

    Parameters
    ----------
    symbols : sequence of Symbol

    Returns
    -------
    list of str
        All of the same length.
    """
    height = max(symbol.height for symbol in symbols)
    rows = math.ceil((height / PIXELS_PER_DOT + 1.0) / 4.0)
    drawn = [_drawn_symbol(symbol, 0.5 * (height - symbol.height), rows) for symbol in symbols]
    return ["".join(parts) for parts in zip(*drawn, strict=True)]


def _drawn_symbol(symbol: Symbol, top: float, rows: int) -> list[str]:
    """One symbol, `top` pixels below the upper edge."""
    columns = math.ceil((symbol.width / PIXELS_PER_DOT + 1.0) / 2.0)
    cells = [[0] * columns for _ in range(rows)]
    for x, y in _points(symbol):
        column, row = round(x / PIXELS_PER_DOT), round((y + top) / PIXELS_PER_DOT)
        cells[row // 4][column // 2] |= DOT_BITS[row % 4][column % 2]
    lines = [[chr(0x2800 + bits) if bits else " " for bits in cells_of_row] for cells_of_row in cells]
    if symbol.letters:
        middle = int((top + 0.5 * symbol.height) / PIXELS_PER_DOT) // 4
        start = (columns - len(symbol.letters)) // 2
        lines[middle][start : start + len(symbol.letters)] = symbol.letters
    return ["".join(line) for line in lines]


def _points(symbol: Symbol) -> Iterator[tuple[float, float]]:
    """Points along the lines and circles, closer than the dots."""
    for line in symbol.lines:
        for a, b in pairwise(line):
            yield from _dots_between(a, b)
    for x, y, radius in symbol.circles:
        turn = [2.0 * math.pi * k / 64 for k in range(65)]
        for a, b in pairwise([(x + radius * math.cos(t), y + radius * math.sin(t)) for t in turn]):
            yield from _dots_between(a, b)


def _dots_between(a: tuple[float, float], b: tuple[float, float]) -> Iterable[tuple[float, float]]:
    steps = max(math.ceil(math.dist(a, b) / (0.5 * PIXELS_PER_DOT)), 1)
    return [(a[0] + (b[0] - a[0]) * k / steps, a[1] + (b[1] - a[1]) * k / steps) for k in range(steps + 1)]
