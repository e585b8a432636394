"""State of a run, read from outside; the run may be going on meanwhile."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from brightgrey.runs.store import FILE, LOCK, RunError, checked_facts, connect, damaged

__all__ = ["RunStatus", "read_status"]


@dataclass(frozen=True)
class RunStatus:
    """State of a run, as :func:`read_status` found it.

    Attributes
    ----------
    folder : Path
    request : mapping
    state : {'finished', 'running', 'unfinished'}
    evaluations : int
    seconds : float
        Time in s that the evaluations took together.
    generations : int
        Complete generations of a genetic search.
    stage : mapping
        Progress of the search: `name`, `done`, `total`, `best`; empty before it has begun. Of a search for the border
        also `fit_percent` and `values` (SI) of the best structure, and once there is a border its `decided` and `left`
        parts, the `minimal` structures so far, the `refuted` ones and its budget `most`, see
        :class:`~brightgrey.search.progress.BorderProgress`.
    """

    folder: Path
    request: Mapping[str, Any]
    state: str
    evaluations: int
    seconds: float
    generations: int
    stage: Mapping[str, Any]


def read_status(folder: str | Path) -> RunStatus:
    """Read the state of the run in `folder` without disturbing it.

    Raises
    ------
    RunError
        If there is none, or it is damaged.
    """
    path = Path(folder)
    if not (path / FILE).exists():
        raise RunError(f"there is no run in '{folder}'")
    try:
        running = _is_locked(path)
        try:
            facts, count, seconds, generations = _content(path, "ro")
        except sqlite3.OperationalError:
            if running:
                raise
            # A process that was killed has left the file for the next one to recover, and to read is not enough.
            facts, count, seconds, generations = _content(path, "rw")
    except sqlite3.OperationalError as error:
        raise RunError(f"cannot read '{path / FILE}': {error}") from error
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise damaged(path, str(error)) from error
    state = "running" if running and facts["state"] != "finished" else facts["state"]
    return RunStatus(path, facts["request"], state, count, seconds, generations, facts.get("stage", {}))


def _content(folder: Path, mode: Literal["ro", "rw"]) -> tuple[dict[str, Any], int, float, int]:
    """Facts of a run, its evaluations and their seconds, and its generations."""
    database = connect(folder, mode)
    try:
        facts = checked_facts(folder, database)
        count, seconds = database.execute("SELECT count(*), total(seconds) FROM evaluations").fetchone()
        (generations,) = database.execute("SELECT count(*) FROM generations").fetchone()
    finally:
        database.close()
    return facts, count, seconds, generations


def _is_locked(folder: Path) -> bool:
    if not (folder / LOCK).exists():
        return False
    lock = sqlite3.connect(f"{(folder / LOCK).absolute().as_uri()}?mode=ro", uri=True, timeout=0)
    try:
        lock.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError as error:
        return "locked" in str(error)
    finally:
        lock.close()
    return False
