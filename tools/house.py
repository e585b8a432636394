"""Measure the form of the package against its rules, and end with exit code 1 where one is broken.

    python tools/house.py            the rules that `make check` holds, and what breaks them
    python tools/house.py --names    names defined at the top level of more than one module, too
    python tools/house.py --numbers  numbers that stand at the top level of a module, too

The rules: folders with at most 16 files of code (folders whose files are found by listing apart), modules of at most
400 lines, function bodies of at most 50, no import cycle between modules and none from the package root, public
docstrings that begin with the thing itself, documentation lines of at most 120 characters.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
SRC = ROOT / "src"
LISTED = {"library", "formats", "targets"}
"""Folders whose files are found by listing: each file is one more of a kind."""
FILES, MODULE, BODY, WIDTH, PUBLIC_NAMES, ALL_NAMES, NUMBERS = 16, 400, 50, 120, 20, 60, 60
QUESTION = re.compile(r"(Whether|What|How|Where|Which|Who)\b")
NUMBER = re.compile(r"^_?[A-Z][A-Z0-9_]* *(:[^=]*)?= *[-0-9.]")


def modules() -> dict[str, ast.Module]:
    """Parsed modules of the package, by dotted name."""
    found = {}
    for file in sorted(SRC.rglob("*.py")):
        parts = file.relative_to(SRC).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = ast.parse(file.read_text(encoding="utf-8"))
    return found


def crowded() -> Iterator[str]:
    """Folders with too many files, modules with too many lines, functions with too many."""
    for folder in sorted({f.parent for f in SRC.rglob("*.py")}):
        count = sum(f.name != "__init__.py" for f in folder.glob("*.py"))
        if count > FILES and folder.name not in LISTED:
            yield f"{folder.relative_to(ROOT)}: {count} files, at most {FILES} are allowed"
    for file in sorted(SRC.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if text.count("\n") > MODULE:
            yield f"{file.relative_to(ROOT)}: {text.count(chr(10))} lines, at most {MODULE} are allowed"
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
                lines = (body[-1].end_lineno or 0) - body[0].lineno + 1
                if lines > BODY:
                    where = f"{file.relative_to(ROOT)}:{node.lineno}"
                    yield f"{where}: the body of {node.name} has {lines} lines, at most {BODY} are allowed"


def questions(parsed: dict[str, ast.Module]) -> Iterator[str]:
    """Public docstrings that begin with a question word."""
    for name, tree in parsed.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                first = (ast.get_docstring(node) or "").split("\n")[0]
                if QUESTION.match(first):
                    yield f"{name}.{node.name}: the docstring begins with '{first.split()[0]}': {first}"


def wide() -> Iterator[str]:
    """Lines of documentation that are too long."""
    for file in sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]):
        if "build" in file.relative_to(ROOT).parts:
            continue
        for i, line in enumerate(file.read_text(encoding="utf-8").split("\n"), 1):
            if len(line) > WIDTH and not line.lstrip().startswith(("|", ":")):
                yield f"{file.relative_to(ROOT)}:{i}: {len(line)} characters, at most {WIDTH} are allowed"


def imports(parsed: dict[str, ast.Module]) -> dict[str, set[str]]:
    """Modules that each module imports when it is imported itself: not within functions, nor for type checkers."""
    edges: dict[str, set[str]] = {}
    for name, tree in parsed.items():
        edges[name] = set()
        for node in tree.body:
            if isinstance(node, ast.Import):
                edges[name] |= {a.name for a in node.names if a.name in parsed}
            elif isinstance(node, ast.ImportFrom) and node.module in parsed:
                below = {f"{node.module}.{a.name}" for a in node.names} & parsed.keys()
                edges[name] |= below or {node.module}
    return edges


def from_the_root(edges: dict[str, set[str]]) -> Iterator[str]:
    """Modules that import the package root, whose names are for users and stand above all rooms."""
    for name, targets in edges.items():
        if "brightgrey" in targets:
            yield f"{name} imports from the package root; import from the room instead"


def cycles(edges: dict[str, set[str]]) -> Iterator[str]:
    """Cycles of imports between modules, one line for each strongly connected set (Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(at: str) -> None:
        index[at] = low[at] = len(index)
        stack.append(at)
        for to in edges[at]:
            if to not in index:
                visit(to)
                low[at] = min(low[at], low[to])
            elif to in stack:
                low[at] = min(low[at], index[to])
        if low[at] == index[at]:
            part = []
            while True:
                part.append(stack.pop())
                if part[-1] == at:
                    break
            if len(part) > 1:
                found.append(sorted(part))

    for name in edges:
        if name not in index:
            visit(name)
    for part in found:
        yield f"import cycle: {' - '.join(part)}"


def shared_names(parsed: dict[str, ast.Module]) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Names at the top level of more than one module: public types and functions; and all others."""
    where: dict[tuple[str, bool], list[str]] = defaultdict(list)
    for module, tree in parsed.items():
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                where[node.name, not node.name.startswith("_")].append(module)
            targets = node.targets if isinstance(node, ast.Assign) else []
            targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
            for target in targets:
                if isinstance(target, ast.Name) and target.id != "__all__":
                    where[target.id, False].append(module)
    several = {key: found for key, found in where.items() if len(found) > 1}
    public = {name: found for (name, is_public), found in several.items() if is_public}
    other = {name: found for (name, is_public), found in several.items() if not is_public}
    return public, other


def numbers() -> list[str]:
    """Numbers that stand at the top level of modules."""
    return [
        f"{file.relative_to(ROOT)}:{i}: {line}"
        for file in sorted(SRC.rglob("*.py"))
        for i, line in enumerate(file.read_text(encoding="utf-8").split("\n"), 1)
        if NUMBER.match(line)
    ]


def main() -> int:
    """Print what breaks a rule; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--names", action="store_true")
    parser.add_argument("--numbers", action="store_true")
    given = parser.parse_args()
    parsed = modules()
    broken = [*crowded(), *questions(parsed), *wide(), *from_the_root(imports(parsed)), *cycles(imports(parsed))]
    public, other = shared_names(parsed)
    counted = numbers()
    for what, count, most in (
        ("public types and functions defined in more than one module", len(public), PUBLIC_NAMES),
        ("names of any kind defined in more than one module", len(public) + len(other), ALL_NAMES),
        ("numbers at the top level of modules", len(counted), NUMBERS),
    ):
        print(f"{count} {what}, at most {most} are allowed")
        if count > most:
            broken.append(f"too many {what}")
    if given.names:
        for name, found in sorted((public | other).items()):
            print(f"  {name}: {', '.join(m.removeprefix('brightgrey.') for m in found)}")
    if given.numbers:
        print(*(f"  {line}" for line in counted), sep="\n")
    print(*broken, sep="\n")
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
