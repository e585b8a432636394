"""The picture of the README: what the demo finds, in one SVG.

python bench/pictures.py        docs/pictures/demo.svg
"""

from __future__ import annotations

from pathlib import Path

from brightgrey import demo
from support.pictures import kept, picture

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"


def main() -> None:
    """Identify the demo and draw it."""
    PICTURES.mkdir(exist_ok=True)
    path = PICTURES / "demo.svg"
    path.write_text(picture(kept(demo(workers=2))), encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
