"""Readers of recordings: a file or arrays in memory become one checked, frozen recording."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from brightgrey.arguments import bind_checked, checked_arguments
from brightgrey.arrays import Array
from brightgrey.errors import RecordingError
from brightgrey.recordings.columns import OutputColumn, ReadingOptions, choose_columns
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.joined_files import open_together
from brightgrey.recordings.policy import READING
from brightgrey.recordings.recording import Recording, Signal, Source, check_hold
from brightgrey.recordings.samples import Samples, sample
from brightgrey.recordings.time_base import stretch_edges
from brightgrey.recordings.units.drive_scales import DriveScales
from brightgrey.recordings.window import TimeWindow, check_decimate, check_window, decimate, inside

__all__ = ["read_again", "read_recording", "read_stretches", "recording_from"]

NOT_GIVEN: Mapping[str, Any] = MappingProxyType({})


@checked_arguments
def read_recording(
    path: str | Path,
    *,
    input: str,
    outputs: str | Sequence[OutputColumn],
    time: str | None = None,
    dt: float | None = None,
    input_gain: float = 1.0,
    actuator: int = 1,
    units: Mapping[str, str] = NOT_GIVEN,
    window: TimeWindow | None = None,
    decimate: int = 1,
    hold: str = "linear",
    rated: Mapping[str, str] = NOT_GIVEN,
    counts: Mapping[str, float] = NOT_GIVEN,
    gear: Mapping[str, float] = NOT_GIVEN,
    torque_constant: str | None = None,
    shift: Mapping[str, float] = NOT_GIVEN,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    beside: Sequence[str | Path] = (),
) -> Recording:
    """Read a recording of a drive from a file.

    The format is found by the content: text with columns, Beckhoff TwinCAT Scope, maxon EPOS Studio, LabVIEW, MATLAB
    (v4, v5). Extras bring more, ``[formats]`` HDF5 and MATLAB 7.3, ``[formats-lgpl]`` TDMS and MDF. Delimiter,
    decimal mark, header, comments and units in the header of a text are found automatically.

    `Recording.notes` lists repairs and assumptions: single missing samples and values are interpolated, rows written
    twice are left out, time stamps rounded to a coarse last digit are read as uniform. No such repair may concern more
    than 1 % of the samples. The longest stretch without a hole in the time is read; `read_stretches` reads all of
    them. Steps that differ by more than 10 % and channels with several clocks are interpolated, and the note says what
    that costs. A channel that never changes is noted, not refused.

    Parameters
    ----------
    path : str or Path
        File to read.
    input : str
        Column of the input: torque, force, voltage, current. Columns of a file without header are called
        ``1``, ``2``, ...; a whole number that is no column's name counts the columns in any file.
    outputs : str or sequence of str or of (name, kind)
        Columns of the motion with their kind, ``name:kind``. Kinds are position, velocity,
        velocity-differenced (made by differencing an encoder), speed (a magnitude without sign) and acceleration. A
        kind that is not given follows from the unit or the name. A sensor at another mass than the first is
        ``load:velocity@2``, or ``("load", "velocity@2")``.
    time : str, optional
        Column of the time; by default the column called t, time, time_s, Time [ms] or the like.
    dt : float, optional
        Sampling interval in s, instead of a time column.
    input_gain : float
        Factor between the recorded input and its unit, e.g. the force constant in N/V with the unit N.
    actuator : int
        Mass that the input acts on, counted along the drive train. Outputs without ``@`` are at mass 1 all the same.
    units : mapping of str to str
        Units by column, e.g. ``{"torque": "mN m", "speed": "rpm"}``; they replace those in the header.
        Without any unit SI is assumed: N m and rad, or N and m if another column has a unit of length or force.
    window : (float or None, float or None), optional
        Start and end in s of the recording's time, both included. Samples outside are not checked.
    decimate : int
        Keep one sample in so many, see :func:`brightgrey.recordings.decimate`.
    hold : {'linear', 'zoh'}
        Course of the input between two samples.
    rated : mapping of str to str, optional
        Value of 100 % with its unit, by column or by quantity, for columns in %: ``{"torque": "9.84 mN m"}``.
    counts : mapping of str to float, optional
        Increments per turn, by column, for columns that count the increments of an encoder.
    gear : mapping of str to float, optional
        Factor of an output, by column, e.g. the ratio that turns an angle at the load into one at the motor.
    torque_constant : str, optional
        Torque or force per current for an input in A: ``"0.05 N m/A"``.
    shift : mapping of str to float, optional
        Time in s that is added to the time stamps of a column, by column: -0.003 if a clock is 3 ms late. The column
        is interpolated at the instants of the others.
    delimiter, decimal, header : optional
        Delimiter of a text file (a space means any white space), decimal mark, and True if there is a header.
        Those that are not given are found automatically.
    beside : sequence of str or Path, optional
        Further files with channels of this recording. Their columns are called ``FILE.COLUMN``, with the name of the
        file without its ending. They have the time of their file, or the rows of the first one.

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
    arguments = dict(locals())
    table, asked = _opened(arguments)
    return replace(_make_recording(table, asked), source=_source(arguments))


def _opened(arguments: Mapping[str, Any]) -> tuple[Table, ReadingOptions]:
    """Open the file that these arguments of `read_recording` name."""
    text = {name: arguments[name] for name in ("delimiter", "decimal", "header")}
    table = open_together(arguments["path"], arguments["beside"], arguments["input"], **text)
    scales = DriveScales(*(arguments[name] for name in ("rated", "counts", "gear", "torque_constant")))
    own = [f.name for f in fields(ReadingOptions) if f.name != "scales"]
    return table, ReadingOptions(**{name: arguments[name] for name in own}, scales=scales)


def _source(arguments: dict[str, Any]) -> Source:
    """Source of a recording that was read with these arguments of `read_recording`."""
    path = Path(arguments.pop("path"))
    declared = inspect.signature(read_recording).parameters
    given = {name: value for name, value in arguments.items() if value != declared[name].default}
    content = hashlib.sha256()
    for each in (path, *arguments["beside"]):
        with Path(each).open("rb") as file:
            while block := file.read(1 << 20):
                content.update(block)
    return Source(str(path), content.hexdigest(), {n: _plain(v) for n, v in given.items()})


def _plain(value: Any) -> Any:
    """Return an argument with lists for tuples, dicts for mappings and texts for paths, as JSON gives it back."""
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def read_stretches(path: str | Path, **options: Any) -> tuple[Recording, ...]:
    """Read the stretches of a recording that lie between holes in its time, each as a recording of its own.

    An identification of several recordings gives each its own initial state. Stretches with less than 2 % of the
    samples are left out. Without holes, and for channels of several clocks, it is what `read_recording` reads.

    Parameters
    ----------
    path : str or Path
    options
        Those of `read_recording`.

    Returns
    -------
    tuple of Recording
        In the order of time. The name of each says its time if there are several.

    Raises
    ------
    RecordingError, SettingsError
        As `read_recording`.
    """
    arguments = bind_checked(read_recording, path, **options)
    table, asked = _opened(arguments)
    windows, note = _stretches(table, asked)
    if len(windows) < 2:
        return (replace(_make_recording(table, asked), source=_source(arguments)),)
    found = []
    for number, (start, end) in enumerate(windows, 1):
        made = _make_recording(table, replace(asked, window=(start, end)))
        said = (
            f"stretch {number} of {len(windows)}, from {start:.6g} to {end:.6g} s, with its own initial state; {note}"
        )
        name = f"{made.name} {start:.6g}:{end:.6g}"
        source = _source({**arguments, "window": (start, end)})
        found.append(replace(made, name=name, notes=(*made.notes, said), source=source))
    return tuple(found)


def _stretches(table: Table, options: ReadingOptions) -> tuple[list[tuple[float, float]], str]:
    """Return the windows of the stretches between holes, in s, and a note on the holes.

    There is no window if the channels have several clocks or none. Nor is there one if the stretches that are long
    enough do not have half of the samples: then the steps are not equal at all.
    """
    choice = choose_columns(table, options)
    if len(set(choice.times)) != 1:
        return [], ""
    t = table.load([choice.times[0]])[0] * choice.time_factors[0]
    t = t[np.isfinite(t)]
    t = t[inside(t, options.window)]
    if t.size < READING.min_samples:  # which `read_recording` refuses
        return [], ""
    edges = stretch_edges(t)
    sizes = np.diff(edges)
    kept = np.flatnonzero(sizes >= max(READING.min_samples, READING.least_part * t.size))
    left = t.size - int(sizes[kept].sum())
    if left > (1.0 - READING.least_stretch) * t.size:
        return [], ""
    windows = [(float(t[edges[i]]), float(t[edges[i + 1] - 1])) for i in kept]
    note = f"{sizes.size - 1} hole{'s' if sizes.size > 2 else ''} in the time, the longest of {np.diff(t).max():.4g} s"
    return windows, note + (f", {left} samples in shorter stretches are left out" if left else "")


def read_again(source: Source, path: str | Path | None = None) -> Recording:
    """Read a recording as it was read before.

    Parameters
    ----------
    source : Source
    path : str or Path, optional
        Where the file is now; that of `source` by default.

    Raises
    ------
    RecordingError
        If the file cannot be read, or its content is another one.
    """
    options = dict(source.options)
    if not isinstance(options["outputs"], str):
        options["outputs"] = [tuple(o) if isinstance(o, list) else o for o in options["outputs"]]
    if "window" in options:
        options["window"] = tuple(options["window"])
    recording = read_recording(path or source.path, **options)
    if recording.source is None or recording.source.sha256 != source.sha256:
        raise RecordingError(f"{path or source.path}: the file is not the one that was identified; its content differs")
    return recording


@checked_arguments
def recording_from(
    columns: Mapping[str, Any],
    *,
    input: str,
    outputs: str | Sequence[OutputColumn],
    time: str | None = None,
    dt: float | None = None,
    input_gain: float = 1.0,
    actuator: int = 1,
    units: Mapping[str, str] = NOT_GIVEN,
    window: TimeWindow | None = None,
    decimate: int = 1,
    hold: str = "linear",
    rated: Mapping[str, str] = NOT_GIVEN,
    counts: Mapping[str, float] = NOT_GIVEN,
    gear: Mapping[str, float] = NOT_GIVEN,
    torque_constant: str | None = None,
    shift: Mapping[str, float] = NOT_GIVEN,
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
    arrays, clocks = [], []
    for key in columns:
        array, is_clock = _channel_of(columns[key], f"{name}: column '{key}'")
        arrays.append(array)
        clocks.append(is_clock)
    lengths = {array.size for array in arrays}
    if len(lengths) != 1:
        raise RecordingError(f"{name}: columns must have one length, these have {sorted(lengths)}")
    table = Table(
        name,
        tuple(
            Column(str(key), str(key), "s" if is_clock else None, clock_time=is_clock)
            for key, is_clock in zip(columns, clocks, strict=True)
        ),
        np.arange(1, lengths.pop() + 1),
        lambda indices: np.array([arrays[i] for i in indices]),
    )
    scales = DriveScales(rated, counts, gear, torque_constant)
    options = ReadingOptions(
        input, outputs, time, dt, input_gain, actuator, units, window, decimate, hold, scales, shift
    )
    return _make_recording(table, options)


def _channel_of(given: Any, where: str) -> tuple[Array, bool]:
    """Return the numbers of a channel, and whether they were dates or times, which are seconds from the first one.

    Raises
    ------
    RecordingError
        That begins with `where`, for anything but real numbers of shape (samples,).
    """
    array = np.asarray(given)
    if array.ndim != 1:
        advice = "give x.ravel()" if array.size in array.shape else "give each of its columns a name of its own"
        raise RecordingError(f"{where}: numbers of shape (samples,) are expected, {array.shape} came; {advice}")
    if array.dtype.kind in "mM":
        steps = (array - array[:1]).astype("timedelta64[ns]")
        return np.where(np.isnat(steps), np.nan, steps.astype(np.int64) * 1e-9), True
    try:
        if array.dtype.kind == "c":
            raise TypeError("complex numbers")
        return array.astype(np.float64), False
    except (TypeError, ValueError, OverflowError) as error:
        raise RecordingError(f"{where}: real numbers are expected ({error})") from None


def _make_recording(table: Table, options: ReadingOptions) -> Recording:
    """Make a recording of a table."""
    check_window(options.window)
    check_decimate(options.decimate)
    hold = check_hold(options.hold)
    choice = choose_columns(table, options)
    samples = sample(table, choice, options, hold)
    # From the recorded number to the shown unit, and from there to SI.
    factors = np.array([signal.gain / signal.factor for signal in choice.signals])
    with np.errstate(over="ignore"):  # the recording refuses what is not finite
        values = samples.values * factors[:, None]
    recording = Recording(
        name=table.name,
        t=samples.t,
        u=values[0],
        y=values[1:],
        input=choice.signals[0],
        outputs=choice.signals[1:],
        hold=hold,
        notes=(
            *table.notes,
            *choice.notes,
            *samples.notes,
            *_many(samples, options),
        ),
        resolution=(samples.resolution * np.abs(factors))[1:],
    )
    for signal, row in zip(recording.outputs, recording.y, strict=True):
        _check_sign(recording.name, signal, row)
    return decimate(recording, options.decimate)


def _check_sign(name: str, signal: Signal, values: Array) -> None:
    """Refuse a speed without sign that is negative by more than the noise of a sensor.

    That holds for a whole recording. A part in which the drive rests is negative half of the time.
    """
    least, largest = float(values.min()), float(np.abs(values).max())
    if signal.kind == "speed" and least < -READING.negative_speed * largest:
        part = 100.0 * float(np.mean(values < 0.0))
        sensor = signal.sensor.replace("speed", "velocity")
        raise RecordingError(
            f"{name}: '{signal.name}' is taken as a speed without sign, and {part:.0f} % of its samples are negative,"
            f" down to {least * signal.factor:.4g} {signal.unit}; name it {signal.name}:{sensor}"
        )


def _many(samples: Samples, options: ReadingOptions) -> list[str]:
    """Note that a recording has more samples than an identification needs."""
    kept = samples.t.size // options.decimate
    if kept <= READING.many_samples:
        return []
    every = options.decimate * -(-kept // READING.enough_samples)
    return [f"{kept} samples make an identification slow; decimate by {every} keeps {samples.t.size // every} of them"]
