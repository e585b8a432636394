"""Choice of the columns of a table: time, input and outputs, with their kinds and units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from brightgrey.errors import RecordingError, SettingsError
from brightgrey.recordings.formats.table import TIME_NAME, Table
from brightgrey.recordings.policy import READING
from brightgrey.recordings.recording import Signal
from brightgrey.recordings.units.drive_scales import DriveScales, check_names, rated_hint
from brightgrey.recordings.units.parser import Unit, is_unit, parse_unit
from brightgrey.recordings.units.signals import KINDS, assumed_unit, base_of, check_kind, fits, kind_of
from brightgrey.recordings.window import TimeWindow

__all__ = ["MODELS_EXPECT", "NAME_SAYS", "ColumnChoice", "OutputColumn", "ReadingOptions", "choose_columns"]

# "name:kind", "name:kind@mass", "name" (its kind follows from its unit or its name), or (name, kind)
OutputColumn = str | tuple[str, str]

KIND_NAMES = {
    "position": re.compile(r"pos|angle|winkel|lage|weg", re.IGNORECASE),
    "velocity": re.compile(r"vel|speed|drehzahl|geschw|omega", re.IGNORECASE),
    "acceleration": re.compile(r"acc|beschl", re.IGNORECASE),
}
UNIT_IN_NAME = re.compile(r".*?_(?:in_)?([A-Za-zµ%]+(?:_per_[A-Za-z]+2?)?)")
DRIVING = ("N m", "N", "V", "A")
NAME_SAYS, MODELS_EXPECT = "its name says", "models expect"
"""Words of notes that are likely to mean a fault."""


@dataclass(frozen=True)
class ReadingOptions:
    """Options that files and arrays in memory share; see :func:`brightgrey.read_recording`."""

    input: str
    outputs: str | Sequence[OutputColumn]
    time: str | None
    dt: float | None
    input_gain: float
    actuator: int
    units: Mapping[str, str]
    window: TimeWindow | None
    decimate: int
    hold: str
    scales: DriveScales = field(default_factory=DriveScales)
    shift: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ColumnChoice:
    """Columns of a table and their meaning."""

    input: int  #: Column of the input.
    outputs: tuple[int, ...]  #: Columns of the outputs.
    times: tuple[int, ...]  #: Column of the time of each, input first; empty if the sampling interval is given.
    time_factors: tuple[float, ...]  #: Seconds per unit of these columns.
    signals: tuple[Signal, ...]  #: Input first.
    shifts: tuple[float, ...]  #: Time in s that is added to the stamps of each, input first.
    notes: tuple[str, ...]  #: Assumptions.


def choose_columns(table: Table, options: ReadingOptions) -> ColumnChoice:
    """Find the columns that the user means, their kinds and their units.

    Where no unit is given, SI is assumed: rad, or m if another output has a length or the input is a force; N
    m, or N with a length.

    Raises
    ------
    RecordingError
        For a missing column, an unknown unit or kind, or units that do not fit.
    SettingsError
        For options that contradict each other.
    """
    input_gain, outputs = options.input_gain, options.outputs
    if not (math.isfinite(input_gain) and input_gain != 0):
        raise SettingsError(f"input gain {input_gain:g} is not a finite number other than zero")
    u = table.find(options.input)
    named = [_find_output(table, output) for output in ([outputs] if isinstance(outputs, str) else outputs)]
    if not named:
        raise SettingsError("no output is named; at least one is needed, e.g. velocity:velocity")
    given = _given_units(table, options.units)
    check_names(options.scales, [column.name for column in table.columns], table.matches)
    chosen = [u, *(i for i, _, _ in named)]
    times, notes = _find_times(table, options, chosen)
    everything = [*chosen, *dict.fromkeys(times)]
    for i in everything:
        if everything.count(i) > 1:
            raise table.fault(f"column '{table.columns[i].name}' is named twice among input, outputs and time")
    kinds = []
    for i, kind, _ in named:
        found, reason = (kind, "") if kind else _guess_kind(table.columns[i].name, given.get(i))
        kinds.append(found)
        notes += [f"output '{table.columns[i].name}' is taken as {found}{reason}"] if reason else []
    signals = _chosen_signals(table, chosen, kinds, given, options)
    masses = (options.actuator, *(mass for _, _, mass in named))
    signals = tuple(replace(signal, mass=mass) for signal, mass in zip(signals, masses, strict=True))
    assumed = [f"'{s.name}' in {s.unit}{_unit_in_name(s)}" for s in signals if not s.unit_given]
    factors = {}
    for t in dict.fromkeys(times):
        factors[t], remark = _time_unit(table, t, given.get(t))
        assumed += [remark] if remark else []
    notes += [f"no unit is given; assumed: {', '.join(assumed)}"] if assumed else []
    notes += _notes_on_input(signals[0])
    notes += _contradictions(
        table, options.units, {table.columns[i].name: kind for (i, _, _), kind in zip(named, kinds, strict=True)}
    )
    unused = [name for name in options.units if table.find(name) not in everything]
    notes += [f"the unit of '{name}' is not used" for name in unused]
    shifts, more = _shifts(table, options.shift, chosen)
    return ColumnChoice(u, tuple(chosen[1:]), times, tuple(factors[t] for t in times), signals, shifts, (*notes, *more))


def _shifts(table: Table, given: Mapping[str, float], chosen: Sequence[int]) -> tuple[tuple[float, ...], list[str]]:
    """Return the shift of each chosen column in s, with a note for each that is not zero."""
    found, notes = dict.fromkeys(chosen, 0.0), []
    for name, seconds in given.items():
        if not math.isfinite(seconds):
            raise SettingsError(f"shift {name} {seconds:g} is not a finite time in s")
        i = table.find(name)
        if i in found:
            found[i] = seconds
            notes.append(
                f"'{name}' is taken {abs(seconds):.6g} s {'earlier' if seconds < 0 else 'later'} than recorded"
            )
        else:
            notes.append(f"the shift of '{name}' is not used")
    return tuple(found[i] for i in chosen), notes


def _find_output(table: Table, output: OutputColumn) -> tuple[int, str, int]:
    """Return column, kind and mass of an output; the kind is empty if it is not given."""
    if not isinstance(output, str):
        name, sensor = output
        return table.find(name), *_kind_and_mass(sensor)
    name, colon, sensor = output.rpartition(":")
    if not colon or table.matches(output):  # a colon may be part of a column's name
        return table.find(output), "", 1
    return table.find(name), *_kind_and_mass(sensor)


def _kind_and_mass(sensor: str) -> tuple[str, int]:
    """Kind and mass of ``velocity@2``; the mass is 1 where none is given."""
    kind, at, mass = sensor.partition("@")
    if at and not (mass.isdecimal() and int(mass) >= 1):
        raise RecordingError(
            f"'{sensor}': '{mass}' is no mass, counted from the motor; velocity@2 is at the second one"
        )
    return check_kind(kind), int(mass or 1)


def _given_units(table: Table, units: Mapping[str, str]) -> dict[int, Unit | RecordingError]:
    """Return units by column, the user's before the file's, and an error for an unknown unit of the file."""
    for name, unit in units.items():
        if is_unit(name) and table.matches(unit) and not table.matches(name):
            raise SettingsError(f"unit '{name}={unit}': the column comes first, write '{unit}={name}'")
    given: dict[int, Unit | RecordingError] = {}
    for i, column in enumerate(table.columns):
        if column.unit:
            try:
                given[i] = parse_unit(column.unit)
            except RecordingError as error:
                given[i] = table.fault(str(error), column=column.name)
    for name, unit in units.items():
        given[table.find(name)] = parse_unit(unit)
    return given


def _known_unit(given: Unit | RecordingError | None) -> Unit | None:
    """Return the unit, or raise the error that reading it gave."""
    if isinstance(given, RecordingError):
        raise given
    return given


def _find_times(table: Table, options: ReadingOptions, chosen: Sequence[int]) -> tuple[tuple[int, ...], list[str]]:
    """Return the column of the time of each chosen column, none if the interval is given.

    A time that is not given is the channels' own one, or the column that is called a time.
    """
    time, dt = options.time, options.dt
    if time is not None and dt is not None:
        raise SettingsError(f"both the time's column '{time}' and a sampling interval of {dt:g} s are given; give one")
    if time is not None:
        return (table.find(time),) * len(chosen), []
    found = _time_columns(table, chosen)
    if dt is not None:
        if not 1.0 / READING.absurd < dt < READING.absurd:
            raise SettingsError(f"sampling interval {dt:g} s is not a positive number of a possible size")
        names = [table.columns[i].name for i in found]
        times = [f"the time in column '{name}'" if name else "that of the file" for name in names]
        return (), [f"the interval is given, {time} is not used" for time in times]
    own = [table.columns[i].clock for i in chosen]
    if clocks := tuple(clock for clock in own if clock is not None):
        if len(clocks) == len(chosen):
            return clocks, []
        without = table.columns[chosen[own.index(None)]].name
        raise table.fault(
            "it has no time of its own, as others have; name the time by --time, or give the interval by --dt",
            column=without,
        )
    taken = [table.columns[i].name for i in chosen if TIME_NAME.fullmatch(table.columns[i].name)]
    if not found and taken:
        raise table.fault(
            f"column '{taken[0]}' is input or output here, and no other one is the time; name it by --time,"
            " or give the interval by --dt"
        )
    if not found:
        raise table.fault(
            "no column is called t or time, or has a unit of time; name it by --time, or give the interval by --dt."
            f" Columns: {table.names()}"
        )
    if len(found) > 1:
        candidates = ", ".join(f"'{table.columns[i].name}' (field {i + 1})" for i in found)
        raise table.fault(f"columns {candidates} can all be the time; name the right one")
    return (found[0],) * len(chosen), []


def _time_columns(table: Table, chosen: Sequence[int]) -> list[int]:
    """Return the columns that may be the time: by their names, else those of clock times, else by their units."""
    named = [i for i, c in enumerate(table.columns) if TIME_NAME.fullmatch(c.name) and i not in chosen]
    numbers = [i for i in named if not table.columns[i].clock_time]
    clocks = [i for i, c in enumerate(table.columns) if c.clock_time and i not in chosen]
    return numbers or clocks or [i for i, c in enumerate(table.columns) if c.is_in_time and i not in chosen]


def _guess_kind(name: str, given: Unit | RecordingError | None) -> tuple[str, str]:
    """Guess the kind of an output from its unit or its name, else velocity; return it with the reason."""
    unit = _known_unit(given)
    if unit is not None and (kind := kind_of(unit)):
        return kind, ""
    for kind, pattern in KIND_NAMES.items():
        if pattern.search(name):
            return kind, ", by its name"
    return "velocity", " (neither a unit nor the name says what it is)"


def _time_unit(table: Table, index: int, given: Unit | RecordingError | None) -> tuple[float, str]:
    """Return the seconds per unit of the time, and a remark if neither its unit nor its name says s."""
    column = table.columns[index]
    if column.clock_time:
        return 1.0, ""
    unit = _known_unit(given)
    if unit is not None:
        if unit.dimension != (("[time]", 1),):
            raise table.fault(f"unit '{unit.text}' is not one of time, e.g. s, ms, µs, min", column=column.name)
        return unit.si, ""
    text, why = column.time_unit()
    unit = parse_unit(text)
    if unit.si == 1.0:
        return 1.0, "" if why else f"'{column.name}' in s"
    return unit.si, f"'{column.name}' in {unit.text} ({why})"


def _chosen_signals(
    table: Table,
    chosen: Sequence[int],
    kinds: Sequence[str],
    given: Mapping[int, Unit | RecordingError],
    options: ReadingOptions,
) -> tuple[Signal, ...]:
    """Return the signals of the chosen columns, input first."""
    names = [table.columns[i].name for i in chosen]
    scaled = [
        options.scales.of(
            name,
            kind,
            _known_unit(given.get(i)),
            [key for key in options.scales.names() if table.matches(key) == [i]],
            _other_than_current(name, kind),
        )
        for i, name, kind in zip(chosen, names, ("input", *kinds), strict=True)
    ]
    u, *outputs = [found.unit for found in scaled]
    bases: dict[str, str] = {}
    for name, kind, unit in zip(names[1:], kinds, outputs, strict=True):
        if unit is not None:
            base = base_of(unit, kind)
            if base is None:
                raise table.fault(_misfit(name, kind, unit), column=name)
            bases.setdefault(base, name)
    if len(bases) > 1:
        raise table.fault(f"'{bases['rad']}' is an angle and '{bases['m']}' a length; outputs must all be one of them")
    base = next(iter(bases), "m" if u is not None and u.dimension == parse_unit("N").dimension else "rad")
    assumed = ["N" if base == "m" else "N m", *(assumed_unit(kind, base) for kind in kinds)]
    gains = [found.gain for found in scaled]
    gains[0] *= options.input_gain
    return tuple(
        Signal(name, kind, unit.text if unit else guess, gain, unit is not None)
        for name, kind, unit, guess, gain in zip(names, ("input", *kinds), (u, *outputs), assumed, gains, strict=True)
    )


def _misfit(name: str, kind: str, unit: Unit) -> str:
    """Return the fault of an output whose unit is not that of its kind, with the option that mends it."""
    if unit.is_part:
        return f"it is in {unit.text} of a rated value; {rated_hint(name, kind)}"
    if ("[count]", 1) in unit.dimension:
        return f"it is in increments; say how many make a turn: --counts '{name}=4096'"
    return f"unit '{unit.text}' does not fit an output of kind {kind}, which has {fits(kind)}"


def _notes_on_input(signal: Signal) -> list[str]:
    """Return a note if the input is a motion, or a part of a value that is not known."""
    unit = parse_unit(signal.unit)
    if unit.is_part:
        return [
            f"input '{signal.name}' is in {unit.text} and so are the parameters; {rated_hint(signal.name, 'input')}"
        ]
    if kind_of(unit) is None and unit.dimension != parse_unit("W").dimension:
        return []
    what = "power" if kind_of(unit) is None else "motion"
    return [f"input '{signal.name}' in {signal.unit} is a {what}; {MODELS_EXPECT} a torque, force, voltage or current"]


def _contradictions(table: Table, units: Mapping[str, str], kinds: Mapping[str, str]) -> list[str]:
    """Return notes on units that differ from those of the file, and on kinds that differ from a column's name."""
    notes = []
    for name, text in units.items():
        column = table.columns[table.find(name)]
        if column.unit and is_unit(column.unit) and parse_unit(column.unit).text != parse_unit(text).text:
            notes.append(f"'{name}' is in {column.unit} by the file, and is read in {parse_unit(text).text} as given")
    for name, kind in kinds.items():
        said = next((known for known, pattern in KIND_NAMES.items() if pattern.search(name)), None)
        if said and KINDS[said] != KINDS[kind]:
            notes.append(f"output '{name}' is read as {kind}, though its name says {said}")
    return notes


def _unit_in_name(signal: Signal) -> str:
    """Return a remark if the name of a column ends in a unit other than the assumed one."""
    unit = _written_unit(signal.name, signal.kind)
    if unit is None or unit.text == signal.unit:
        return ""
    return f" ({NAME_SAYS} {unit.text}: if so, give the unit {signal.name}={unit.text})"


def _other_than_current(name: str, kind: str) -> str:
    """Return the unit that the name of an input ends in unless it is one of a current."""
    unit = _written_unit(name, kind)
    return "" if unit is None or unit.dimension == parse_unit("A").dimension else unit.text


def _written_unit(name: str, kind: str) -> Unit | None:
    """Return the unit that the name of an input or of an output of this `kind` ends in, None without a possible one."""
    match = UNIT_IN_NAME.fullmatch(name)
    if not match or not is_unit(match[1]):
        return None
    unit = parse_unit(match[1])
    drives = [parse_unit(text).dimension for text in DRIVING]
    return unit if (unit.dimension in drives if kind == "input" else base_of(unit, kind)) else None
