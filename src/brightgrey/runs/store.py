"""Store of a run: one SQLite file per output folder with the request, every evaluation and the results.

Each row carries the hash of its content. The file is checked as a whole when it is opened, so a damaged file is named
and never read as a result. A second file, always empty, carries the lock, which ends with its process.
"""

from __future__ import annotations

import json
import os
import re
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from brightgrey.errors import BrightgreyError
from brightgrey.file_lock import hold_lock
from brightgrey.runs.serialisation import canonical, digest

__all__ = ["FILE", "LOCK", "RunError", "Store", "checked_facts", "connect", "damaged", "exclusive_folder"]

FILE, LOCK = "run.sqlite", "run.lock"
FORMAT = "brightgrey/run/1"
RunState = Literal["unfinished", "finished"]
_RECORDING = re.compile(r"recording \d+|test recording")
_LOCK_TIMEOUT = 0.5  # s; `brightgrey runs` holds the lock for an instant
_COLUMNS = {
    "facts": "name TEXT PRIMARY KEY, text TEXT NOT NULL",
    "evaluations": "key TEXT PRIMARY KEY, number INTEGER NOT NULL, function TEXT NOT NULL, subject TEXT NOT NULL,"
    " seconds REAL NOT NULL, result TEXT NOT NULL",
    "generations": "number INTEGER PRIMARY KEY, state TEXT NOT NULL",
    "files": "name TEXT PRIMARY KEY, content BLOB NOT NULL",
}


class RunError(BrightgreyError):
    """A run cannot be started, continued or stored; the message names the folder and what to do."""


@contextmanager
def _sqlite_errors_named(folder: Path) -> Iterator[None]:
    """Turn errors of SQLite and the system into a sentence that names the folder."""
    try:
        yield
    except sqlite3.Error as error:
        text = str(error)
        if "full" in text or "disk I/O" in text:
            hint = "make room; the same command then goes on where it stopped"
            raise RunError(f"cannot keep the run in '{folder}': {text}; {hint}") from error
        if "locked" in text:
            hint = "another program holds it; the same command goes on when that has ended"
            raise RunError(f"cannot keep the run in '{folder}': {text}; {hint}") from error
        if "readonly" in text or "unable to open" in text:
            raise RunError(f"cannot keep the run in '{folder}': {text}; it has to be writable") from error
        raise damaged(folder, text) from error
    except UnicodeDecodeError as error:  # SQLite's message quotes the damaged text
        raise damaged(folder, "its schema is no text") from error
    except OSError as error:
        text = f"{error.strerror or error}; name another folder"
        raise RunError(f"cannot keep the run in '{folder}': {text}") from error


def damaged(folder: Path, what: str) -> RunError:
    """Error that names the damage of a run's file."""
    return RunError(f"'{folder / FILE}' is damaged: {what}; nothing of it was used. --restart begins the run anew")


def _row_hash(table: str, row: Sequence[Any]) -> str:
    return digest(table, *(cell if isinstance(cell, bytes) else repr(cell) for cell in row))


class Store:
    """Open run, locked by this process. :meth:`open` makes it; several threads may use it."""

    def __init__(self, folder: Path, lock: sqlite3.Connection, database: sqlite3.Connection, made: bool) -> None:
        self.folder = folder
        self._created_folder = made
        self._lock, self._database = lock, database
        self._mutex = threading.RLock()
        self._stage: str | None = None

    @classmethod
    def open(
        cls,
        folder: str | Path,
        request: Mapping[str, Any],
        *,
        restart: bool = False,
        may_replace: Callable[[Mapping[str, Any]], bool] = lambda request: False,
    ) -> Store:
        """Start the run of `request` in `folder`, or resume it.

        Parameters
        ----------
        folder : str or Path
            Made if it is not there.
        request : mapping
            Plain data: everything that the result depends on.
        restart : bool
            Remove the run that is there.
        may_replace : callable
            ``may_replace(request)``: True if a finished run of that request may be replaced without `restart`, because
            it took no time.

        Raises
        ------
        RunError
            If another process holds the run, another request was made there, the file is damaged or the folder
            cannot be written to.
        """
        path = Path(folder)
        made = not path.exists()
        with _sqlite_errors_named(path):
            path.mkdir(parents=True, exist_ok=True)
            lock = _acquire_lock(path)
        try:
            with _sqlite_errors_named(path):
                if restart:
                    _remove_files(path)
                return cls(path, lock, _open_database(path, request, may_replace), made)
        except BaseException:
            begun = (path / FILE).exists()
            if not begun:  # as on a full disk: leave nothing
                (path / LOCK).unlink(missing_ok=True)
            lock.close()  # which removes its journal
            if made and not begun:
                with suppress(OSError):
                    path.rmdir()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Write the latest stage and release the run."""
        with self._mutex:
            with suppress(sqlite3.Error):  # the stage is only shown
                self._write([])
            with suppress(sqlite3.Error):  # without a log beside it, the file can be read from a read-only folder
                self._database.execute("PRAGMA journal_mode = DELETE")
            self._database.close()
            self._lock.close()

    def discard(self) -> None:
        """Close the run and remove its files."""
        with self._mutex:
            self._stage = None
            self.close()
            _remove_files(self.folder)
            (self.folder / LOCK).unlink(missing_ok=True)
            with suppress(OSError):  # the folder holds other files
                if self._created_folder:
                    self.folder.rmdir()

    def fact(self, name: str) -> str | None:
        """Stored text by `name`, None if there is none."""
        with self._mutex:
            row = self._database.execute("SELECT text FROM facts WHERE name = ?", (name,)).fetchone()
        return None if row is None else str(row[0])

    @property
    def finished(self) -> bool:
        """True if the run has come to its end."""
        return self.fact("state") == '"finished"'

    def result(self, key: str) -> str | None:
        """Text of an evaluation's result, None if it has not been made."""
        with self._mutex:
            row = self._database.execute("SELECT result FROM evaluations WHERE key = ?", (key,)).fetchone()
        return None if row is None else str(row[0])

    def save_evaluation(self, key: str, number: int, function: str, subject: str, seconds: float, result: str) -> None:
        """Store an evaluation; it is on the disk when this returns.

        Raises
        ------
        RunError
            If it cannot be written.
        """
        self._save([("evaluations", (key, number, function, subject, float(seconds), result))])

    def save_generation(self, number: int, state: Mapping[str, Any]) -> None:
        """Store the state of a generation, or compare it with the state that an earlier part of the run has stored.

        Raises
        ------
        RunError
            If they differ. Then the run is not reproducible, and must not go on.
        """
        text = canonical(state)
        with self._mutex:
            row = self._database.execute("SELECT state FROM generations WHERE number = ?", (number,)).fetchone()
        if row is None:
            self._save([("generations", (number, text))])
        elif row[0] != text:
            raise RunError(f"'{self.folder / FILE}': generation {number} is not what it was when the run was begun")

    def note_stage(self, stage: Mapping[str, Any]) -> None:
        """Note the progress of the search; it is written with the next evaluation."""
        self._stage = canonical(stage)

    def files(self) -> dict[str, bytes]:
        """Results of a finished run by file name."""
        with self._mutex:
            rows = self._database.execute("SELECT name, content FROM files ORDER BY rowid").fetchall()
        return {str(name): bytes(content) for name, content in rows}

    def finish(self, files: Mapping[str, bytes]) -> None:
        """Store the results and mark the run as finished, at once; all is on the disk when this returns."""
        rows = [*(("files", (name, content)) for name, content in files.items()), ("facts", ("state", '"finished"'))]
        with self._mutex, _sqlite_errors_named(self.folder):
            if self._database.execute("SELECT 1 FROM evaluations UNION SELECT 1 FROM generations").fetchone():
                self._write(rows)
                return
            request = ("facts", ("request", self.fact("request")))
            self._database.close()
            _create(self.folder, [request, *rows])  # a new file is written out once, and not step by step
            self._database = connect(self.folder, "rw")

    def _save(self, rows: Sequence[tuple[str, Sequence[Any]]]) -> None:
        with self._mutex, _sqlite_errors_named(self.folder):
            self._write(rows)

    def _write(self, rows: Sequence[tuple[str, Sequence[Any]]]) -> None:
        waiting = [] if self._stage is None else [("facts", ("stage", self._stage))]
        self._stage = None
        with self._database:  # one transaction
            for table, row in [*waiting, *rows]:
                _insert(self._database, table, row)


def _insert(database: sqlite3.Connection, table: str, row: Sequence[Any]) -> None:
    marks = ", ".join("?" * (len(row) + 1))
    database.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", (*row, _row_hash(table, row)))


@contextmanager
def exclusive_folder(folder: Path) -> Iterator[None]:
    """Lock a folder that holds several runs against other processes.

    Raises
    ------
    RunError
        If another process works there, or the folder cannot be written to.
    """
    with _sqlite_errors_named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        lock = _acquire_lock(folder)
    try:
        yield
    finally:
        lock.close()


def _acquire_lock(folder: Path) -> sqlite3.Connection:
    """Lock of the folder, held until the connection is closed or the process ends."""
    lock = hold_lock(folder / LOCK, timeout=_LOCK_TIMEOUT)
    if lock is None:
        raise RunError(f"another process is at work in '{folder}'; wait for its end, or use another folder")
    return lock


def _create(folder: Path, rows: Sequence[tuple[str, Sequence[Any]]], *, log: bool = False) -> None:
    """Make the file under another name and move it: it is there as a whole or not at all.

    With `log`, what is saved later goes through a write-ahead log: one wait for the disk each, not four.
    """
    aside = folder / f"{FILE}.new"
    _remove_files(folder, aside.name)
    database = sqlite3.connect(aside)
    try:
        database.execute("PRAGMA synchronous = OFF")  # the whole file is written out below
        with database:
            database.execute("BEGIN")
            for table, columns in _COLUMNS.items():
                database.execute(f"CREATE TABLE {table} ({columns}, hash TEXT NOT NULL)")
            for table, row in [("facts", ("format", canonical(FORMAT))), *rows]:
                _insert(database, table, row)
        if log:
            database.execute("PRAGMA journal_mode = WAL")
        database.close()
        _write_out(aside)
        _remove_files(folder, keep=True)
        aside.replace(folder / FILE)
        _write_out(folder)
    finally:
        database.close()
        aside.unlink(missing_ok=True)


def _write_out(path: Path) -> None:
    """Wait until a file is on the disk, or the names in a folder."""
    if path.is_dir() and os.name == "nt":  # which opens no folder, and needs no such wait
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _remove_files(folder: Path, name: str = FILE, *, keep: bool = False) -> None:
    """Remove a file and, before it, what SQLite would play into a new one of its name; or only the latter."""
    for end in ("-wal", "-shm", "-journal", *([] if keep else [""])):
        (folder / f"{name}{end}").unlink(missing_ok=True)


def _open_database(
    folder: Path, request: Mapping[str, Any], may_replace: Callable[[Mapping[str, Any]], bool]
) -> sqlite3.Connection:
    """Open the checked file of the run of `request`; make it if there is none."""
    if not (folder / FILE).exists():
        state = ("facts", ("state", canonical("unfinished")))
        _create(folder, [("facts", ("request", canonical(request))), state], log=True)
    database = connect(folder, "rw")
    try:
        facts = checked_facts(folder, database)
        differences = _request_differences(facts["request"], request)
        if not differences:
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = FULL")
            return database
    except BaseException:
        database.close()
        raise
    database.close()
    if facts["state"] == "finished" and may_replace(facts["request"]):
        _remove_files(folder)
        return _open_database(folder, request, may_replace)
    raise RunError(
        f"'{folder}' holds a run of another request: {'; '.join(differences)}. Use another folder, or --restart to"
        " begin anew there"
    )


def connect(folder: Path, mode: Literal["ro", "rw"]) -> sqlite3.Connection:
    """Connection to the file of a run; RunError if it is empty."""
    if (folder / FILE).stat().st_size == 0:
        raise damaged(folder, "it is empty")
    where = f"{(folder / FILE).absolute().as_uri()}?mode={mode}"
    database = sqlite3.connect(where, uri=True, timeout=_LOCK_TIMEOUT, check_same_thread=False)
    database.text_factory = lambda text: text.decode(errors="replace")  # the hashes find damage, not the decoder
    return database


def checked_facts(folder: Path, database: sqlite3.Connection) -> dict[str, Any]:
    """Facts of a file after SQLite's own check and that of every row's hash; RunError if it is damaged."""
    problems = [str(row[0]) for row in database.execute("PRAGMA integrity_check")]
    if problems != ["ok"]:
        raise damaged(folder, problems[0].replace("\n", " "))
    for table in _COLUMNS:
        for *row, stored in database.execute(f"SELECT * FROM {table}"):
            if _row_hash(table, row) != stored:
                raise damaged(folder, f"row '{row[0]}' of table '{table}' does not match its hash")
    facts = {name: json.loads(text) for name, text in database.execute("SELECT name, text FROM facts")}
    if "request" not in facts or "state" not in facts:
        raise damaged(folder, "the request is missing")
    if facts.get("format") != FORMAT:
        raise RunError(f"'{folder / FILE}' has the format '{facts.get('format')}'; this version reads '{FORMAT}'")
    return facts


def _request_differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Differences between the request that a run was started with and another one."""
    before, now = _flat(before), _flat(json.loads(canonical(now)))
    return [
        _difference(name, before.get(name), now.get(name))
        for name in sorted({*before, *now})
        if before.get(name) != now.get(name)
    ]


def _flat(request: Mapping[str, Any]) -> dict[str, Any]:
    """Request with every version as an entry of its own."""
    versions = {f"version of {name}": value for name, value in (request.get("versions") or {}).items()}
    return {name: value for name, value in request.items() if name != "versions"} | versions


def _difference(name: str, before: Any, now: Any) -> str:
    if _RECORDING.fullmatch(name) and _without_hash(before) == _without_hash(now):
        return f"{name} has other samples, units or columns"
    return f"{name} was {_shortened(before)} and is {_shortened(now)}"


def _without_hash(identity: str | None) -> str | None:
    """Name of a recording, of `name (hash)`."""
    return identity and identity.rpartition(" (")[0]


def _shortened(value: Any) -> str:
    if value in (None, [], {}):
        return "not given"
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:28]}…{text[-28:]}"
