"""A recording.toml: a file beside a recording that says what is in it, in the words of the command line.

recording = "axis.csv"
input = "torque"
output = ["velocity:velocity"]
unit = ["torque=N m", "velocity=rpm"]
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brightgrey.errors import SettingsError, unknown_name
from brightgrey.option_texts import LISTS, NUMBERS, TEXTS, WHOLE_NUMBERS, pairs, reading_arguments
from brightgrey.recordings.read import read_recording, read_stretches
from brightgrey.recordings.recording import Recording

__all__ = ["KEYS", "checked_options", "is_recording_toml", "load_recording_toml", "read_recordings", "write_fixed"]

KEYS = ("recording", *TEXTS, *NUMBERS, *LISTS)


def is_recording_toml(path: str | Path) -> bool:
    """True if a file is called like a recording.toml; it is text, and so may be a recording without a header."""
    return Path(path).suffix.lower() == ".toml"


def read_recordings(
    path: str | Path, instead: Mapping[str, Any] | None = None, *, stretches: bool = True
) -> tuple[Recording, ...]:
    """Read the recordings that a recording.toml names, with its options.

    Parameters
    ----------
    path : str or Path
        A TOML file. Its keys are ``recording``, a file or a list of files beside it, and the options of
        ``brightgrey identify`` that say what is in a recording, such as ``input`` and ``output``.
    instead : mapping of str to object, optional
        Options that replace those of the file.
    stretches : bool
        Whether each stretch between holes in the time is a recording of its own, see `read_stretches`; otherwise the
        longest one of each file is read.

    Returns
    -------
    tuple of Recording

    Raises
    ------
    RecordingError, SettingsError
        For a file that cannot be read, an unknown key, and what `read_recording` raises.
    """
    files, options = load_recording_toml(path)
    options = {**options, **(instead or {})}
    for name in ("input", "output"):
        if not options.get(name):
            raise SettingsError(f"{path}: no {name} is named; write {name} = ... or give --{name}")
    arguments = reading_arguments(options)
    if not stretches:
        return tuple(read_recording(file, **arguments) for file in files)
    return tuple(part for file in files for part in read_stretches(file, **arguments))


def load_recording_toml(path: str | Path) -> tuple[tuple[Path, ...], dict[str, Any]]:
    """Return the files that a recording.toml names and its options.

    Raises
    ------
    SettingsError
        For a file that cannot be read, an unknown key or a value of another kind.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise OSError(0, "it is a folder, a device or a pipe")
        content = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise SettingsError(f"{path}: there is no such file") from None
    except OSError as error:
        raise SettingsError(f"{path}: the file cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        hint = "" if is_recording_toml(path) else "; a recording itself is read by read_recording"
        raise SettingsError(f"{path} is not TOML: {error}{hint}") from None
    options = checked_options(str(path), content)
    files = options.pop("recording", None)
    if not files:
        raise SettingsError(f'{path} names no recording; write recording = "axis.csv"')
    if "beside" in options:
        options["beside"] = [str(Path(path).parent / name) for name in options["beside"]]
    return tuple(Path(path).parent / name for name in files), options


def checked_options(where: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Check keys and kinds of values of a recording.toml, or of an axis of a manifest; several are a list.

    Raises
    ------
    SettingsError
        That begins with `where`.
    """
    options: dict[str, Any] = {}
    for key, value in given.items():
        if key not in KEYS:
            raise SettingsError(f"{where}: {unknown_name('key', key, KEYS)}")
        if key in (*LISTS, "recording"):
            several = [value] if isinstance(value, str) else value
            if not (isinstance(several, list) and all(isinstance(v, str) for v in several)):
                raise SettingsError(f"{where}: {key} has to be a text or several")
            options[key] = several
        elif key in TEXTS:
            if not isinstance(value, str):
                raise SettingsError(f"{where}: {key} has to be a text")
            options[key] = value
        else:
            options[key] = _number(where, key, value)
    return options


def _number(where: str, key: str, value: Any) -> float | int:
    try:
        return int(value) if key in WHOLE_NUMBERS else float(value)
    except (TypeError, ValueError):
        raise SettingsError(f"{where}: {key} '{value}' is not a number") from None


def write_fixed(paths: Sequence[Path], given: Mapping[str, Any], remedies: Mapping[str, Any]) -> Path:
    """Write a recording.toml beside recordings, or change the one that was given.

    Parameters
    ----------
    paths : sequence of Path
        Recordings of one folder, or one recording.toml.
    given : mapping of str to object
        Options of the command line.
    remedies : mapping of str to object
        See `recording_toml`.

    Returns
    -------
    Path
        Of the file that was written.

    Raises
    ------
    SettingsError
        If the folder has another recording.toml, or a recording.toml is among several files.
    """
    if any(is_recording_toml(path) for path in paths):
        if len(paths) > 1:
            raise SettingsError("--fix: give one recording.toml, or recordings")
        files, options = load_recording_toml(paths[0])
        target, names = paths[0], [os.path.relpath(file, paths[0].parent) for file in files]
    else:
        target, names, options = paths[0].parent / "recording.toml", [path.name for path in paths], {}
        if target.exists():
            raise SettingsError(f"{target} exists: check it (brightgrey check {target} --fix), or remove it")
    together = {**options, **given}
    if "beside" in together:
        together["beside"] = [os.path.relpath(file, target.parent) for file in together["beside"]]
    text = recording_toml(names, together, remedies)
    try:
        target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SettingsError(f"{target} cannot be written ({error.strerror})") from None
    return target


def recording_toml(files: list[str], options: Mapping[str, Any], remedies: Mapping[str, Any]) -> str:
    """Text of a recording.toml, with the remedies of a checkup.

    Parameters
    ----------
    files : list of str
        Relative to the folder of the file.
    options : mapping of str to object
        As on the command line; None is left out.
    remedies : mapping of str to object
        Changes of options, as :class:`~brightgrey.recordings.checks.check.CheckResult` describes them.
    """
    whole = {"recording": files, **{key: options[key] for key in KEYS if options.get(key) is not None}}
    for key, value in remedies.items():
        whole[key] = _changed(key, whole.get(key), value)
    return "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in whole.items())


def _changed(key: str, old: Any, new: Any) -> Any:
    """Return an option after a remedy: factors multiply, shifts add up, an output takes another kind."""
    if key == "output":
        renamed = {text.rpartition(":")[0]: text for text in new}
        return [renamed.get(text.rpartition(":")[0] or text, renamed.get(text, text)) for text in old]
    if key in ("gear", "shift"):
        found = pairs(f"--{key}", old or [], "COLUMN=NUMBER")
        for name, value in pairs(f"--{key}", new, "COLUMN=NUMBER").items():
            before = float(found.get(name, 1.0 if key == "gear" else 0.0))
            found[name] = f"{before * float(value) if key == 'gear' else before + float(value):.9g}"
        return [f"{name}={value}" for name, value in found.items()]
    return (old or 1) * new
