"""MATLAB files up to version 7 (MAT v5, v4). Vectors and the columns of matrices become columns."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.file_format import FileFormat
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.policy import READING

__all__ = ["FORMAT", "is_mat", "read_mat"]


def is_mat(path: Path, start: bytes) -> bool:
    """Recognise a MATLAB file by its name or by its first bytes."""
    return path.suffix.lower() == ".mat" or start.startswith((b"MATLAB ", b"\x89HDF"))


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
        For MAT v7.3 (HDF5), a damaged file, and a file without vectors of numbers.
    """
    name = path.name
    vectors, others = _vectors(_load_variables(path))
    if not vectors:
        raise RecordingError(f"{name}: there is no vector of numbers in it" + _listed("; it holds", others))
    lengths = [values.size for values in vectors.values()]
    samples = (
        vectors[like].size if like in vectors else max(set(lengths), key=lambda length: (lengths.count(length), length))
    )
    columns = {key: values for key, values in vectors.items() if values.size == samples}
    odd = [f"{key} ({values.size} samples)" for key, values in vectors.items() if values.size != samples]
    data = list(columns.values())
    return Table(
        name,
        tuple(Column(key, key) for key in columns),
        np.arange(1, samples + 1),
        lambda indices: np.array([data[i] for i in indices], dtype=np.float64),
        unread="; ".join(part for part in (_listed("of other length:", odd), _listed("not vectors:", others)) if part),
    )


def _listed(words: str, names: list[str]) -> str:
    return f"{words} {', '.join(names)}" if names else ""


def _load_variables(path: Path) -> Mapping[str, Any]:
    """Variables of a file as scipy reads them."""
    import scipy.io

    with path.open("rb") as file:
        if file.read(4) == b"\x89HDF" or b"MATLAB 7.3" in path.read_bytes()[:16]:
            raise RecordingError(
                f"{path.name}: MAT files of version 7.3 (HDF5) are not read; save it in MATLAB with save(..., '-v7')"
            )
    try:
        with warnings.catch_warnings():
            # scipy warns of classes and function handles that it skips; the table says what it holds.
            warnings.simplefilter("ignore")
            content: Mapping[str, Any] = scipy.io.loadmat(path, simplify_cells=True)
    except Exception as error:
        # The errors of scipy for a damaged file are not documented; they range from ValueError to zlib.error.
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise RecordingError(f"{path.name}: the MAT file cannot be read, it may be damaged ({first})") from error
    return {key: value for key, value in content.items() if not key.startswith("__")}


def _flattened(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Variables and fields of structs, by name."""
    for key, value in content.items():
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def _vectors(content: Mapping[str, Any]) -> tuple[dict[str, Array], list[str]]:
    """Return the vectors of real numbers by name, and the names of all other variables."""
    vectors: dict[str, Array] = {}
    others: list[str] = []
    for key, value in _flattened(content):
        array = np.asarray(value.toarray() if hasattr(value, "toarray") else value)
        real = array.dtype.kind in "fiub" and array.size > 1
        if real and array.ndim == 1:
            vectors[key] = array.astype(np.float64)
        elif real and array.ndim == 2 and min(array.shape) <= READING.max_matrix_columns:
            tall = array if array.shape[0] >= array.shape[1] else array.T
            label = "(:,{})" if tall is array else "({},:)"
            for i in range(tall.shape[1]):
                vectors[key + label.format(i + 1)] = tall[:, i].astype(np.float64)
        else:
            others.append(key)
    return vectors, others


FORMAT = FileFormat("MATLAB", is_mat, read_mat)
