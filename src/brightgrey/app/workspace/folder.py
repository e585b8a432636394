"""Folder of a workspace on the disk: projects are read and written here and nowhere else."""

from __future__ import annotations

import re
import secrets
import shutil
import sqlite3
import tomllib
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from brightgrey.app.workspace.project import ProjectDocument, RecordingUse, StoredRecording
from brightgrey.errors import SettingsError, printable
from brightgrey.file_lock import hold_lock
from brightgrey.model.files import write_file

__all__ = ["KNOWN_SUFFIXES", "Workspace", "recording_file_name", "slug"]

DOCUMENT = "project.toml"
PROJECT_NAME = re.compile(r"[a-z0-9]+(?:-[a-z0-9]+)*")
#: The end of a file's name is kept if it is one of these: nothing else of a name from outside enters a path.
KNOWN_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".mat", ".h5", ".hdf5", ".tdms", ".mf4", ".gz", ".svdx", ".rec")


def slug(title: str) -> str:
    """Letters, digits and hyphens of a title, at most forty; ``project`` if nothing is left."""
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode().lower()
    return "-".join(re.findall(r"[a-z0-9]+", plain))[:40].strip("-") or "project"


def recording_file_name(label: str, number: int) -> str:
    """Random name for a file that came as `label`; of the label only a known ending is kept."""
    ending = Path(printable(label)).suffix.lower()
    return f"recording-{number}-{secrets.token_hex(4)}{ending if ending in KNOWN_SUFFIXES else '.dat'}"


class Workspace:
    """Projects below a folder."""

    def __init__(self, folder: str | Path) -> None:
        self.root = Path(folder).resolve()
        self.projects = self.root / "projects"
        try:
            self.projects.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SettingsError(f"cannot make a workspace in '{folder}': {error.strerror}") from None
        self.changes: dict[str, int] = {}  # how often each project was written; pages look at it

    @contextmanager
    def only_here(self) -> Iterator[None]:
        """Keep other servers from this workspace; the lock of one that was killed has ended with it.

        Raises
        ------
        SettingsError
            If another server works here, or the folder cannot be written to.
        """
        try:
            lock = hold_lock(self.root / "app.lock", timeout=0.0)
        except sqlite3.Error as error:
            raise SettingsError(f"cannot write into the workspace '{self.root}': {error}") from None
        if lock is None:
            raise SettingsError(
                f"the app is open in '{self.root}' already; go on in its page, end it there by Ctrl-C, or name "
                "another folder"
            )
        with closing(lock):
            yield

    def path(self, name: str) -> Path:
        """Folder of a project.

        Raises
        ------
        SettingsError
            If the name is not one that this program gives.
        """
        if not PROJECT_NAME.fullmatch(name):
            raise SettingsError("a project's name has small letters, digits and hyphens only")
        return self.projects / name

    def names(self) -> list[str]:
        """Projects, the one that was changed last first."""
        found = [p for p in self.projects.glob(f"*/{DOCUMENT}") if PROJECT_NAME.fullmatch(p.parent.name)]
        return [p.parent.name for p in sorted(found, key=lambda p: -p.stat().st_mtime)]

    def create(self, title: str) -> ProjectDocument:
        """Make a project and its folder."""
        shown = printable(" ".join(title.split()))[:80] or "Project"
        base, number = slug(shown), 1
        while True:
            name = base if number == 1 else f"{base}-{number}"
            try:
                self.path(name).mkdir()
                break
            except FileExistsError:
                number += 1
        for part in ("recordings", "runs", "exports", "jobs"):
            (self.path(name) / part).mkdir()
        document = ProjectDocument(name=name, title=shown)
        self.save(document)
        return document

    def load(self, name: str) -> ProjectDocument:
        """Document of a project.

        Raises
        ------
        SettingsError
            If there is none, or it cannot be read.
        """
        file = self.path(name) / DOCUMENT
        try:
            return ProjectDocument.model_validate(tomllib.loads(file.read_text(encoding="utf-8")))
        except FileNotFoundError:
            raise SettingsError(f"there is no project '{name}'") from None
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SettingsError(f"'{file}' cannot be read: {error}") from None
        except ValidationError as error:
            found = error.errors(include_url=False)[0]
            place = ".".join(map(str, found["loc"]))
            raise SettingsError(f"'{file}': field '{place}': {found['msg'].lower()}") from None

    def save(self, document: ProjectDocument) -> None:
        """Write a document, whole or not at all, and a recording.toml for each recording."""
        folder = self.path(document.name)
        for recording in document.recordings:
            target = folder / "recordings" / toml_name(recording)
            text = tomli_w.dumps({"recording": [recording.file], **recording.options})
            if not target.exists() or target.read_text(encoding="utf-8") != text:
                write_file(target, text.encode())
        write_file(folder / DOCUMENT, tomli_w.dumps(document.model_dump(mode="json", exclude_none=True)).encode())
        self.changes[document.name] = self.changes.get(document.name, 0) + 1

    def change(self, name: str, edit: Callable[[ProjectDocument], ProjectDocument]) -> ProjectDocument:
        """Read a document, change it and write it; nothing else writes between the two, as one thread does all."""
        before = self.load(name)
        after = ProjectDocument.model_validate(edit(before).model_dump())
        if after != before:
            self.save(after)
        return after

    def delete(self, name: str) -> None:
        """Remove a project and all that is in its folder."""
        self.load(name)
        shutil.rmtree(self.path(name))
        self.changes[name] = self.changes.get(name, 0) + 1

    def add_recording(self, name: str, content: Path, label: str, sha256: str, options: dict[str, Any]) -> str:
        """Take a file that lies in the project's folder as a recording; returns the name that it gets."""
        document = self.load(name)
        numbers = [int(r.file.split("-")[1]) for r in document.recordings]
        file = recording_file_name(label, max(numbers, default=0) + 1)
        content.replace(self.path(name) / "recordings" / file)
        size = (self.path(name) / "recordings" / file).stat().st_size
        use: RecordingUse = "train"
        shown = printable(Path(label.replace("\\", "/")).name)[:120] or "recording"
        entry = StoredRecording(file=file, label=shown, sha256=sha256, size=size, use=use, options=options)
        self.change(name, lambda d: d.model_copy(update={"recordings": (*d.recordings, entry)}))
        return file

    def remove_recording(self, name: str, file: str) -> None:
        """Forget a recording and delete its file."""
        document = self.load(name)
        (known,) = (r for r in document.recordings if r.file == file)
        kept = tuple(r for r in document.recordings if r.file != file)
        self.change(name, lambda d: d.model_copy(update={"recordings": kept}))
        for leftover in (known.file, toml_name(known)):
            (self.path(name) / "recordings" / leftover).unlink(missing_ok=True)


def toml_name(recording: StoredRecording) -> str:
    """Name of the recording.toml of a recording, beside it."""
    return f"{Path(recording.file).stem}.toml"
