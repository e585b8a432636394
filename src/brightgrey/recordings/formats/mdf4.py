"""ASAM MDF files (version 3 and 4), read by asammdf. Every group of channels has its own time."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.formats.channels import Channel, Channels, with_distinct_names
from brightgrey.recordings.formats.child_process import Library, read_in_child
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.table import Table

__all__ = ["FORMAT", "extract"]

# asammdf maps files into memory and loads libraries late, both of which count as memory.
LIBRARY = Library("asammdf", "asammdf", "formats-lgpl", seconds=8.0, least_megabytes=512)


def is_mdf(start: bytes) -> bool:
    """Recognise MDF by its identification block."""
    return start.startswith((b"MDF     ", b"UnFinMF "))


def read_mdf(path: Path, like: str = "") -> Table:
    """Open an MDF file; a channel that two groups have is called ``group/channel``, groups counted from 1."""
    return read_in_child(__name__, LIBRARY, path).table(path.name)


def extract(path: Path) -> Channels:
    """Read a file by asammdf, in the child process."""
    import asammdf

    times: list[Array] = []
    found: list[tuple[str, Channel]] = []
    others: list[str] = []
    with asammdf.MDF(path) as content:
        for number, group in enumerate(cast("list[Any]", content.groups)):
            master = content.masters_db.get(number)
            for index, channel in enumerate(group.channels):
                if index == master:
                    continue
                signal = content.get(group=number, index=index)
                values = np.asarray(signal.samples)
                if values.ndim != 1 or values.dtype.kind not in "fiub" or values.size < 2:
                    others.append(channel.name)
                    continue
                stamps = np.asarray(signal.timestamps, dtype=np.float64)
                if master is not None and not (times and np.array_equal(times[-1], stamps)):
                    times.append(stamps)
                clock = len(times) - 1 if master is not None else None
                unit = str(signal.unit or "").strip() or None
                found.append((str(number + 1), Channel(channel.name, values.astype(np.float64), unit, clock)))
    return Channels(with_distinct_names(found), tuple(times), tuple(others))


FORMAT = FileFormat("ASAM MDF", is_mdf, read_mdf)
