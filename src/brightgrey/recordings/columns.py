"""Which columns of a table are time, input and outputs, and in which units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from brightgrey.errors import RecordingError, SettingsError
from brightgrey.recordings.formats.table import Table
from brightgrey.recordings.recording import Signal
from brightgrey.recordings.units.parser import Unit, is_unit, parse_unit
from brightgrey.recordings.units.signals import assumed_unit, base_of, check_kind, fits, kind_of

__all__ = ["Choice", "Output", "choose"]

# "name:kind", "name" (its kind is taken from its unit or its name), or (name, kind)
Output = str | tuple[str, str]

TIME_NAME = re.compile(
    r"(t|time|zeit|time[_ ]?stamps?|(sim(ulation)?|elapsed|rel(ative)?)[_ ]?time)"
    r"([_ ](?P<unit>s|sec|seconds?|ms|us|µs|min))?",
    re.IGNORECASE,
)
KIND_NAMES = {
    "position": re.compile(r"pos|angle|winkel|lage|weg", re.IGNORECASE),
    "velocity": re.compile(r"vel|speed|drehzahl|geschw|omega", re.IGNORECASE),
    "acceleration": re.compile(r"acc|beschl", re.IGNORECASE),
}
UNIT_IN_NAME = re.compile(r".*?_(?:in_)?([A-Za-zµ%]+(?:_per_[A-Za-z]+2?)?)")
DRIVING = {"N m": "a torque", "N": "a force", "V": "a voltage", "A": "a current"}


@dataclass(frozen=True)
class Choice:
    """Columns of a table and what they mean.

    Attributes
    ----------
    input : int
        Column of the input.
    outputs : tuple of int
        Columns of the outputs.
    time : int or None
        Column of the time; None if the sampling interval is given.
    time_factor : float
        Seconds per unit of the time's column.
    signals : tuple of Signal
        Input first.
    notes : tuple of str
        Assumptions.
    """

    input: int
    outputs: tuple[int, ...]
    time: int | None
    time_factor: float
    signals: tuple[Signal, ...]
    notes: tuple[str, ...]


def choose(
    table: Table,
    *,
    input: str,
    outputs: Sequence[Output],
    time: str | None,
    dt: float | None,
    input_gain: float,
    units: Mapping[str, str],
) -> Choice:
    """Find the columns that the user means, their kinds and their units.

    Where no unit is given, SI is assumed: rad, or m if another output has a length or the input is a force; N
    m, or N with a length. The parameters are those of `read_recording`.

    Raises
    ------
    RecordingError
        For a missing column, an unknown unit or kind, or units that do not fit.
    SettingsError
        For options that contradict each other.
    """
    if not (math.isfinite(input_gain) and input_gain != 0):
        raise SettingsError(f"input gain {input_gain:g} is not a finite number other than zero")
    u = table.find(input)
    named = [_output(table, output) for output in outputs]
    if not named:
        raise SettingsError("no output is named; at least one is needed, e.g. velocity:velocity")
    given = _given_units(table, units)
    chosen = [u, *(i for i, _ in named)]
    t, notes = _time(table, time, dt, chosen)
    everything = [*chosen, t]
    for i in everything:
        if i is not None and everything.count(i) > 1:
            raise table.fault(f"column '{table.columns[i].name}' is named twice among input, outputs and time")
    kinds = []
    for i, kind in named:
        found, why = (kind, "") if kind else _guess_kind(table.columns[i].name, given.get(i))
        kinds.append(found)
        notes += [f"output '{table.columns[i].name}' is taken as {found}{why}"] if why else []
    signals = _signals(table, chosen, kinds, given, input_gain)
    assumed = [f"'{s.name}' in {s.unit}{_hint(s)}" for s in signals if not s.unit_given]
    factor = 1.0
    if t is not None:
        factor, remark = _time_unit(table, t, given.get(t))
        assumed += [remark] if remark else []
    notes += [f"no unit is given; assumed: {', '.join(assumed)}"] if assumed else []
    notes += _doubts(signals[0])
    unused = [name for name in units if table.find(name) not in everything]
    notes += [f"the unit of '{name}' is not used" for name in unused]
    return Choice(u, tuple(chosen[1:]), t, factor, signals, tuple(notes))


def _output(table: Table, output: Output) -> tuple[int, str]:
    """Column and kind of an output; the kind is empty if it is not given."""
    if not isinstance(output, str):
        name, kind = output
        check_kind(kind)
        return table.find(name), kind
    name, colon, kind = output.rpartition(":")
    if not colon or table.matches(output):  # a colon may be part of a column's name
        return table.find(output), ""
    column = table.find(name)
    check_kind(kind)
    return column, kind


def _given_units(table: Table, units: Mapping[str, str]) -> dict[int, Unit | RecordingError]:
    """Units by column, the user's before the file's; where the file's is not known, the error for it."""
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


def _unit(given: Unit | RecordingError | None) -> Unit | None:
    if isinstance(given, RecordingError):
        raise given
    return given


def _time(table: Table, time: str | None, dt: float | None, chosen: Sequence[int]) -> tuple[int | None, list[str]]:
    """Column of the time, by its name if it is not given; None where the interval is given."""
    if time is not None and dt is not None:
        raise SettingsError(f"both the time's column '{time}' and a sampling interval of {dt:g} s are given; give one")
    if time is not None:
        return table.find(time), []
    names = [column.name for column in table.columns]
    found = [i for i, name in enumerate(names) if TIME_NAME.fullmatch(name) and i not in chosen]
    if dt is not None:
        if not (math.isfinite(dt) and dt > 0):
            raise SettingsError(f"sampling interval {dt:g} s is not a positive number")
        return None, [f"the interval is given, the time in column '{names[i]}' is not used" for i in found]
    if not found:
        raise table.fault(f"no column is called t or time; name the time's column or give dt. Columns: {table.names()}")
    if len(found) > 1:
        candidates = ", ".join(f"'{names[i]}' (field {i + 1})" for i in found)
        raise table.fault(f"columns {candidates} can all be the time; name the right one")
    return found[0], []


def _guess_kind(name: str, given: Unit | RecordingError | None) -> tuple[str, str]:
    """Kind of an output and why: its unit, its name, or that most drives are recorded by velocity."""
    unit = _unit(given)
    if unit is not None and (kind := kind_of(unit)):
        return kind, ""
    for kind, pattern in KIND_NAMES.items():
        if pattern.search(name):
            return kind, ", by its name"
    return "velocity", " (neither a unit nor the name says what it is)"


def _time_unit(table: Table, index: int, given: Unit | RecordingError | None) -> tuple[float, str]:
    """Seconds per unit of the time's column, and a remark if neither unit nor name says that it is in s."""
    column = table.columns[index]
    unit = _unit(given)
    if unit is not None:
        if unit.dimension != (("[time]", 1),):
            raise table.fault(f"unit '{unit.text}' is not one of time, e.g. s, ms, µs, min", column=column.name)
        return unit.si, ""
    match = TIME_NAME.fullmatch(column.name)
    text = (match and match["unit"]) or ""
    unit = parse_unit(text.lower() or "s")
    if unit.si == 1.0:
        return 1.0, "" if text else f"'{column.name}' in s"
    return unit.si, f"'{column.name}' in {unit.text} (its name says so)"


def _signals(
    table: Table,
    chosen: Sequence[int],
    kinds: Sequence[str],
    given: Mapping[int, Unit | RecordingError],
    input_gain: float,
) -> tuple[Signal, ...]:
    """Signals of the chosen columns, input first."""
    names = [table.columns[i].name for i in chosen]
    u, *outputs = [_unit(given.get(i)) for i in chosen]
    bases: dict[str, str] = {}
    for name, kind, unit in zip(names[1:], kinds, outputs, strict=True):
        if unit is not None:
            base = base_of(unit, kind)
            if base is None:
                raise table.fault(
                    f"unit '{unit.text}' does not fit an output of kind {kind}, which has {fits(kind)}",
                    column=name,
                )
            bases.setdefault(base, name)
    if len(bases) > 1:
        raise table.fault(f"'{bases['rad']}' is an angle and '{bases['m']}' a length; outputs must all be one of them")
    base = next(iter(bases), "m" if u is not None and u.dimension == parse_unit("N").dimension else "rad")
    assumed = ["N" if base == "m" else "N m", *(assumed_unit(kind, base) for kind in kinds)]
    return tuple(
        Signal(name, kind, unit.text if unit else guess, gain, unit is not None)
        for name, kind, unit, guess, gain in zip(
            names, ("input", *kinds), (u, *outputs), assumed, (input_gain, *[1.0] * len(kinds)), strict=True
        )
    )


def _doubts(signal: Signal) -> list[str]:
    """Note if the input is a motion."""
    if kind_of(parse_unit(signal.unit)) is None:
        return []
    return [f"input '{signal.name}' in {signal.unit} is a motion; models expect {', '.join(DRIVING.values())}"]


def _hint(signal: Signal) -> str:
    """Remark where the name of a column ends on a unit other than the assumed one."""
    match = UNIT_IN_NAME.fullmatch(signal.name)
    if not match or not is_unit(match[1]):
        return ""
    unit = parse_unit(match[1])
    drives = [parse_unit(text).dimension for text in DRIVING]
    plausible = unit.dimension in drives if signal.kind == "input" else base_of(unit, signal.kind)
    if not plausible or unit.text == signal.unit:
        return ""
    return f" (its name says {unit.text}: if so, give the unit {signal.name}={unit.text})"
