"""Tables of the benchmarks: printed in Markdown, and with ``--save`` written to bench/results/<page>.json.

`make validation` makes the pages docs/validation/<page>.md of these files. A file holds::

    {"command": str, "date": "YYYY-MM-DD", "commit": str,
     "tables": [{"title": str, "columns": [str, ...], "rows": [[str, ...], ...],
                 "command": str, "date": "YYYY-MM-DD", "commit": str}, ...]}

A page may collect the tables of several commands: every table names its own command, date and commit, and takes the
place of the table with the same title. Those of the file are of the table that was written last.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import NamedTuple

from brightgrey import __version__

__all__ = ["RESULTS", "Table", "arguments", "code_version", "print_table", "publish", "save"]

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "bench" / "results"
"""Folder of everything that a benchmark collects."""


class Table(NamedTuple):
    """One table of a page; cells are text as it is shown."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


def arguments(doc: str | None) -> argparse.ArgumentParser:
    """Return the parser of a benchmark's command line, which knows ``--save`` already."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--save", action="store_true", help="write the tables to bench/results/ for docs/validation/")
    return parser


@cache
def code_version() -> str:
    """Return the commit of the package, marked ``-dirty`` if its source differs; its version without a repository."""

    def git(*command: str) -> str:
        done = subprocess.run(["git", *command], cwd=ROOT, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    try:
        return git("rev-parse", "--short", "HEAD") + ("-dirty" if git("status", "--porcelain", "--", "src") else "")
    except (OSError, subprocess.CalledProcessError):
        return __version__


def given_command() -> str:
    """Return the command line of this process, without ``--save``."""
    script, *rest = sys.argv
    path = Path(script).resolve()
    shown = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
    return shlex.join(["python", shown, *(text for text in rest if text != "--save")])


def print_table(table: Table) -> None:
    """Print a table in Markdown."""
    print(f"\n{table.title}\n")
    print(f"| {' | '.join(table.columns)} |")
    print("|" + "---|" * len(table.columns))
    for row in table.rows:
        print(f"| {' | '.join(row)} |")
    print(flush=True)


def save(page: str, command: str, tables: Iterable[Table]) -> Path:
    """Write tables to the data file of a page; a table takes the place of that with the same title.

    Parameters
    ----------
    page : str
        Name of the page, such as ``accuracy``.
    command : str
        Command line that made the tables.
    tables : iterable of Table

    Returns
    -------
    Path
        The file, bench/results/<page>.json.
    """
    file = RESULTS / f"{page}.json"
    made = {"command": command, "date": datetime.now(UTC).date().isoformat(), "commit": code_version()}
    known = json.loads(file.read_text(encoding="utf-8"))["tables"] if file.exists() else []
    by_title = {table["title"]: table for table in known}
    by_title |= {
        t.title: {"title": t.title, "columns": [*t.columns], "rows": [[*r] for r in t.rows]} | made for t in tables
    }
    file.write_text(json.dumps(made | {"tables": [*by_title.values()]}, indent=1, ensure_ascii=False) + "\n", "utf-8")
    return file


def publish(page: str, tables: Iterable[Table], *, to_file: bool) -> None:
    """Print tables, and write them to the data file of the page if `to_file` is set."""
    tables = list(tables)
    for table in tables:
        print_table(table)
    if to_file:
        print(f"written to {save(page, given_command(), tables).relative_to(ROOT)}")
