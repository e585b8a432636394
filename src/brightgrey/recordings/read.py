"""Readers of recordings: a file or arrays in memory become one checked, frozen recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from brightgrey.errors import RecordingError, nearest
from brightgrey.recordings.checks import is_constant
from brightgrey.recordings.columns import OutputColumn, ReadingOptions, choose_columns
from brightgrey.recordings.formats import file_formats
from brightgrey.recordings.formats.delimited import read_delimited
from brightgrey.recordings.formats.file_format import FIRST_BYTES
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.policy import READING
from brightgrey.recordings.recording import Recording, Signal, check_hold
from brightgrey.recordings.samples import Samples, sample
from brightgrey.recordings.window import TimeWindow, check_decimate, check_window, decimate

__all__ = ["read_recording", "recording_from"]

UNITS_OF_FILE: Mapping[str, str] = MappingProxyType({})
# First bytes of a zip archive; a workbook is one.
ARCHIVE = b"PK\x03\x04"


def read_recording(
    path: str | Path,
    *,
    input: str,
    outputs: str | Sequence[OutputColumn],
    time: str | None = None,
    dt: float | None = None,
    input_gain: float = 1.0,
    units: Mapping[str, str] = UNITS_OF_FILE,
    window: TimeWindow | None = None,
    decimate: int = 1,
    hold: str = "linear",
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
) -> Recording:
    """Read a recording of a drive from a CSV or MAT (v5) file.

    Delimiter, decimal mark, header, comments and units in the header are found automatically. Time must rise in
    steps that are equal within 10 %. `Recording.notes` lists repairs and assumptions: single missing samples and
    values are interpolated, rows written twice are left out, time stamps rounded to a coarse last digit are read
    as uniform. No repair may concern more than 1 % of the samples. A channel that never changes is noted, not
    refused.

    Parameters
    ----------
    path : str or Path
        File to read.
    input : str
        Column of the input: torque, force, voltage, current. Columns of a file without header are called
        ``1``, ``2``, ...; a whole number that is no column's name counts the columns in any file.
    outputs : str or sequence of str or of (name, kind)
        Columns of the motion with their kind, ``name:kind``. Kinds are position, velocity,
        velocity-differenced (made by differencing an encoder) and acceleration. A kind that is not given follows
        from the unit or the name.
    time : str, optional
        Column of the time; by default the column called t, time, time_s, Time [ms] or the like.
    dt : float, optional
        Sampling interval in s, instead of a time column.
    input_gain : float
        Factor between the recorded input and its unit, e.g. the force constant in N/V with the unit N.
    units : mapping of str to str
        Units by column, e.g. ``{"torque": "mN m", "speed": "rpm"}``; they replace those in the header.
        Without any unit SI is assumed: N m and rad, or N and m if another column has a unit of length or force.
    window : (float or None, float or None), optional
        Start and end in s of the recording's time, both included. Samples outside are not checked.
    decimate : int
        Keep one sample in so many, see :func:`brightgrey.recordings.decimate`.
    hold : {'linear', 'zoh'}
        Course of the input between two samples.
    delimiter, decimal, header : optional
        Delimiter of a text file (a space means any white space), decimal mark, and True if there is a header.
        Those that are not given are found automatically.

    Returns
    -------
    Recording
        In coherent SI.

    Raises
    ------
    RecordingError
        For a file that cannot be read or used. The message is one line that names file, column and row.
    SettingsError
        For options that are out of range or contradict each other.
    """
    file = Path(path)
    start = _first_bytes(file)
    reader = next((f for f in file_formats() if f.recognises(file, start)), None)
    if reader is not None:
        table = reader.read(file, input)
    elif start.startswith(ARCHIVE):
        raise RecordingError(f"{file.name}: this is a workbook or an archive; save the sheet as CSV and read that")
    else:
        table = read_delimited(file, delimiter=delimiter, decimal=decimal, header=header)
    return _make_recording(table, ReadingOptions(input, outputs, time, dt, input_gain, units, window, decimate, hold))


def recording_from(
    columns: Mapping[str, Any],
    *,
    input: str,
    outputs: str | Sequence[OutputColumn],
    time: str | None = None,
    dt: float | None = None,
    input_gain: float = 1.0,
    units: Mapping[str, str] = UNITS_OF_FILE,
    window: TimeWindow | None = None,
    decimate: int = 1,
    hold: str = "linear",
    name: str = "recording",
) -> Recording:
    """Make a recording of arrays in memory, with the same checks as a file's.

    Parameters that are not listed, the return value and the errors (RecordingError) are those of `read_recording`.

    Parameters
    ----------
    columns : mapping of str to array_like, shape (samples,)
        E.g. a dict of arrays or a data frame.
    name : str
        Name of the recording in messages and results.
    """
    arrays = []
    for key in columns:
        try:
            array = np.asarray(columns[key], dtype=np.float64)
        except (TypeError, ValueError):
            array = np.empty((0, 0))
        if array.ndim != 1:
            raise RecordingError(f"{name}: column '{key}': expected numbers of shape (samples,)")
        arrays.append(array)
    lengths = {array.size for array in arrays}
    if len(lengths) != 1:
        raise RecordingError(f"{name}: columns must have one length, these have {sorted(lengths)}")
    table = Table(
        name,
        tuple(Column(str(key), str(key)) for key in columns),
        np.arange(1, lengths.pop() + 1),
        lambda indices: np.array([arrays[i] for i in indices]),
    )
    return _make_recording(table, ReadingOptions(input, outputs, time, dt, input_gain, units, window, decimate, hold))


def _make_recording(table: Table, options: ReadingOptions) -> Recording:
    """Make a recording of a table."""
    check_window(options.window)
    check_decimate(options.decimate)
    hold = check_hold(options.hold)
    choice = choose_columns(table, options)
    samples = sample(table, choice, options.dt, options.window)
    # From the shown unit to SI; the gain is that of the input.
    factors = np.array([signal.gain / signal.factor for signal in choice.signals])
    values = samples.values * factors[:, None]
    recording = Recording(
        name=table.name,
        t=samples.t,
        u=values[0],
        y=values[1:],
        input=choice.signals[0],
        outputs=choice.signals[1:],
        hold=hold,
        notes=(*table.notes, *choice.notes, *samples.notes, *_remarks(choice.signals, samples)),
        resolution=(samples.resolution * np.abs(factors))[1:],
    )
    return decimate(recording, options.decimate)


def _remarks(signals: Sequence[Signal], samples: Samples) -> list[str]:
    """Note constant channels, and velocities that look like a differenced encoder."""
    remarks = []
    for signal, values, step in zip(signals, samples.values, samples.resolution, strict=True):
        role = "input" if signal.kind == "input" else "output"
        if is_constant(values):
            shown = f"{values[0] * signal.gain:.6g} {signal.unit}"
            remarks.append(f"{role} '{signal.name}' never changes ({shown}): nothing can be identified from it")
        elif signal.kind == "velocity" and np.ptp(values) < READING.coarse_levels * step:
            remarks.append(
                f"velocity '{signal.name}' moves in steps of {step:.6g} {signal.unit}: if it was made by"
                f" differencing an encoder, say {signal.name}:velocity-differenced"
            )
    return remarks


def _first_bytes(path: Path) -> bytes:
    """Start of a file, after checking that it exists and can be read."""
    name = path.name or str(path)
    try:
        if path.is_dir():
            raise RecordingError(f"{name}: this is a folder, not a recording")
        if not path.exists():
            folder = path.parent
            files = [p.name for p in folder.iterdir() if p.is_file()] if folder.is_dir() else []
            guess = nearest(name, files)
            raise RecordingError(f"{path}: there is no such file" + (f". Did you mean '{guess}'?" if guess else ""))
        if not path.is_file():
            raise RecordingError(f"{path}: this is a device or a pipe, not a file")
        with path.open("rb") as file:
            return file.read(FIRST_BYTES)
    except OSError as error:
        raise RecordingError(f"{name}: the file cannot be read ({error.strerror})") from error
