"""Widths of texts, so that a layout knows their boxes without a browser.

They are those of DejaVu Sans, which is wider than the fonts that browsers and TeX put in its place. A character that is
not listed counts as wide as the widest one.
"""

from __future__ import annotations

import re

__all__ = ["WIDTHS", "text_width", "wrap"]

_FIRST = 32
_ASCII = (
    *(318, 401, 460, 838, 637, 951, 780, 275, 391, 391, 500, 838, 318, 361, 318, 337),
    *(637, 637, 637, 637, 637, 637, 637, 637, 637, 637, 337, 337, 838, 838, 838, 531),
    *(1000, 685, 687, 699, 771, 632, 576, 775, 752, 295, 295, 656, 558, 863, 749, 788),
    *(604, 788, 695, 635, 611, 732, 685, 989, 686, 611, 686, 391, 337, 391, 838, 500),
    *(500, 613, 635, 550, 635, 616, 353, 635, 634, 278, 278, 580, 278, 975, 634, 612),
    *(635, 635, 412, 521, 393, 634, 592, 818, 592, 592, 525, 637, 337, 637, 838),
)
_OTHERS = {
    "\u00a0": 318,
    "°": 500,
    "±": 838,
    "²": 401,
    "³": 401,
    "µ": 637,
    "·": 318,
    "⁻": 528,
    "¹": 401,
    "–": 500,
    "α": 660,
    "φ": 660,
    "ω": 838,
    "λ": 592,
    "μ": 637,
    "Ω": 765,
}
WIDTHS = {chr(_FIRST + i): width for i, width in enumerate(_ASCII)} | _OTHERS
"""Widths of characters in thousandths of the font's size."""


def text_width(text: str, size: float) -> float:
    """Width of a text in a font of that size, in the same unit."""
    return sum(WIDTHS.get(character, 1000) for character in text) * size / 1000.0


def wrap(text: str, size: float, width: float) -> list[str]:
    """Lines that are no wider than `width`. Words are kept whole if they fit, then their parts up to a mark or dot.

    A space that does not break (U+00A0) is part of a word.
    """
    lines = [""]
    for word in re.split(r"[^\S\u00a0]+", text):
        if lines[-1] and text_width(f"{lines[-1]} {word}", size) <= width:
            lines[-1] += f" {word}"
        elif text_width(word, size) <= width:
            lines.append(word)
        else:
            lines += _broken(word, size, width)
    return [line for line in lines if line]


def _broken(word: str, size: float, width: float) -> list[str]:
    """Lines of a word that is too long for one."""
    lines = [""]
    for part in re.findall(r"[^._/-]+[._/-]*|[._/-]+", word):
        if text_width(lines[-1] + part, size) > width:
            lines.append("")
        for character in part:
            if text_width(lines[-1] + character, size) > width:
                lines.append("")
            lines[-1] += character
    return lines
