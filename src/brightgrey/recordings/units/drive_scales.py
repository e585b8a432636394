"""Units of drives: parts of a rated value, increments of an encoder, gear ratios, and a torque from its current."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from brightgrey.errors import RecordingError, SettingsError, nearest
from brightgrey.recordings.units.parser import Unit, parse_unit
from brightgrey.recordings.units.signals import KINDS

__all__ = ["QUANTITIES", "DriveScales", "Scaled", "check_names", "parse_value", "rated_hint"]

VALUE = re.compile(r"\s*([+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+)\s*(\S.*?)\s*")
# Quantities that a rated value may be of, with units that show their dimension, of rotary and of linear drives.
QUANTITIES = {
    "torque": ("N m", "N"),
    "force": ("N", "N m"),
    "current": ("A",),
    "voltage": ("V",),
    "speed": ("rad/s", "m/s"),
    "velocity": ("rad/s", "m/s"),
    "position": ("rad", "m"),
}
KIND_QUANTITIES = {
    "input": ("torque", "force", "current", "voltage"),
    "position": ("position",),
    "velocity": ("speed", "velocity"),
    "velocity-differenced": ("speed", "velocity"),
    "speed": ("speed", "velocity"),
    "acceleration": (),
}
NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Scaled:
    """Unit that a column stands in after a factor."""

    unit: Unit | None  #: None if nothing says what it is.
    gain: float = 1.0  #: Recorded value times gain stands in `unit`.


@dataclass(frozen=True)
class DriveScales:
    """Values that turn the numbers of a drive into physical units.

    Attributes
    ----------
    rated : mapping of str to str
        Value of 100 % with its unit, by column or by quantity, e.g. ``{"torque": "9.84 mN m"}``.
    counts : mapping of str to float
        Increments per turn, by column.
    gear : mapping of str to float
        Factor of an output, by column, e.g. the ratio that turns an angle at the load into one at the motor.
    torque_constant : str, optional
        Torque or force per current, e.g. ``0.05 N m/A``, for an input that is a current.

    Raises
    ------
    SettingsError
        For a value that is no number with a unit, or not positive.
    """

    rated: Mapping[str, str] = field(default_factory=lambda: NOTHING)
    counts: Mapping[str, float] = field(default_factory=lambda: NOTHING)
    gear: Mapping[str, float] = field(default_factory=lambda: NOTHING)
    torque_constant: str | None = None

    def __post_init__(self) -> None:
        for name, text in self.rated.items():
            value, unit = parse_value(f"rated {name}", text)
            if value <= 0:
                raise SettingsError(f"rated {name} '{text}' is not positive")
            if unit.is_part:
                raise SettingsError(f"rated {name} '{text}': say what 100 % are in a unit, like 9.84 mN m")
        for name, counts in self.counts.items():
            if not (math.isfinite(counts) and counts > 0):
                raise SettingsError(f"counts per turn {name} {counts:g} is not a positive number")
        for name, ratio in self.gear.items():
            if not (math.isfinite(ratio) and ratio != 0):
                raise SettingsError(f"gear ratio {name} {ratio:g} is not a finite number other than zero")
        if self.torque_constant is not None:
            parse_value("torque constant", self.torque_constant, "0.05 N m/A")

    def names(self) -> list[str]:
        """Names of columns that values are given for; those of quantities are left out."""
        return [name for name in (*self.rated, *self.counts, *self.gear) if name not in QUANTITIES]

    def of(self, column: str, kind: str, unit: Unit | None, references: Sequence[str] = (), doubt: str = "") -> Scaled:
        """Return unit and factor of a column.

        Parameters
        ----------
        column : str
            Its name.
        kind : str
            ``input``, or a kind of output.
        unit : Unit, optional
            Of the column, as the file or the user says.
        references : sequence of str
            What else values may be given by, e.g. its number where several columns have its name.
        doubt : str
            Unit other than A that the name of the column ends in.

        Raises
        ------
        RecordingError
            If a value is given that does not fit the column.
        """
        scaled, names = Scaled(unit), (column, *references)
        if unit is not None and unit.is_part:
            scaled = self._of_rated(names, kind, unit)
        elif any(name in self.rated for name in names):
            raise RecordingError(f"'{column}' has a rated value, but its unit is {_text(unit)} and not %")
        if (counts := next((self.counts[name] for name in names if name in self.counts), None)) is not None:
            scaled = self._of_counts(column, kind, unit, counts)
        if kind == "input" and self.torque_constant is not None:
            scaled = self._of_current(column, scaled, doubt)
        return Scaled(scaled.unit, scaled.gain * next((self.gear[name] for name in names if name in self.gear), 1.0))

    def _of_rated(self, names: Sequence[str], kind: str, unit: Unit) -> Scaled:
        keys = [*names, *KIND_QUANTITIES[kind]]
        key = next((key for key in keys if key in self.rated), None)
        if key is None:
            return Scaled(unit)
        value, rated = parse_value(f"rated {key}", self.rated[key])
        fitting = () if key in names else QUANTITIES[key]
        if key == "torque" and self.torque_constant is not None:
            fitting = (*fitting, "A")
        if fitting and rated.dimension not in {parse_unit(other).dimension for other in fitting}:
            raise SettingsError(
                f"rated {key} '{self.rated[key]}': a {key} is in {' or '.join(fitting)}, or multiples of it"
            )
        return Scaled(rated, value * unit.si)

    def _of_counts(self, column: str, kind: str, unit: Unit | None, counts: float) -> Scaled:
        order = KINDS.get(kind)
        if order is None:
            raise RecordingError(f"'{column}' has counts per turn, but it is the input and no motion")
        expected = {"[count]": 1, "[time]": -order} if order else {"[count]": 1}
        if unit is not None and dict(unit.dimension) != expected:
            raise RecordingError(f"'{column}' has counts per turn, but its unit is {unit.text}")
        turns = parse_unit(("rev", "rev/s", "rev/s²")[order])
        return Scaled(turns, (1.0 if unit is None else unit.si) / counts)

    def _of_current(self, column: str, scaled: Scaled, doubt: str) -> Scaled:
        value, constant = parse_value("torque constant", str(self.torque_constant), "0.05 N m/A")
        current = parse_unit("A")
        if scaled.unit is None and doubt:
            raise RecordingError(f"a torque constant is given, but the name of '{column}' says {doubt}: give its unit")
        unit = scaled.unit or current
        if unit.dimension != current.dimension:
            raise RecordingError(f"a torque constant is given, but the input '{column}' is in {unit.text} and not in A")
        driving = next((u for u in map(parse_unit, ("N m", "N")) if _times(constant, current) == u.dimension), None)
        if driving is None:
            raise SettingsError(f"torque constant in {constant.text} is no torque or force per current, like N m/A")
        return Scaled(driving, scaled.gain * value * constant.si * unit.si)


def parse_value(what: str, text: str, example: str = "9.84 mN m") -> tuple[float, Unit]:
    """Read a number with its unit, like the `example`; raise SettingsError that names `what` it is."""
    match = VALUE.fullmatch(text)
    if match is None:
        raise SettingsError(f"{what} '{text}': expected a number and a unit, like {example}")
    try:
        return float(match[1]), parse_unit(match[2])
    except RecordingError as error:
        raise SettingsError(f"{what} '{text}': {error}") from error


def rated_hint(column: str, kind: str) -> str:
    """Return the option that a column in % lacks."""
    example = {"input": "9.84 mN m", "position": "360 deg"}.get(kind, "3000 rpm")
    return f"say what 100 % are: --rated '{column}={example}'"


def check_names(scales: DriveScales, columns: list[str], known: Callable[[str], object]) -> None:
    """Refuse values for a name that is neither a column nor a quantity; `known` says if there is such a column."""
    for name in scales.names():
        if not known(name):
            guess = nearest(name, [*columns, *QUANTITIES])
            hint = f" Did you mean '{guess}'?" if guess else ""
            raise SettingsError(f"'{name}' is neither a column nor one of {', '.join(QUANTITIES)}.{hint}")


def _times(one: Unit, other: Unit) -> tuple[tuple[str, int], ...]:
    powers = dict(one.dimension)
    for name, power in other.dimension:
        powers[name] = powers.get(name, 0) + power
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def _text(unit: Unit | None) -> str:
    return unit.text if unit else "not given"
