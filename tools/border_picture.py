"""Draw the border of docs/explanation/structures.md from the certificate of a model.json.

python tools/border_picture.py demo/model.json    # writes docs/border.svg; `make demo` makes that model

Each structure of the grammar is one dot, in the row of its number of atoms. The certificate has to decide all of them.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

from brightgrey.kit import PAPER
from brightgrey.search.lattice import Lattice

ROOT = Path(__file__).parents[1]
WIDTH, MARGIN, PITCH, MARK, ROW, TOP, LINE = 440, 16, 6.6, 24.0, 33, 62, 25
LACKING = {
    "coulomb": "Coulomb friction",
    "stribeck": "Stribeck friction",
    "viscous": "viscous friction",
    "two_mass": "a second mass",
}
WORDS = {"two_mass": "two masses", "coulomb": "Coulomb", "viscous": "viscous", "stribeck": "Stribeck"}
STYLE = """
  text { font: 15px system-ui, sans-serif; fill: #1b2733 }
  .name { font-weight: 600 }
  .note { font-size: 13.5px; fill: #44525f }
  .card { fill: #fdfdfb; stroke: #c9d1d8 }
  .refuted { fill: #c8553d }
  .adequate { fill: #2f7fb5 }
  .mark { font-size: 13px; font-weight: 700; fill: #fdfdfb; text-anchor: middle }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6ebf0 } .note { fill: #b3bfca } .card { fill: #1a2129; stroke: #3a4652 }
    .refuted { fill: #e5806a } .adequate { fill: #6cb6e8 } .mark { fill: #10161c }
  }
"""


@dataclass(frozen=True)
class Row:
    """Structures with the same number of atoms: those of the border by their marks, and the number of all others."""

    refuted: tuple[str, ...]
    others_refuted: int
    others_adequate: int
    minimal: tuple[str, ...]


def rows(certificate: dict) -> list[Row]:
    """Return the rows of all structures, the richest first; the refuted ones of the border are numbered from 1."""
    grammar = PAPER  # the stage of the function set that decides the demo
    lattice = Lattice.of(grammar)
    minimal = [lattice.mask(grammar.parse(name)) for name in certificate["minimal"]]
    refuted = [lattice.mask(grammar.parse(r["structure"])) for r in certificate["refuted"]]
    levels = defaultdict(list)
    for mask in lattice.masks():
        adequate = any(not small & ~mask for small in minimal)
        if adequate == any(not mask & ~big for big in refuted):
            raise SystemExit(f"the certificate does not decide {lattice.structure(mask)}")
        levels[mask.bit_count()].append((mask, adequate))
    return [
        Row(
            tuple(str(i) for i, m in enumerate(refuted, 1) if m.bit_count() == number),
            sum(not adequate and m not in refuted for m, adequate in level),
            sum(adequate and m not in minimal for m, adequate in level),
            tuple("✓" for m in minimal if m.bit_count() == number),
        )
        for number, level in sorted(levels.items(), reverse=True)
    ]


def dots(count: int, x: float, y: float, kind: str) -> list[str]:
    """Return dots in two lines, from the left."""
    places = ((x + (i // 2 + 0.5) * PITCH, y + PITCH * (i % 2 - 0.5) * (count > 1)) for i in range(count))
    return [f'<circle class="{kind}" cx="{px:.1f}" cy="{py:.1f}" r="2.4"/>' for px, py in places]


def mark(text: str, x: float, y: float, kind: str) -> list[str]:
    """Return a large dot with a sign in it."""
    return [
        f'<circle class="{kind}" cx="{x:.1f}" cy="{y}" r="10"/>',
        f'<text class="mark" x="{x:.1f}" y="{y + 4.7}">{escape(text)}</text>',
    ]


def row(found: Row, y: float) -> list[str]:
    """Return one row: refuted structures on the left, adequate ones on the right."""
    columns = [(n + 1) // 2 * PITCH for n in (found.others_refuted, found.others_adequate)]
    x = (WIDTH - sum(columns) - MARK * len(found.refuted + found.minimal)) / 2
    parts = []
    for text in found.refuted:
        parts += mark(text, x + MARK / 2, y, "refuted")
        x += MARK
    parts += dots(found.others_refuted, x, y, "refuted")
    x += columns[0]
    for text in found.minimal:
        parts += mark(text, x + MARK / 2, y, "adequate")
        x += MARK
    return [*parts, *dots(found.others_adequate, x, y, "adequate")]


def legend(certificate: dict, y: float) -> list[str]:
    """Return one line of words for each structure of the border."""
    parts = []
    for name in certificate["minimal"]:
        placed = PAPER.parse(name).placed
        parts += mark("✓", MARGIN + 10, y, "adequate")
        parts.append(f'<text class="name" x="{MARGIN + 30}" y="{y + 5}">enough: {escape(WORDS[placed[0].name])}</text>')
        y += LINE - 5
        rest = ", ".join(WORDS[p.name] for p in placed[1:])
        parts.append(f'<text x="{MARGIN + 30}" y="{y + 5}">and {escape(rest)} friction</text>')
        y += LINE
    for i, refuted in enumerate(certificate["refuted"], 1):
        lacking = " and ".join(LACKING[name] for name in refuted["without"])
        parts += mark(str(i), MARGIN + 10, y, "refuted")
        parts.append(f'<text x="{MARGIN + 30}" y="{y + 5}">everything but {escape(lacking)}</text>')
        ratio = f"residual × {refuted['ratio']:.3g}"
        parts.append(f'<text class="name" x="{WIDTH - MARGIN}" y="{y + 5}" text-anchor="end">{ratio}</text>')
        y += LINE
    return parts


def picture(certificate: dict) -> str:
    """Return the picture on a card of its own, which is readable on a light and on a dark page."""
    found = rows(certificate)
    bottom = TOP + ROW * (len(found) - 1)
    height = bottom + 62 + LINE * (len(certificate["refuted"]) + 2 * len(certificate["minimal"]))
    adequate = sum(r.others_adequate + len(r.minimal) for r in found)
    refuted = sum(r.others_refuted + len(r.refuted) for r in found)
    title = f"Border of the demo's structures: {adequate} are adequate, {refuted} are refuted"
    parts = [
        f'<text class="note" x="{WIDTH / 2}" y="{TOP - 24}" text-anchor="middle">all effects, four masses</text>',
        f'<text class="note" x="{WIDTH / 2}" y="{bottom + 24}" text-anchor="middle">one mass, no effect</text>',
        f'<text class="name refuted" x="{MARGIN}" y="{TOP - 4}">{refuted} refuted</text>',
        f'<text class="name adequate" x="{WIDTH - MARGIN}" y="{TOP - 4}" text-anchor="end">{adequate} adequate</text>',
    ]
    for i, r in enumerate(found):
        parts += row(r, TOP + ROW * i)
    parts += legend(certificate, bottom + 52)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{WIDTH}" height="{height}"'
        f' viewBox="0 0 {WIDTH} {height}">\n<title>{escape(title)}</title>\n<style>{STYLE}</style>\n'
        f'<rect class="card" x="1" y="1" width="{WIDTH - 2}" height="{height - 2}" rx="10"/>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def main(path: str) -> None:
    """Write the picture."""
    certificate = json.loads(Path(path).read_text(encoding="utf-8"))["certificate"]
    (ROOT / "docs" / "border.svg").write_text(picture(certificate), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
