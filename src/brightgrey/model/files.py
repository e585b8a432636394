"""Results reach the disk whole or not at all: checks first, then temporary files, then renames."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from brightgrey.errors import SettingsError

__all__ = ["check_file", "check_folder", "write_file", "write_files"]


def check_folder(folder: str | Path) -> Path:
    """Return `folder` if results can be written there. Nothing is created.

    Raises
    ------
    SettingsError
        If it, or a folder above it, is a file or may not be written to.
    """
    path = Path(folder)
    if path.exists() and not path.is_dir():
        what = "file" if path.is_file() else "device or a pipe"
        raise SettingsError(f"output folder '{folder}' is a {what}; name a folder")
    _check_writable(path, folder)
    return path


def check_file(file: str | Path) -> Path:
    """Return `file` if it can be written. Nothing is created.

    Raises
    ------
    SettingsError
        If it is a folder or a device, or its folder is a file or may not be written to.
    """
    path = Path(file)
    _check_replaceable(path)
    _check_writable(path.parent, file)
    return path


def _check_replaceable(path: Path) -> None:
    """Refuse what a file must not take the place of: root may replace even a device."""
    if path.is_dir():
        raise SettingsError(f"output file '{path}' is a folder; name a file")
    if path.exists() and not path.is_file():
        raise SettingsError(f"output file '{path}' is a device or a pipe; name a file")


def _check_writable(path: Path, came: str | Path) -> None:
    """Look at the nearest folder above that exists: it has to take a new folder or file."""
    existing = next(p for p in (path, *path.absolute().parents) if p.exists())
    if not existing.is_dir():
        raise SettingsError(f"cannot write to '{came}': '{existing.name}' on the way there is a file")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise SettingsError(f"cannot write to '{came}': no permission")


def write_file(file: str | Path, content: bytes) -> None:
    """Write `content` to `file` by way of a temporary file beside it."""
    path = Path(file)
    write_files(path.parent, {path.name: content})


def write_files(folder: str | Path, contents: Mapping[str, bytes]) -> None:
    """Write several files into `folder`, which is made if it is not there.

    All temporary files are complete before the first one takes its place, so that a full disk leaves the
    earlier results as they were.

    Raises
    ------
    SettingsError
        If a folder or a device has the name of one of the files.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for name in contents:
        _check_replaceable(target / name)
    waiting: list[tuple[Path, Path]] = []
    try:
        for name, content in contents.items():
            handle, temporary = tempfile.mkstemp(prefix=f".{name}.", dir=target)
            waiting.append((Path(temporary), target / name))
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            Path(temporary).chmod(0o644)  # mkstemp makes files that nobody else may read
        while waiting:
            temporary_path, final = waiting[0]
            temporary_path.replace(final)
            waiting.pop(0)
    finally:
        for leftover, _ in waiting:
            leftover.unlink(missing_ok=True)
