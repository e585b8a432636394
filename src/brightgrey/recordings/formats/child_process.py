"""Reading by a library of others, in a child process with limits of time and memory.

Such a library may crash the process, hang, or ask for any amount of memory when a file is damaged. A child process that
ends so is an error like any other. The channels come back as a file of plain arrays.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from brightgrey.errors import RecordingError, printable
from brightgrey.recordings.formats.channels import Channel, Channels
from brightgrey.recordings.policy import READING

__all__ = ["Library", "read_in_child"]

MEGABYTE = 1 << 20


@dataclass(frozen=True)
class Library:
    """A library that reads a format.

    Attributes
    ----------
    module : str
        To import, e.g. ``scipy.io``.
    package : str
        Name to install it by.
    extra : str
        Extra of this package that brings it; empty if it is always there.
    seconds : float
        Time of the processor in s for any file, the import apart.
    megabytes_per_second : float
        Speed that adds to the time for large files, in MB per s.
    least_megabytes : int
        Memory for any file beside what the import takes, in units of 2^20 bytes.
    times_the_file : int
        Memory for large files, as a multiple of their size.
    """

    module: str
    package: str
    extra: str = ""
    seconds: float = 5.0
    megabytes_per_second: float = 5.0
    least_megabytes: int = 160
    times_the_file: int = 20


def read_in_child(reader: str, library: Library, path: Path) -> Channels:
    """Return the channels that the function ``extract(path)`` of the module `reader` reads from a file.

    Raises
    ------
    RecordingError
        If the library is not installed, does not read the file, crashes, or needs more time or memory than allowed.
    """
    name = path.name
    if importlib.util.find_spec(library.module.partition(".")[0]) is None:
        raise RecordingError(
            f"{name}: files of this format are read by {library.package}, which is not installed;"
            f" install it by: pip install 'brightgrey[{library.extra}]'"
        )
    size = path.stat().st_size / MEGABYTE
    seconds = library.seconds + size / library.megabytes_per_second
    memory = int(max(library.least_megabytes, library.times_the_file * size)) * MEGABYTE
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "channels"
        given = [reader, library.module, os.fspath(path.absolute()), str(result), str(seconds), str(memory)]
        # Threads of a linear algebra that is not used would take memory; the child finds packages where we do.
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        try:
            done = subprocess.run(
                [sys.executable, "-c", f"from {__name__} import run; run()", *given],
                capture_output=True,
                stdin=subprocess.DEVNULL,
                env=environment,
                timeout=60.0 + 4.0 * seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise _refusal(name, library, f"it has not come to an end in {60.0 + 4.0 * seconds:.0f} s") from None
        if done.returncode == 0:
            return _load(result)
        raise _refusal(name, library, _reason(result, done.returncode, seconds, memory))


def _refusal(name: str, library: Library, reason: str) -> RecordingError:
    return RecordingError(f"{name}: {library.package} cannot read the file, it may be damaged ({reason})")


def _reason(result: Path, code: int, seconds: float, memory: int) -> str:
    error = result.with_suffix(".error")
    if error.is_file():
        return error.read_text(encoding="utf-8", errors="replace")
    if code == -24:  # SIGXCPU
        return f"it takes more than {seconds:.0f} s"
    return f"it ended the process that read it, with code {code}, within {memory // MEGABYTE} MB of memory"


def run() -> None:
    """Read a file in this process, which is the child, as `sys.argv` says."""
    reader, module, path, result, seconds, memory = sys.argv[1:]
    importlib.import_module(module)
    extract = cast("Callable[[Path], Channels]", importlib.import_module(reader).extract)
    _limit(float(seconds), int(memory))
    said = _Remarks()
    logging.getLogger().addHandler(said)
    try:
        found = extract(Path(path))
        _save(replace(found, notes=tuple(dict.fromkeys(said.texts))[: READING.most_remarks]), Path(result))
    except MemoryError:
        _fail(result, f"it takes more than {int(memory) // MEGABYTE} MB of memory")
    except Exception as error:
        # The errors of libraries for a damaged file are not documented.
        lines = str(error).splitlines()
        _fail(result, (lines[0] if lines else type(error).__name__)[: READING.longest_remark])


class _Remarks(logging.Handler):
    """Warnings that a library logs, each on one printable line."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a warning."""
        text = printable(record.getMessage().partition("\n")[0])
        self.texts.append(f"{record.name.partition('.')[0]} remarks: {text[: READING.longest_remark]}")


def _fail(result: str, reason: str) -> None:
    Path(result).with_suffix(".error").write_text(reason, encoding="utf-8", errors="replace")
    sys.exit(3)


def _limit(seconds: float, memory: int) -> None:
    """Limit what this process may still take; where the system has no such limits only the parent's clock holds."""
    try:
        import resource
    except ImportError:
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent = int(used.ru_utime + used.ru_stime + seconds) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (spent, spent + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    status = Path("/proc/self/status")
    if status.is_file():
        sizes = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        limit = int(sizes["VmSize"].split()[0]) * 1024 + memory
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _save(found: Channels, result: Path) -> None:
    """Write channels as one header and one block of numbers."""
    header = {
        "channels": [(c.name, c.unit, c.clock, c.label, int(c.values.size)) for c in found.channels],
        "clocks": [int(clock.size) for clock in found.clocks],
        "others": found.others,
        "notes": found.notes,
    }
    with result.with_suffix(".numbers").open("wb") as file:
        for array in (*(channel.values for channel in found.channels), *found.clocks):
            np.asarray(array, dtype=np.float64).tofile(file)
    result.with_suffix(".json").write_text(json.dumps(header), encoding="utf-8")


def _load(result: Path) -> Channels:
    header = json.loads(result.with_suffix(".json").read_text(encoding="utf-8"))
    numbers = np.fromfile(result.with_suffix(".numbers"), dtype=np.float64)
    sizes = [*(size for *_, size in header["channels"]), *header["clocks"]]
    arrays = np.split(numbers, np.cumsum(sizes)[:-1]) if sizes else []
    channels = [
        Channel(name, values, unit, clock, label)
        for (name, unit, clock, label, _), values in zip(header["channels"], arrays, strict=False)
    ]
    return Channels(tuple(channels), tuple(arrays[len(channels) :]), tuple(header["others"]), tuple(header["notes"]))
