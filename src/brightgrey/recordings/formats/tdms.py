"""TDMS files of National Instruments, read by npTDMS. Waveform channels have their own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.formats.channels import Channel, Channels, with_distinct_names
from brightgrey.recordings.formats.child_process import Library, read_in_child
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.table import Table

__all__ = ["FORMAT", "extract"]

LIBRARY = Library("nptdms", "npTDMS", "formats-lgpl")


def is_tdms(start: bytes) -> bool:
    """Recognise TDMS by the tag of its first segment."""
    return start.startswith(b"TDSm")


def read_tdms(path: Path, like: str = "") -> Table:
    """Open a TDMS file; a channel that two groups have is called ``group/channel``."""
    return read_in_child(__name__, LIBRARY, path).table(path.name)


def extract(path: Path) -> Channels:
    """Read a file by npTDMS, in the child process."""
    import nptdms

    content = nptdms.TdmsFile.read(path)
    clocks: dict[tuple[float, float, int], int] = {}
    times: list[Array] = []
    found: list[tuple[str, Channel]] = []
    others: list[str] = []
    for channel in (channel for group in content.groups() for channel in group.channels()):
        values = np.asarray(channel[:])
        if values.dtype.kind not in "fiub" or values.size < 2:
            others.append(channel.name)
            continue
        step = channel.properties.get("wf_increment")
        clock = None
        if isinstance(step, int | float) and step > 0:
            key = (float(channel.properties.get("wf_start_offset", 0.0)), float(step), values.size)
            clock = clocks.setdefault(key, len(clocks))
            if clock == len(times):
                times.append(key[0] + key[1] * np.arange(values.size, dtype=np.float64))
        unit = str(channel.properties.get("unit_string", "")).strip() or None
        found.append((channel.group_name, Channel(channel.name, values.astype(np.float64), unit, clock)))
    return Channels(with_distinct_names(found), tuple(times), tuple(others))


FORMAT = FileFormat("NI TDMS", is_tdms, read_tdms)
