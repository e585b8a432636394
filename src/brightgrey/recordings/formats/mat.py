"""MATLAB files up to version 7 (MAT v5, v4). Vectors, columns of matrices and fields of structs become columns.

SciPy reads them in a child process, because a damaged file can end the process that reads it.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.channels import Channel, Channels, columns_of_matrix, listed
from brightgrey.recordings.formats.child_process import Library, read_in_child
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.policy import READING

__all__ = ["FORMAT", "common_length", "extract", "object_of_matlab"]

LIBRARY = Library("scipy.io", "scipy")
LABELS = ("label", "Name")


def is_mat(start: bytes) -> bool:
    """Recognise a MATLAB file of version 5 by its text, and one of version 4 by its first variable."""
    return start.startswith(b"MATLAB 5.0 MAT-file") or _is_version_4(start)


def _is_version_4(start: bytes) -> bool:
    """Return True if the first 20 bytes describe a variable and a name follows them."""
    if len(start) < 22:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", start[:20])
        name = start[20 : 20 + length - 1] if 1 < length <= 64 else b""
        known = kind // 1000 == "<>".index(order) and kind // 100 % 10 == 0 and kind // 10 % 10 < 6 and kind % 10 < 3
        if known and rows >= 0 and columns >= 0 and imaginary in (0, 1) and name.isascii() and name[:1].isalpha():
            return name.decode().isidentifier()
    return False


def read_mat(path: Path, like: str = "") -> Table:
    """Open a MAT file.

    Columns are the vectors of more than one element by their names. A column of a matrix is called ``name(:,1)``, a
    field of a struct ``name.field``. All have the length of the column called `like` if there is one, otherwise
    the most frequent length. Rows are counted from 1, as MATLAB does.

    Parameters
    ----------
    path : Path
    like : str
        Name of a column that has the right length.

    Returns
    -------
    Table

    Raises
    ------
    RecordingError
        For a damaged file, and a file without vectors of numbers.
    """
    return common_length(read_in_child(__name__, LIBRARY, path), path.name, like)


def common_length(found: Channels, name: str, like: str) -> Table:
    """Return the table of the channels that have the length of `like`, or else the most frequent length.

    Raises
    ------
    RecordingError
        If there is no channel.
    """
    if not found.channels:
        holds = f"; {listed('it holds', found.others)}" if found.others else ""
        raise RecordingError(f"{name}: there is no vector of numbers in it{holds}")
    sizes = {channel.name: channel.values.size for channel in found.channels}
    lengths = list(sizes.values())
    usual = max(set(lengths), key=lambda length: (lengths.count(length), length))
    samples = sizes.get(like, usual)
    odd = [f"{key} ({size} samples)" for key, size in sizes.items() if size != samples]
    unread = "; ".join(filter(None, (listed("of other length:", odd), listed("not vectors:", found.others))))
    kept = tuple(channel for channel in found.channels if channel.values.size == samples)
    return replace(replace(found, channels=kept).table(name), unread=unread)


def extract(path: Path) -> Channels:
    """Read a file by SciPy, in the child process."""
    import scipy.io

    with warnings.catch_warnings():
        # scipy warns of classes and function handles that it skips; the table says what it holds.
        warnings.simplefilter("ignore")
        content: Mapping[str, Any] = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    channels: list[Channel] = []
    others: list[str] = []
    variables = {key: _without_structs(value) for key, value in content.items() if not key.startswith("__")}
    for key, value, label, unit in _flattened(variables):
        array = _array(value)
        if array is None or array.dtype.kind not in "fiub" or array.size < 2:
            others.append(key + _class_of(array))
        elif array.ndim == 1:
            channels.append(Channel(key, array.astype(np.float64), unit, label=label))
        elif array.ndim == 2 and min(array.shape) <= READING.max_matrix_columns:
            channels += columns_of_matrix(key, array)
        else:
            others.append(key)
    return Channels(tuple(channels), (), tuple(others))


def _without_structs(value: Any) -> Any:
    """Return structs as dicts and cells as lists; SciPy's own way to do so fails for cells of unequal arrays."""
    if hasattr(value, "_fieldnames"):
        return {name: _without_structs(getattr(value, name)) for name in value._fieldnames}
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [_without_structs(element) for element in value] if value.ndim else _without_structs(value.item())
    return value


def _array(value: Any) -> np.ndarray[Any, Any] | None:
    """Return an array, or None for what is none: cells of structs, a sparse matrix too large to be a recording."""
    if hasattr(value, "toarray"):
        rows, columns = value.shape
        return value.toarray() if min(rows, columns) <= READING.max_matrix_columns else None
    try:
        return np.asarray(value)
    except ValueError:
        return None


def _class_of(array: np.ndarray[Any, Any] | None) -> str:
    """Return the class of an object of MATLAB, which no other program reads, with what to do; empty for any other."""
    names = () if array is None else array.dtype.names or ()
    return object_of_matlab(_plain_text(array["s2"])) if array is not None and "s2" in names else ""


def object_of_matlab(kind: str) -> str:
    """Return the remark on an object of MATLAB, e.g. a timeseries."""
    return f" (an object of class {kind or 'unknown'}: save its numbers, e.g. t = x.Time; u = x.Data)"


def _plain_text(value: Any) -> str:
    """Return a text, also one of bytes or in an array; empty for anything else."""
    plain = value.ravel()[0] if isinstance(value, np.ndarray) and value.size == 1 else value
    plain = plain.decode("ascii", "replace") if isinstance(plain, bytes) else plain
    return plain if isinstance(plain, str) else ""


def _flattened(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any, str, str | None]]:
    """Variables and fields of structs with their labels and units; elements of an array of structs by their number.

    A struct that holds one signal names it: ``label`` in Simulink, ``Name`` and ``Unit`` in dSPACE ControlDesk.
    """
    label = next((_plain_text(content[key]) for key in LABELS if key in content), "")
    unit = _plain_text(content.get("Unit"))
    for key, value in content.items():
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{prefix}{key}.")
        elif isinstance(value, list) and _are_structs(value):
            for i, element in enumerate(value):
                yield from _flattened(element, f"{prefix}{key}({i + 1}).")
        else:
            yield prefix + str(key), value, label, unit or None


def _are_structs(value: Any) -> bool:
    return 0 < len(value) <= READING.max_matrix_columns and all(isinstance(element, Mapping) for element in value)


FORMAT = FileFormat("MATLAB", is_mat, read_mat)
