"""Meaning of a channel, as its unit and its name say: quantity, setpoint or actual value, side of the gear."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from brightgrey.errors import RecordingError
from brightgrey.recordings.units.parser import Unit, is_unit, parse_unit
from brightgrey.recordings.units.signals import kind_of

__all__ = ["DRIVING", "MOTIONS", "UNITS", "Meaning", "index_of", "meaning_of", "stem_of", "unit_in_name"]

DRIVING = ("torque", "force", "current", "voltage")
MOTIONS = ("position", "velocity", "acceleration")
UNITS = {"torque": "N m", "force": "N", "current": "A", "voltage": "V"}
# Words of names, in English and German; those of five letters and more are found within longer words, too.
QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "torque": ("torque", "torq", "trq", "tau", "drehmoment", "moment", "tq", "effort"),
    "force": ("force", "kraft"),
    "current": ("current", "curr", "strom", "iq", "isq", "amps"),
    "voltage": ("voltage", "volt", "spannung", "uq", "pwm"),
    "acceleration": ("acceleration", "accel", "acc", "beschleunigung", "ddq", "qdd"),
    "velocity": (
        *("velocity", "veloc", "vel", "speed", "spd", "drehzahl", "geschwindigkeit", "omega", "rpm", "erpm"),
        *("dq", "qd"),
    ),
    "position": ("position", "pos", "angle", "winkel", "lage", "phi", "theta", "encoder", "enc", "weg"),
}
LETTERS = {"q": "position", "v": "velocity", "w": "velocity", "n": "velocity", "i": "current", "u": "voltage"}
ROLES: Mapping[str, tuple[str, ...]] = {
    "error": ("error", "err", "deviation", "dev", "diff", "following", "schleppfehler"),
    "setpoint": (
        *("setpoint", "reference", "ref", "set", "desired", "des", "commanded", "command", "cmd", "target", "demand"),
        *("wanted", "nominal", "sollwert", "soll", "sp"),
    ),
    "actual": ("actual", "act", "measured", "meas", "feedback", "fbk", "istwert", "ist"),
}
SIDES: Mapping[str, tuple[str, ...]] = {
    "load": ("load", "link", "se", "secondary", "abtrieb", "abtriebsseite", "carriage", "arm"),
    "motor": ("motor", "mot", "rotor"),
}
WORD = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöü])|[A-ZÄÖÜ]?[a-zäöüß]+")
INDEX = re.compile(r"\d+")
UNIT_AT_END = re.compile(r".*?_(?:in_)?([A-Za-zµ%]+(?:_per_[A-Za-z]+2?)?)(?:\([^)]*\))?")
# What units at the end of a name are commonly written as.
WRITTEN = {"nm": "N m"}


@dataclass(frozen=True)
class Meaning:
    """Guess of what a channel is; empty texts where nothing says it."""

    quantity: str = ""  #: torque, force, current, voltage, position, velocity, acceleration, time or count.
    role: str = ""  #: setpoint, actual or error.
    side: str = ""  #: motor or load.
    reason: str = ""

    def words(self) -> str:
        """Return the meaning in words."""
        side = f"{self.side} side" if self.side else ""
        return " ".join(part for part in (self.role, self.quantity) if part) + (f", {side}" if side else "")


def meaning_of(name: str, unit: str | None) -> Meaning:
    """Return what unit and name of a channel say."""
    words = [word.lower() for word in WORD.findall(name[:200])]
    role, by_role = _found(words, ROLES)
    side, by_side = _found(words, SIDES)
    quantity, reason = _by_unit(unit, "its unit is")
    if not quantity:
        quantity, word = _found(words, QUANTITIES)
        reason = f"its name says {word}" if quantity else ""
    if not quantity and (written := unit_in_name(name)):
        quantity, reason = _by_unit(written, "its name ends in")
    if not quantity and len(words) == 1 and len(words[0]) <= 2 and (letter := words[0][0]) in LETTERS:
        quantity, reason = LETTERS[letter], f"'{letter}' often is one"
    said = " and ".join(f"'{word}'" for word in (by_role, by_side) if word)
    return Meaning(quantity, role, side, ", ".join(part for part in (reason, said) if part))


def unit_in_name(name: str) -> str | None:
    """Return the unit that a name ends in, e.g. ``deg/s`` for ``velocity_deg_per_s``."""
    match = UNIT_AT_END.fullmatch(name[:200])
    if match is None:
        return None
    text = WRITTEN.get(match[1].lower(), match[1])
    return parse_unit(text).text if is_unit(text) else None


def stem_of(name: str) -> str:
    """Return a name without its number: like sensors at several places have one stem."""
    number = index_of(name)
    before, _, after = name.rpartition(number) if number else (name, "", "")
    return before + after


def index_of(name: str) -> str:
    """Return the number of the axis in a name: the first one that stands in brackets or at its end."""
    numbers = INDEX.findall(name)
    return numbers[-1] if numbers else ""


def _by_unit(text: str | None, says: str) -> tuple[str, str]:
    try:
        unit = parse_unit(text) if text else None
    except RecordingError:
        return "", ""
    quantity = _quantity_of(unit) if unit else ""
    return quantity, f"{says} {unit.text}" if unit and quantity else ""


def _quantity_of(unit: Unit) -> str:
    """Return the quantity that has a unit; empty for a time, a part or a number."""
    if (kind := kind_of(unit)) is not None:
        return kind
    return next((name for name, text in UNITS.items() if parse_unit(text).dimension == unit.dimension), "")


def _found(words: list[str], vocabulary: Mapping[str, tuple[str, ...]]) -> tuple[str, str]:
    """Return the first entry of a vocabulary with one of its words, and this word."""
    for entry, known in vocabulary.items():
        for word in known:
            if word in words or (len(word) >= 5 and any(word in longer for longer in words)):
                return entry, word
    return "", ""
