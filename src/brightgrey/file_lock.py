"""Lock of a file against other processes: SQLite's own, which ends with its process, however that dies."""

from __future__ import annotations

import sqlite3
from pathlib import Path

__all__ = ["hold_lock"]


def hold_lock(file: Path, *, timeout: float) -> sqlite3.Connection | None:
    """Lock an empty file, which is made; the lock holds until the connection is closed or the process ends.

    Parameters
    ----------
    file : Path
    timeout : float
        Time in s to wait for another process.

    Returns
    -------
    sqlite3.Connection or None
        None if another process holds the lock.

    Raises
    ------
    sqlite3.Error
        If the file cannot be written.
    """
    lock = sqlite3.connect(file, timeout=timeout, isolation_level=None, check_same_thread=False)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError as error:
        lock.close()
        if "locked" in str(error):
            return None
        raise
    return lock
