"""Draw the pictures of docs/architecture.md: the rooms by the layers of the import contract, and a recording's way.

python tools/architecture_picture.py    # writes docs/rooms.svg and docs/way.svg
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
WIDTH, MARGIN, ROW, GAP = 440, 14, 46, 8
STYLE = """
  text { font: 15px system-ui, sans-serif; fill: #1b2733 }
  .name { font-weight: 600 }
  .note { font-size: 13px; fill: #44525f }
  .card { fill: #fdfdfb; stroke: #c9d1d8 }
  .box { fill: #e8f0f7; stroke: #7b97b0 }
  .data { fill: #fbf3dc; stroke: #c3a95a }
  .arrow { stroke: #44525f; stroke-width: 1.6; fill: none; marker-end: url(#tip) }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6ebf0 } .note { fill: #b3bfca } .card { fill: #1a2129; stroke: #3a4652 }
    .box { fill: #24364a; stroke: #5d7c9b } .data { fill: #3d3520; stroke: #9d8747 } .arrow { stroke: #b3bfca }
    #tip path { fill: #b3bfca }
  }
"""
TIP = (
    '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    '<path d="M0 0L8 4L0 8z" fill="#44525f"/></marker>'
)
ROOMS = {
    "cli": "the command line",
    "app": "the pages of brightgrey app",
    "api": "what a user imports, in the recording's units",
    "paper": "reproduction of the paper's section 4",
    "report": "page, figures, tables",
    "exports": "C, FMU, MATLAB, Modelica ...",
    "planning": "the next motion",
    "self_test": "would it be found again",
    "model": "the result as data",
    "control": "design, filters, faults",
    "runs": "what survives an interruption",
    "search": "which structure",
    "estimation": "parameters and intervals of one structure",
    "simulation": "one compiled kernel, and its plain twin",
    "drawing": "the drive as a picture",
    "kit": "structures, grammars, state space",
    "effects": "one file per physical effect",
    "excitation": "motions, random drives",
    "recordings": "files, units, checks",
}
WAY = (
    ("data", "file", "CSV, MAT or another format"),
    ("box", "recordings", "read once, checked, in SI"),
    ("data", "Recording", "frozen: time, input, motion"),
    ("box", "search.task", "scales, bounds, weights"),
    ("data", "task", "frozen: all that a search needs"),
    ("box", "estimation, search", "fits of structures, on workers"),
    ("data", "table of fits", "best fit of each structure"),
    ("box", "search", "tests of every effect"),
    ("data", "verdict", "one for every effect"),
    ("box", "model", "in the recording's units"),
    ("data", "model.json", "loaded by exports and control"),
    ("box", "report", "reads only"),
    ("data", "report.html", "for people"),
)


def layers() -> list[list[str]]:
    """Return the rooms of each layer of the import contract, from the top; modules without a caption are left out."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (found,) = [contract["layers"] for contract in contracts if contract["containers"] == ["brightgrey"]]
    rows = [[name for name in layer.split(" | ") if name in ROOMS] for layer in found]
    return [row for row in rows if row]


def box(kind: str, x: float, y: float, width: float, name: str, note: str) -> str:
    """Return a rounded rectangle with a name and a note, below each other or in a row."""
    middle = y + ROW / 2
    return (
        f'<rect class="{kind}" x="{x}" y="{y}" width="{width}" height="{ROW}" rx="6"/>'
        f'<text class="name" x="{x + 12}" y="{middle - 4}">{escape(name)}</text>'
        f'<text class="note" x="{x + 12}" y="{middle + 14}">{escape(note)}</text>'
    )


def picture(title: str, height: float, parts: list[str]) -> str:
    """Return a picture on a card of its own, which is readable on a light and on a dark page."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{WIDTH}" height="{height}"'
        f' viewBox="0 0 {WIDTH} {height}">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n<defs>{TIP}</defs>\n"
        f'<rect class="card" x="1" y="1" width="{WIDTH - 2}" height="{height - 2}" rx="10"/>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def rooms() -> str:
    """Return the picture of the rooms: a row imports from the rows below it only."""
    parts, y = [], MARGIN
    inner = WIDTH - 2 * MARGIN
    for row in layers():
        width = (inner - GAP * (len(row) - 1)) / len(row)
        parts += [box("box", MARGIN + i * (width + GAP), y, width, name, ROOMS[name]) for i, name in enumerate(row)]
        y += ROW + GAP
    return picture("Rooms of brightgrey: each row imports from the rows below it only", y - GAP + MARGIN, parts)


def way() -> str:
    """Return the picture of a recording's way: data on the right, rooms on the left."""
    parts, y = [], MARGIN
    width = (WIDTH - 2 * MARGIN) * 0.58
    left, right = MARGIN, WIDTH - MARGIN - width
    for number, (kind, name, note) in enumerate(WAY):
        x = left if kind == "box" else right
        parts.append(box(kind, x, y, width, name, note))
        if number:
            middle = WIDTH / 2
            parts.append(f'<path class="arrow" d="M{middle} {y - 2 * GAP}V{y - 2}"/>')
        y += ROW + 2 * GAP
    return picture("Way of a recording: file, task, table of fits, verdict, model, report", y - 2 * GAP + MARGIN, parts)


def main() -> None:
    """Write both pictures."""
    for name, text in (("rooms", rooms()), ("way", way())):
        (ROOT / "docs" / f"{name}.svg").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
