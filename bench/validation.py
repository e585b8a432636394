"""Pages docs/validation/*.md: the text of bench/pages/*.md with the tables of bench/results/*.json.

A line ``% table FILE: TITLE`` of a template becomes the table of bench/results/FILE.json with that title, followed by
the command, the date and the commit that it was made by::

    python bench/validation.py            # write all pages
    python bench/validation.py --check    # end with 1 if a page differs from what its data give
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import textwrap
from functools import cache
from pathlib import Path
from typing import Any

BENCH = Path(__file__).parent
TEMPLATES = BENCH / "pages"
PAGES = BENCH.parent / "docs" / "validation"
REQUEST = re.compile(r"^% table ([\w-]+): (.+)$", re.MULTILINE)


@cache
def data(name: str) -> Any:
    """Return the content of bench/results/<name>.json."""
    return json.loads((BENCH / "results" / f"{name}.json").read_text(encoding="utf-8"))


def table(name: str, title: str) -> str:
    """Return one table in Markdown, its title above and its source below."""
    found = [part for part in data(name)["tables"] if part["title"] == title]
    if len(found) != 1:
        raise SystemExit(f"bench/results/{name}.json holds {len(found)} tables with the title '{title}'")
    (part,) = found
    source = f"`{part['command']}`, {part['date']}, commit {part['commit']}."
    return "\n".join([*_wrapped(f"**{title}**"), "", *_rows(part["columns"], part["rows"]), "", *_wrapped(source)])


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 120, break_on_hyphens=False, break_long_words=False)


def _rows(columns: list[str], rows: list[list[str]]) -> list[str]:
    return [f"| {' | '.join(columns)} |", "|" + "---|" * len(columns), *(f"| {' | '.join(row)} |" for row in rows)]


def page(template: Path) -> str:
    """Return the page that a template and the data give."""
    text = template.read_text(encoding="utf-8")
    return REQUEST.sub(lambda request: table(request[1], request[2]), text)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; end with 1 if a page is not up to date")
    check = parser.parse_args(arguments).check
    stale = []
    for template in sorted(TEMPLATES.glob("*.md")):
        made, target = page(template), PAGES / template.name
        if not target.is_file() or target.read_text(encoding="utf-8") != made:
            stale.append(target.name)
            if not check:
                target.write_text(made, encoding="utf-8")
    print(f"{'not up to date' if check else 'written'}: {', '.join(stale) or 'none'}")
    return int(check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
