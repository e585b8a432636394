"""Suggestion of an identification: which channels of a file are its input, its output and its time."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.formats.table import TIME_NAME, Table
from brightgrey.recordings.inspection.meaning import DRIVING, MOTIONS, UNITS, Meaning, index_of, stem_of, unit_in_name
from brightgrey.recordings.inspection.profile import ChannelProfile
from brightgrey.recordings.inspection.relations import explained_by_motion, is_even_time, on_one_time
from brightgrey.recordings.policy import INSPECTION, READING
from brightgrey.recordings.units.parser import is_unit, parse_unit
from brightgrey.recordings.units.signals import assumed_unit, base_of

__all__ = ["ReadChannels", "Suggestion", "TimeChoice", "find_time", "suggest", "usual_step"]

TIME_LIKE = re.compile(r"(?:^|.*[._\s])(?:t|time|zeit|timestamp)(?:[._\s(].*)?", re.IGNORECASE)


@dataclass(frozen=True)
class TimeChoice:
    """Time of a file: the option that gives it, if one is needed, and the usual step in s."""

    column: int | None = None
    options: Mapping[str, str | float] = field(default_factory=dict)
    dt: float = 1.0
    question: str = ""


@dataclass(frozen=True)
class ReadChannels:
    """Channels of a file with their numbers and meanings, by column."""

    table: Table
    profiles: Mapping[int, ChannelProfile]
    values: Mapping[int, Array]
    meanings: Mapping[int, Meaning]

    def changing(self) -> list[int]:
        """Columns of numbers that change, and are neither a time nor a count of samples."""
        numbers = [i for i, p in self.profiles.items() if not p.constant]
        return [i for i in numbers if self.meanings[i].quantity not in ("time", "count")]

    def together(self, one: int, other: int) -> tuple[Array, Array]:
        """Return two channels row by row, those with clocks of their own at common instants."""
        values = {i: self.values[i] for i in (one, other)}
        clocks = {i: self.table.columns[i].clock for i in values}
        if len({*clocks.values()}) > 1:
            timed = {i: c for i, c in clocks.items() if c is not None and c in self.values}
            times = {i: self.values[c] * _seconds_per_unit(self.table, c) for i, c in timed.items()}
            values = on_one_time(values, times)
        return values[one], values[other]

    def reference(self, column: int) -> str:
        """Return the name of a column for an option, or its number where the name is not its own."""
        name = self.table.columns[column].name
        own = self.table.matches(name) == [column] and not name.startswith("-") and name.isprintable()
        return name if own else str(column + 1)


@dataclass(frozen=True)
class Suggestion:
    """Columns and options of an identification."""

    options: Mapping[str, Any]  #: Arguments of `read_recording`.
    why: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()  #: What the file does not say, each with the option that says it.

    def command(self, path: str) -> str:
        """Return the complete command line."""
        words = ["brightgrey", "identify", path, "--input", self.options["input"], "--output", self.options["outputs"]]
        # What nothing says has a word in place of its number, so that nobody takes the number for granted.
        words += ["--dt", "SECONDS"] if "dt" in self.options else []
        for key, option in (("time", "--time"), ("decimate", "--decimate")):
            if key in self.options:
                words += [option, f"{self.options[key]}"]
        for name, value in self.options.get("units", {}).items():
            words += ["--unit", f"{name}={value}"]
        for name in self.options.get("counts", {}):
            words += ["--counts", f"{name}=COUNTS"]
        return shlex.join(words)


def find_time(table: Table, values: Mapping[int, Array]) -> TimeChoice:
    """Return the time of a file: its channels' own, the column called so, or the one that rises like a time."""
    clocks = [c.clock for c in table.columns if c.clock is not None and c.clock in values]
    if clocks:
        return TimeChoice(None, {}, usual_step(table, clocks[0], values))
    numbers = {i: x for i, x in values.items() if np.isfinite(x).sum() > 2}
    named = [i for i in numbers if TIME_NAME.fullmatch(table.columns[i].name) and not table.columns[i].clock_time]
    broken = [c.name for i, c in enumerate(table.columns) if i not in values and TIME_NAME.fullmatch(c.name)]
    named = named or [i for i in numbers if table.columns[i].clock_time]
    named = named or [i for i in numbers if table.columns[i].is_in_time]
    if len(named) == 1:
        return TimeChoice(named[0], {}, usual_step(table, named[0], values), _ask_time(table, named[0], numbers))
    likely = named or [i for i in numbers if TIME_LIKE.fullmatch(table.columns[i].name)] or list(numbers)
    even = [i for i in likely if is_even_time(numbers[i])]
    even.sort(key=lambda i: _says_no_unit(table, i, numbers))  # a count of samples or ticks comes last
    if even and not _says_no_unit(table, even[0], numbers):
        reference = ReadChannels(table, {}, {}, {}).reference(even[0])
        return TimeChoice(even[0], {"time": reference}, usual_step(table, even[0], values))
    why = f"column '{broken[0]}' is no time" if broken else "the sampling interval is not in the file"
    if even:
        name, step = table.columns[even[0]].name, float(np.median(np.diff(numbers[even[0]])))
        why += f" ('{name}' rises by {step:g} in every row, and no unit says what that is)"
    return TimeChoice(None, {"dt": 1.0}, 1.0, f"{why}: put it in place of SECONDS in --dt")


def _says_no_unit(table: Table, column: int, values: Mapping[int, Array]) -> bool:
    """Return True for whole numbers without a unit of time, which may count samples or ticks of a clock."""
    known = table.columns[column].unit or table.columns[column].time_unit()[1]
    return not known and bool((values[column] == np.rint(values[column])).all())


def _ask_time(table: Table, column: int, values: Mapping[int, Array]) -> str:
    """Return the question for the unit of a time of whole numbers; empty where the file gives it."""
    if table.columns[column].clock_time or not _says_no_unit(table, column, values):
        return ""
    name = ReadChannels(table, {}, {}, {}).reference(column)
    step = float(np.median(np.diff(values[column][np.isfinite(values[column])])))
    return f"steps of {step:g} of '{name}' are taken as s, as no unit is in the file: --unit '{name}=ms' makes them ms"


def usual_step(table: Table, column: int, values: Mapping[int, Array]) -> float:
    """Return the usual step of a time in s."""
    steps = np.diff(values[column][np.isfinite(values[column])])
    return float(np.median(steps[steps > 0])) * _seconds_per_unit(table, column) if (steps > 0).any() else 1.0


def _seconds_per_unit(table: Table, column: int) -> float:
    unit, _ = table.columns[column].time_unit()
    return parse_unit(unit).si if is_unit(unit) else 1.0


def suggest(channels: ReadChannels, time: TimeChoice) -> Suggestion | str:
    """Return the columns that an identification would use, or why there are none.

    The input is a torque or a force, else a current, else a voltage, rather an actual value than a setpoint. The output
    is a motion, rather at the motor than at the load. Among several axes it is the pair with one number in its names
    whose motion explains most of the input. Of those that explain nearly as much it is the one that moves most.
    """
    changing = channels.changing()
    rows, width = channels.table.rows.size, len(channels.table.columns)
    if rows < READING.min_samples and rows < width:
        return f"there are {rows} rows and {width} columns: a channel has to be a column, so turn the table round"
    outputs = _best(changing, lambda i: _output_rank(channels.meanings[i]))
    if not outputs:
        return _lacking(channels, time, "a position or a velocity", "--output NAME:KIND", MOTIONS)
    inputs = _best([i for i in changing if i not in outputs], lambda i: _input_rank(channels.meanings[i]))
    if not inputs:
        return _lacking(channels, time, "a torque, a force, a current or a voltage", "--input NAME", DRIVING)
    pairs = [(u, y) for u in inputs[: INSPECTION.tried] for y in outputs[: INSPECTION.tried]]
    name = {i: channels.table.columns[i].name for i in (*inputs, *outputs)}
    same = [(u, y) for u, y in pairs if index_of(name[u]) == index_of(name[y])]
    quantity = {i: channels.meanings[i].quantity for i in outputs}
    parts = {(u, y): explained_by_motion(*channels.together(u, y), quantity[y], time.dt) for u, y in same or pairs}
    # Several inputs are several axes, of which one that hardly moves says little.
    good = [
        pair
        for pair, part in parts.items()
        if part >= (INSPECTION.nearly if len(inputs) > 1 else 1.0) * max(parts.values())
    ]
    u, y = max(good, key=lambda pair: (round(float(np.nanstd(channels.values[pair[1]])), 12), parts[pair]))
    if len(inputs) == 1:  # of like sensors of one axis the first is nearest to its motor
        most_left = INSPECTION.left_alike * (1.0 - parts[u, y])
        alike = [i for _, i in parts if stem_of(name[i]) == stem_of(name[y]) and 1.0 - parts[u, i] <= most_left]
        y = min((y, *alike), key=lambda i: (len(name[i]), name[i]))
    finer = _finer(channels, y, outputs)
    why = [_because(channels, u, "input"), _because(channels, finer, "output")]
    why.append(f"the motion explains {100 * max(parts[u, y], 0.0):.0f} % of the input's variance")
    options, questions = _options(channels, u, finer, time)
    return Suggestion(options, tuple(why), tuple(question for question in questions if question))


def _lacking(channels: ReadChannels, time: TimeChoice, wanted: str, option: str, quantities: Sequence[str]) -> str:
    """Return what a file lacks, and the options that mend it."""
    dt = ". No column is a time: give the sampling interval by --dt SECONDS" if "dt" in time.options else ""
    return (
        f"no channel looks like {wanted}: name it by {option}. Where it is in a file of its own with the same rows, put"
        f" that beside this one by --beside FILE{dt}{_text_of(channels, quantities)}"
    )


def _text_of(channels: ReadChannels, quantities: Sequence[str]) -> str:
    """Return why channels that are called so do not count: a cell that is no number. Empty if there are none."""
    texts = {i: p.text for i, p in channels.profiles.items() if p.text}
    found = (text for i, text in texts.items() if channels.meanings[i].quantity in quantities)
    fault = next(found, "").partition(": ")[2]
    return f". {fault[:1].upper()}{fault[1:]}" if fault else ""


def _best(columns: Sequence[int], rank: Any) -> list[int]:
    """Return the columns of the best rank; None ranks nowhere."""
    ranks = {i: rank(i) for i in columns}
    best = min((r for r in ranks.values() if r is not None), default=None)
    return [i for i, r in ranks.items() if r is not None and r == best]


def _input_rank(meaning: Meaning) -> float | None:
    if meaning.role == "error" or meaning.quantity not in (*DRIVING, ""):
        return None
    base = {"torque": 0.0, "force": 0.0, "current": 1.0, "voltage": 2.0, "": 9.0}[meaning.quantity]
    return base + 1.5 * (meaning.role == "setpoint") + 0.5 * (meaning.side == "load")


def _output_rank(meaning: Meaning) -> float | None:
    if meaning.role == "error" or meaning.quantity not in MOTIONS:
        return None
    return 2.0 * (meaning.quantity == "acceleration") + 3.0 * (meaning.role == "setpoint") + (meaning.side == "load")


def _finer(channels: ReadChannels, chosen: int, outputs: Sequence[int]) -> int:
    """Return the position of the same axis if it is fine, and the velocity if the position is coarse."""
    name = channels.table.columns[chosen].name
    alike = [i for i in outputs if index_of(channels.table.columns[i].name) == index_of(name)] or [chosen]
    fine = [i for i in alike if channels.profiles[i].levels >= READING.coarse_levels]
    positions = [i for i in fine if channels.meanings[i].quantity == "position"]
    if channels.meanings[chosen].quantity == "position" and chosen in fine:
        return chosen
    return (positions or fine or [chosen])[0] if chosen not in fine or positions else chosen


def _because(channels: ReadChannels, column: int, role: str) -> str:
    meaning = channels.meanings[column]
    what = meaning.words() or "no name says what it is"
    return f"{role} '{channels.table.columns[column].name}': {what}" + (f", {meaning.reason}" if meaning.reason else "")


def _options(channels: ReadChannels, u: int, y: int, time: TimeChoice) -> tuple[dict[str, Any], list[str]]:
    """Return the arguments of `read_recording`, and what has to be asked for."""
    kind = channels.meanings[y].quantity
    name_u, name_y = channels.reference(u), channels.reference(y)
    options: dict[str, Any] = {"input": name_u, "outputs": f"{name_y}:{kind}", **time.options}
    units: dict[str, str] = {}
    questions = [time.question, *_ask_input(channels, u, name_u, units)]
    questions += _ask_output(channels, u, y, name_y, kind, units, options)
    if channels.meanings[u].side == "motor" and channels.meanings[y].side == "load":
        questions.append(f"the output is at the load: --gear '{name_y}=RATIO' brings it to the side of the motor")
    questions.append(_further_sensor(channels, u, y))
    samples = channels.profiles[y].samples
    if samples > READING.many_samples:
        options["decimate"] = -(-samples // READING.enough_samples)
        questions.append(f"{samples} samples are many: --decimate keeps one in {options['decimate']}")
    if units:
        options["units"] = units
    return options, questions


def _further_sensor(channels: ReadChannels, u: int, y: int) -> str:
    """Return how to add a sensor that may be at the second mass: one at the load, or the next number of the output.

    Several inputs are several axes, whose outputs have numbers, too.
    """
    own = channels.table.columns[y].name
    number, stem = index_of(own), stem_of(own)
    one_axis = not any(i != u and channels.meanings[i].quantity in DRIVING for i in channels.changing())
    for i in channels.changing():
        meaning, name = channels.meanings[i], channels.table.columns[i].name
        if i == y or meaning.quantity not in MOTIONS or meaning.role in ("setpoint", "error"):
            continue
        at_load = meaning.side == "load" and channels.meanings[y].side != "load" and index_of(name) == number
        is_next = bool(stem) and number.isdecimal() and (stem_of(name), index_of(name)) == (stem, f"{int(number) + 1}")
        if at_load or (one_axis and is_next):
            reference = channels.reference(i)
            return (
                f"if '{name}' is at the second mass of the same drive, add --output '{reference}:{meaning.quantity}@2'"
                f" (behind a gear also --gear '{reference}=RATIO')"
            )
    return ""


def _ask_input(channels: ReadChannels, u: int, name: str, units: dict[str, str]) -> list[str]:
    """Fill in the unit of the input, and return what is missing."""
    quantity, given = channels.meanings[u].quantity, channels.table.columns[u].unit
    if given and not is_unit(given):
        return [_ask_unit(name, units, UNITS.get(quantity, "N m"), f"unit '{given}' of '{name}' is not known")]
    unit = parse_unit(given).text if given else _fitting_unit(channels.table.columns[u].name, quantity)
    if not given and unit:
        units[name] = unit
    if unit and parse_unit(unit).is_part:
        return [
            f"what 100 % of '{name}' are is not in the file: add --rated '{name}=VALUE UNIT', else results are in"
            f" {unit}"
        ]
    asked = []
    if not unit:
        asked = [_ask_unit(name, units, UNITS.get(quantity, "N m"), f"the unit of '{name}' is not in the file")]
    if quantity == "current":
        asked.append(
            f"'{name}' is a current: --torque-constant 'VALUE N m/A' makes it a torque, else results are per A"
        )
    return asked


def _fitting_unit(name: str, quantity: str) -> str | None:
    """Return the unit that the name of an input ends in, unless it is that of another quantity: ``current_in``."""
    written = unit_in_name(name)
    unit = parse_unit(written) if written else None
    right = unit and (unit.is_part or unit.dimension == parse_unit(UNITS.get(quantity, "1")).dimension)
    return written if right or not quantity else None


def _ask_unit(name: str, units: dict[str, str], unit: str, why: str) -> str:
    """Fill in a unit, and return the question for the right one."""
    units[name] = unit
    return f"{why}: put the right one in place of {unit} in --unit"


def _ask_output(
    channels: ReadChannels, u: int, y: int, name: str, kind: str, units: dict[str, str], options: dict[str, Any]
) -> list[str]:
    """Fill in the unit of the output, and return what is missing."""
    given = channels.table.columns[y].unit
    written = unit_in_name(channels.table.columns[y].name)
    known = parse_unit(given) if given and is_unit(given) else None
    if known is not None and ("[count]", 1) in known.dimension:
        options["counts"] = {name: 1.0}
        return [
            f"how many increments make a turn is not in the file: put it in place of COUNTS in --counts '{name}=COUNTS'"
        ]
    if known is not None and base_of(known, kind) is not None:
        return []
    if known is None and not given and written and base_of(parse_unit(written), kind) is not None:
        units[name] = written
        return []
    force = channels.meanings[u].quantity == "force"
    si = assumed_unit(kind, "m" if force else "rad")
    why = f"unit '{given}' of '{name}' says no {kind}" if given else f"the unit of '{name}' is not in the file"
    return [_ask_unit(name, units, si, why)]
