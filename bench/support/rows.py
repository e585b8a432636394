"""Rows of long benchmarks: one JSON object per line, compressed; several processes may add to one file."""

from __future__ import annotations

import argparse
import gzip
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from brightgrey.simulation.reference import UnsettledError
from support.results import arguments

__all__ = ["add_rows", "drives_left", "read_rows", "row_arguments"]


def row_arguments(doc: str | None, *, last: int, seed: int) -> argparse.ArgumentParser:
    """Parser of a benchmark that makes rows drive by drive: ``run FIRST LAST --seed SEED`` or ``table``."""
    parser = arguments(doc)
    parser.add_argument("what", choices=("run", "table"))
    parser.add_argument("first", type=int, nargs="?", default=0, help="number of the first drive")
    parser.add_argument("last", type=int, nargs="?", default=last, help="and of the one after the last")
    parser.add_argument("--seed", type=int, default=seed)
    return parser


def add_rows(
    path: Path,
    numbers: Iterable[int],
    make: Callable[[int], Iterable[Mapping[str, object]]],
    line: Callable[[Mapping], str],
) -> None:
    """Make the rows of each drive, add them to the file and print them; what the reference cannot settle is left out.

    Parameters
    ----------
    path : Path
    numbers : iterable of int
        Of drives.
    make : callable
        ``make(number)`` gives the rows of one drive.
    line : callable
        ``line(row)`` is the row in words.
    """
    for number in numbers:
        try:
            for row in make(number):
                _append(path, row)
                print(line(row), flush=True)
        except UnsettledError as why:
            print(f"{number:4d} left out: {why}", flush=True)


def drives_left(path: Path, seed: int, first: int, last: int) -> list[int]:
    """Numbers from `first` to before `last` of drives that the file does not hold."""
    done = {row["number"] for row in read_rows(path) if row["seed"] == seed}
    return [number for number in range(first, last) if number not in done]


def _append(path: Path, row: Mapping[str, object]) -> None:
    """Add a row as a gzip member of its own, in one write."""
    with path.open("ab") as file:
        file.write(gzip.compress((json.dumps(row) + "\n").encode()))


def read_rows(path: Path) -> list[dict]:
    """Rows collected so far; none if there is no file."""
    if not path.exists():
        return []
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return [json.loads(text) for text in file]
