"""Readability of the prose: Flesch reading ease and length of sentences, of the pages and of all docstrings.

    python tools/readability.py [FOLDER...]    # folders of repositories; this one if none is given

It needs ``textstat``, which is not among the dependencies: ``pip install textstat==0.7.3`` (later versions load a
dictionary from the network).
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

LONGEST = 30
"""Words of a sentence beyond which it counts as long."""
SECTION = re.compile(r"^[A-Z]\w+\n-{3,}$", re.MULTILINE)


def markdown_prose(text: str) -> str:
    """Return the sentences of a page, without front matter, code, tables, headings and link targets."""
    text = re.sub(r"\A---\n.*?\n---\n", "", text, flags=re.DOTALL)
    text = re.sub(r"^```.*?^```", "\n", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^(#|\||%|    \S).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^\s*([-*]|\d+\.)\s+", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", lambda link: link[1] or "Page", text)
    return plain(text)


def docstring_prose(text: str) -> str:
    """Return the sentences of a docstring before its first section."""
    return plain(SECTION.split(text)[0])


def plain(text: str) -> str:
    """Return the text with each piece of code replaced by one short word, and marks of emphasis left out."""
    text = re.sub(r":\w+:`[^`]*`|``[^`]*``|`[^`]*`", "Code", text)
    return re.sub(r"[*_]+", "", text)


def docstrings(folder: Path) -> Iterator[str]:
    """Yield every docstring of the package."""
    for file in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node)
                if text:
                    yield docstring_prose(text)


def sentences(text: str) -> list[str]:
    """Return the sentences of paragraphs; a full stop, a question mark or the end of a paragraph ends one."""
    found = []
    for paragraph in re.split(r"\n\s*\n", text):
        found += re.split(r"(?<=[.?!:])\s+(?=[A-Z(])", " ".join(paragraph.split()))
    return [sentence for sentence in found if len(sentence.split()) > 1]


def report(name: str, parts: list[str]) -> str:
    """Return one line of figures."""
    import textstat

    found = [sentence for part in parts for sentence in sentences(part)]
    words = [len(sentence.split()) for sentence in found]
    ease = textstat.flesch_reading_ease(" ".join(s if s[-1] in ".?!" else f"{s.rstrip(':')}." for s in found))
    return (
        f"{name:12} {len(found):6} sentences, {sum(words) / len(words):5.1f} words each,"
        f" {sum(w > LONGEST for w in words):4} longer than {LONGEST}; Flesch reading ease {ease:5.1f}"
    )


def main(folders: list[str]) -> None:
    """Print the figures of each repository."""
    for root in map(Path, folders or [Path(__file__).parents[1]]):
        pages = [*root.glob("*.md"), *(p for p in (root / "docs").rglob("*.md") if "build" not in p.parts)]
        print(root)
        print(report("pages", [markdown_prose(page.read_text(encoding="utf-8")) for page in sorted(pages)]))
        print(report("docstrings", list(docstrings(root / "src"))))


if __name__ == "__main__":
    main(sys.argv[1:])
