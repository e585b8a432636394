"""Rows of long benchmarks: one JSON object per line, compressed; several processes may add to one file."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from pathlib import Path

__all__ = ["append_row", "read_rows"]


def append_row(path: Path, row: Mapping[str, object]) -> None:
    """Add a row as a gzip member of its own, in one write."""
    with path.open("ab") as file:
        file.write(gzip.compress((json.dumps(row) + "\n").encode()))


def read_rows(path: Path) -> list[dict]:
    """Rows collected so far; none if there is no file."""
    if not path.exists():
        return []
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return [json.loads(text) for text in file]
