"""Manifest of a fleet: which recordings there are, and what their columns mean."""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from brightgrey.errors import SettingsError, unknown_name
from brightgrey.option_texts import LISTS
from brightgrey.recordings.recording_toml import KEYS as RECORDING_KEYS
from brightgrey.recordings.recording_toml import checked_options

__all__ = ["Axis", "read_manifest"]

KEYS = ("name", *RECORDING_KEYS)
SEVERAL = ("recording", *LISTS)
_FOLDER = re.compile(r"[\w-][\w.-]*")


@dataclass(frozen=True)
class Axis:
    """One machine of a fleet.

    Attributes
    ----------
    name : str
        Also of its folder.
    recordings : tuple of Path
    options : mapping
        What its columns mean: texts and numbers by the names of the options of ``identify``.
    """

    name: str
    recordings: tuple[Path, ...]
    options: Mapping[str, Any] = field(default_factory=dict)


def read_manifest(file: str | Path) -> tuple[Axis, ...]:
    """Read the manifest of a fleet: a CSV file with one row per axis, or a TOML file with one table ``[[axis]]`` each.

    Columns (keys) are `recording`, which has to be there, `name`, and the options of ``identify`` that say what is
    in a recording. Paths are relative to the manifest; several recordings, outputs or units of one axis are separated
    by semicolons in CSV and are an array in TOML. An empty cell leaves the option as the command line has it.

    Parameters
    ----------
    file : str or Path

    Returns
    -------
    tuple of Axis
        In the order of the file.

    Raises
    ------
    SettingsError
        For a file that cannot be read, unknown columns, names that are no folder's or come twice.
    """
    path = Path(file)
    rows = _toml(path) if path.suffix.lower() == ".toml" else _csv(path)
    if not rows:
        raise SettingsError(f"manifest '{file}' names no axis")
    axes = tuple(_axis(path, number, row) for number, row in enumerate(rows, 1))
    names = [axis.name for axis in axes]
    for name in names:
        if names.count(name) > 1:
            raise SettingsError(f"manifest '{file}': the name '{name}' stands more than once; give each axis its own")
    return axes


def _read_text(path: Path) -> str:
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # reading a device may never end
            raise OSError(0, "it is a device or a pipe")
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise SettingsError(f"no manifest '{path}'") from None
    except OSError as error:
        hint = "; name the CSV or TOML file that lists the axes" if isinstance(error, IsADirectoryError) else ""
        raise SettingsError(f"cannot read manifest '{path}': {error.strerror}{hint}") from None
    except UnicodeDecodeError:
        raise SettingsError(f"manifest '{path}' is not text; CSV or TOML is wanted") from None


def _csv(path: Path) -> list[dict[str, Any]]:
    lines = [line for line in _read_text(path).splitlines() if line.strip() and not line.startswith("#")]
    reader = csv.DictReader(lines, skipinitialspace=True)
    rows = []
    for number, row in enumerate(reader, 2):
        if None in row or None in row.values():
            raise SettingsError(f"manifest '{path}': row {number} has not as many cells as the header")
        cells = {key.strip(): value.strip() for key, value in row.items()}
        filled = {key: value for key, value in cells.items() if value}
        rows.append({k: [p.strip() for p in v.split(";")] if k in SEVERAL else v for k, v in filled.items()})
    return rows


def _toml(path: Path) -> list[dict[str, Any]]:
    try:
        content = tomllib.loads(_read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"manifest '{path}' is not TOML: {error}") from None
    rows = content.pop("axis", [])
    if content or not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise SettingsError(f"manifest '{path}': expected one table [[axis]] for each axis, and nothing else")
    return rows


def _axis(path: Path, number: int, row: Mapping[str, Any]) -> Axis:
    where = f"manifest '{path}', axis {number}"
    for key in row:
        if key not in KEYS:
            raise SettingsError(f"{where}: {unknown_name('column', key, KEYS)}")
    if not isinstance(row.get("name", ""), str):
        raise SettingsError(f"{where}: name has to be a text")
    options = checked_options(where, {key: value for key, value in row.items() if key != "name"})
    files = options.pop("recording", None)
    if not files:
        raise SettingsError(f"{where} names no recording")
    recordings = tuple(path.parent / name for name in files)
    if "beside" in options:
        options["beside"] = [str(path.parent / name) for name in options["beside"]]
    name = row.get("name", recordings[0].stem)
    if not _FOLDER.fullmatch(name):
        raise SettingsError(f"{where}: '{name}' is no name of a folder; letters, digits, '.', '_' and '-' are allowed")
    return Axis(name, recordings, options)
