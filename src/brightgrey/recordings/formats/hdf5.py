"""HDF5 files, among them those of MATLAB from version 7.3 on, read by h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.recordings.formats.channels import Channel, Channels, columns_of_matrix
from brightgrey.recordings.formats.child_process import Library, read_in_child
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.mat import common_length, object_of_matlab
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.policy import READING

__all__ = ["FORMAT", "extract"]

LIBRARY = Library("h5py", "h5py", "formats")
SIGNATURE = b"\x89HDF\r\n\x1a\n"
TEXTS = ("char", "cell", "function_handle")


def is_hdf5(start: bytes) -> bool:
    """Recognise HDF5 by its signature, at the beginning or behind the header that MATLAB puts before it."""
    return start.startswith((SIGNATURE, b"MATLAB 7.3")) or start[512:520] == SIGNATURE


def read_hdf5(path: Path, like: str = "") -> Table:
    """Open an HDF5 file; columns are named and chosen as those of `mat.read_mat`."""
    return common_length(read_in_child(__name__, LIBRARY, path), path.name, like)


def extract(path: Path) -> Channels:
    """Read a file by h5py, in the child process."""
    import h5py

    channels: list[Channel] = []
    others: list[str] = []

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        label = name.replace("/", ".")
        of_matlab = item.attrs.get("MATLAB_class", b"")
        kind = of_matlab.decode() if isinstance(of_matlab, bytes) else ""
        if "MATLAB_object_decode" in item.attrs:
            others.append(label + object_of_matlab(kind))
            return
        shape = tuple(size for size in item.shape or () if size != 1)
        readable = item.dtype.kind in "fiub" and kind not in TEXTS and "MATLAB_empty" not in item.attrs
        if not readable or not shape or len(shape) > 2 or (len(shape) == 2 and min(shape) > READING.max_matrix_columns):
            others.append(label)
            return
        # MATLAB writes its columns one after the other, which are rows of HDF5.
        values = np.asarray(item[()]).T if kind else np.asarray(item[()])
        if len(shape) == 1:
            channels.append(Channel(label, values.ravel().astype(np.float64)))
        else:
            channels.extend(columns_of_matrix(label, values.reshape(shape[::-1] if kind else shape)))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return Channels(tuple(channels), (), tuple(others))


FORMAT = FileFormat("MATLAB 7.3 and HDF5", is_hdf5, read_hdf5)
