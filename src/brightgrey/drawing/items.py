"""Items of a layout: marks (symbols), wires and texts, each with its box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from brightgrey.drawing.text_width import text_width
from brightgrey.effects import Symbol

__all__ = ["STYLE", "Box", "Cell", "DrawingStyle", "DrawnItem", "Label", "PlacedSymbol", "Wire"]

Box = tuple[float, float, float, float]
"""Left, top, right and bottom."""


@dataclass(frozen=True)
class DrawingStyle:
    """Measures of a drawing in pixels; texts of 12 pixels can be read on a telephone and in print."""

    size: float = 12.0  #: Of the font.
    small: float = 11.0  #: Of names and intervals.
    subscript: float = 0.75  #: Of a subscript, over the font's size.
    drop: float = 0.2  #: By which a subscript is lower, over the font's size.
    line_height: float = 16.0  #: So that no subscript reaches into the next line.
    ascent: float = 0.93  #: Of DejaVu Sans, over its size.
    descent: float = 0.24
    text_width: float = 124.0  #: Most pixels of a line, unless one value is longer.
    margin: float = 10.0
    wide: float = 1100.0  #: Of a row on a screen.
    medium: float = 640.0  #: Of a row on paper and in small windows.
    narrow: float = 376.0  #: Of a row on a telephone of 400 pixels, less the page's own margin.
    gap: float = 8.0  #: Between neighbours.
    row_gap: float = 22.0
    bus: float = 10.0  #: From the wire below or above a mass to what hangs on it.
    lead: float = 8.0  #: Wire between cells and parts.
    mark_width: float = 34.0  #: Of the letter where a row ends.
    input_mark: str = "u"  #: Letter where the input goes on, if it does not act on the first mass.
    line: float = 1.5  #: Thickness.
    dash: float = 3.0
    legend: str = "Dashed, with a question mark: the recording does not decide whether it is there."


STYLE = DrawingStyle()


@dataclass(frozen=True)
class PlacedSymbol:
    """Symbol at a place.

    Attributes
    ----------
    x, y : float
        Upper left corner.
    symbol : Symbol
    effect : str
        Name of the placed effect; empty for what belongs to none.
    about : str
        Sentence for people who point at it.
    dashed : bool
    """

    x: float
    y: float
    symbol: Symbol
    effect: str = ""
    about: str = ""
    dashed: bool = False

    @property
    def letters(self) -> str:
        """Text in its middle."""
        return f"{self.symbol.letters}?" if self.symbol.letters and self.dashed else self.symbol.letters

    @property
    def box(self) -> Box:
        """Box of the symbol."""
        return self.x, self.y, self.x + self.symbol.width, self.y + self.symbol.height

    def moved(self, x: float, y: float) -> PlacedSymbol:
        """The same elsewhere."""
        return replace(self, x=self.x + x, y=self.y + y)


@dataclass(frozen=True)
class Wire:
    """Straight line between parts, with an arrow head at its end or without."""

    x1: float
    y1: float
    x2: float
    y2: float
    arrow: bool = False
    dashed: bool = False

    @property
    def box(self) -> Box:
        """Box of the line, with its arrow head."""
        head = 4.0 if self.arrow else 0.5 * STYLE.line
        xs, ys = sorted((self.x1, self.x2)), sorted((self.y1, self.y2))
        across = (head, 0.0) if self.x1 == self.x2 else (0.0, head)
        return xs[0] - across[0], ys[0] - across[1], xs[1] + across[0], ys[1] + across[1]

    def moved(self, x: float, y: float) -> Wire:
        """The same elsewhere."""
        return replace(self, x1=self.x1 + x, x2=self.x2 + x, y1=self.y1 + y, y2=self.y2 + y)


@dataclass(frozen=True)
class Label:
    """One line of text.

    Attributes
    ----------
    x, y : float
        Left end of its base line.
    runs : tuple of (str, bool)
        Pieces, each with a mark if it is a subscript.
    size : float
    soft : bool
        It is less important than the rest.
    """

    x: float
    y: float
    runs: tuple[tuple[str, bool], ...]
    size: float = STYLE.size
    soft: bool = False

    @property
    def width(self) -> float:
        """Width in a font that is wider than the one that will be used."""
        return sum(text_width(t, self.size * (STYLE.subscript if low else 1.0)) for t, low in self.runs)

    @property
    def box(self) -> Box:
        """Box of the line with ascenders, descenders and subscripts."""
        depth = max(STYLE.drop + STYLE.subscript * STYLE.descent if low else STYLE.descent for _, low in self.runs)
        return self.x, self.y - STYLE.ascent * self.size, self.x + self.width, self.y + depth * self.size

    @property
    def plain(self) -> str:
        """Text without subscripts."""
        return "".join(text for text, _ in self.runs)

    def moved(self, x: float, y: float) -> Label:
        """The same elsewhere."""
        return replace(self, x=self.x + x, y=self.y + y)


DrawnItem = PlacedSymbol | Wire | Label


@dataclass(frozen=True)
class Cell:
    """Part of a row, with its axis at height 0 and its left end at 0."""

    width: float
    items: Sequence[DrawnItem]
    is_mark: bool = False  #: It only ends or begins a row.
    dashed: bool = False  #: What leads to it is not decided.
    top: float = field(init=False)
    bottom: float = field(init=False)

    def __post_init__(self) -> None:
        boxes = [item.box for item in self.items]
        object.__setattr__(self, "top", min(box[1] for box in boxes))
        object.__setattr__(self, "bottom", max(box[3] for box in boxes))
