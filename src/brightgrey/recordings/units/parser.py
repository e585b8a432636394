"""Parser of units. Inside brightgrey every quantity is in coherent SI; units appear at its edge only.

A small grammar reads the text (``N m``, ``Nm``, ``mm/s``, ``rad s-2``, ``°/s``, ``rpm``). Its table holds only units
that signals of drives have. A general library reads ``Nm`` as a yarn's number per metre, ``U/min`` as enzyme units and
``Grad`` as a billion radians, and takes a fifth of the time of a short command to load (pint 0.25). Angle is a
dimension of its own here, so that rad/s and 1/s stay apart.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from brightgrey.errors import RecordingError, nearest

__all__ = ["COMMON_UNITS", "Factors", "Unit", "is_unit", "parse_unit", "write_factors"]

COMMON_UNITS = (
    *("rad", "deg", "rev", "m", "mm", "rad/s", "deg/s", "rpm", "m/s", "mm/s", "rad/s²", "m/s²"),
    *("N m", "N", "V", "A", "%", "s", "ms"),
)

# Names of a prefix (the first one is its symbol), and its factor.
PREFIX_DEFINITIONS = (
    *(("n nano", 1e-9), ("µ micro μ u", 1e-6), ("m milli", 1e-3), ("c centi", 1e-2), ("d deci", 1e-1)),
    *(("k kilo", 1e3), ("M mega", 1e6)),
)
PREFIX_BY_NAME = {"": ("", 1.0)} | {
    name: (names.split()[0], factor) for names, factor in PREFIX_DEFINITIONS for name in names.split()
}

TIME, LENGTH, ANGLE, MASS, CURRENT, COUNT = (
    {f"[{name}]": 1} for name in ("time", "length", "angle", "mass", "current", "count")
)
FORCE = {"[mass]": 1, "[length]": 1, "[time]": -2}
TURNS = {"[angle]": 1, "[time]": -1}
# Names of a unit (the first one is its symbol), value in coherent SI, dimension.
DEFINITIONS: tuple[tuple[str, float, Mapping[str, int]], ...] = (
    ("s sec second", 1.0, TIME),
    ("min minute", 60.0, TIME),
    ("h hour", 3600.0, TIME),
    ("day", 86400.0, TIME),
    ("m meter metre", 1.0, LENGTH),
    ("in inch", 0.0254, LENGTH),
    ("ft foot feet", 12 * 0.0254, LENGTH),
    ("rad radian", 1.0, ANGLE),
    ("deg ° degree Grad", math.pi / 180, ANGLE),
    ("arcmin arcminute", math.pi / 180 / 60, ANGLE),
    ("arcsec arcsecond", math.pi / 180 / 3600, ANGLE),
    ("gon", 0.9 * math.pi / 180, ANGLE),
    ("rev turn revolution", 2 * math.pi, ANGLE),
    ("rpm revolution_per_minute", 2 * math.pi / 60, TURNS),
    ("rps revolution_per_second", 2 * math.pi, TURNS),
    ("kg kilogram", 1.0, MASS),
    ("g standard_gravity", 9.80665, {"[length]": 1, "[time]": -2}),
    ("N newton", 1.0, FORCE),
    ("lbf pound_force lb pound", 4.4482216152605, FORCE),
    ("ozf ounce_force oz ounce", 4.4482216152605 / 16, FORCE),
    ("kgf kilogram_force kp", 9.80665, FORCE),
    ("Pa pascal", 1.0, {"[mass]": 1, "[length]": -1, "[time]": -2}),
    ("bar", 1e5, {"[mass]": 1, "[length]": -1, "[time]": -2}),
    ("A ampere amp Arms Aeff", 1.0, CURRENT),
    ("V volt Vrms", 1.0, {"[mass]": 1, "[length]": 2, "[current]": -1, "[time]": -3}),
    ("W watt", 1.0, {"[mass]": 1, "[length]": 2, "[time]": -3}),
    ("% percent pct", 0.01, {}),
    ("‰ permille", 0.001, {}),
    ("count inc digit cnt incr tick pulse ink increment inkrement step pls lsb qc", 1.0, COUNT),
    ("pps count_per_second cps", 1.0, {"[count]": 1, "[time]": -1}),
)
BY_NAME = {name: (names.split()[0], si, of) for names, si, of in DEFINITIONS for name in names.split()}

# Spellings of rpm on drives; a bare 1/min has no other meaning there.
SPEEDS = {"1/min", "r/min", "u/min", "rev/min", "tr/min", "min-1", "min^-1", "min⁻¹", "upm", "rpm"}
# Torques that are written without a space.
TORQUES = tuple(
    re.compile(pattern)
    for pattern in (
        r"([nuµμmkM]?N)([cm]?m)",
        r"(ozf?|lbf?)(in|ft)",
        r"(in|ft)(ozf?|lbf?)",
        r"(kgf|kp)([cm]?m)",
    )
)
SIGNS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--")
TOKEN = re.compile(
    r"(?P<name>[^\W\d_⁰¹²³⁴-⁹]+|[°%‰])(?P<power>(?:\*\*|\^)?[-−]?\d+|⁻?[⁰¹²³⁴-⁹]+)?"
    r"|(?P<one>1)|(?P<sign>[()/])|(?P<times>\s*[*·⋅×._\s-]\s*)"
)
# Form of a whole unit, with one n for every name.
SHAPE = re.compile(r"(n+|\(n+\))(/(n+|\(n+\)))*")

Factors = tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Unit:
    """A parsed unit."""

    text: str  #: Normal spelling, e.g. ``N m``, ``mm/s``; ``1`` without a dimension.
    factors: Factors  #: In the order given.
    si: float  #: Value of one unit in coherent SI (rad, m, kg, s, A).
    dimension: tuple[tuple[str, int], ...]  #: Sorted, e.g. ``(("[angle]", 1), ("[time]", -1))``.

    @property
    def is_part(self) -> bool:
        """True for a part of a value that is to be known: % and ‰."""
        return self.text in ("%", "‰")


@dataclass(frozen=True)
class Named:
    """One unit of the table, with its prefix."""

    prefix: str
    unit: str

    @property
    def symbol(self) -> str:
        """Symbol, e.g. ``mm``."""
        return self.prefix + self.unit

    @property
    def si(self) -> float:
        """Value in coherent SI."""
        return PREFIX_BY_NAME[self.prefix][1] * BY_NAME[self.unit][1]


def _readings(name: str) -> list[Named]:
    """All units that a written name may stand for, with any prefix, in the singular or the plural."""
    found = []
    for written, (prefix, _) in PREFIX_BY_NAME.items():
        stem = name.removeprefix(written) if name.startswith(written) else ""
        plural = stem[:-1] if stem.endswith("s") and len(stem) > 2 else ""
        found += [Named(prefix, BY_NAME[text][0]) for text in (stem, plural) if text in BY_NAME]
    return found


def _lookup(name: str) -> list[Named] | None:
    """Units in one written name (two for ``Nm``), or None if it is unknown."""
    found = _readings(name)
    # Written-out names come in capitals and in the plural: Volts, Degrees, Deg, Min.
    lower = name.lower()
    spellings = [text for text in (lower, lower.removesuffix("s")) if len(text) > 2 and text != name]
    if all(one.prefix for one in found):
        for text in spellings:
            if any(not one.prefix for one in _readings(text)):
                return _lookup(text)
    if found:  # a plain name is preferred to a prefix: min is not milli-inch, kg not kilo-g
        return [min(found, key=lambda one: len(one.prefix))]
    for torque in TORQUES:
        if match := torque.fullmatch(name):
            return [one for part in match.groups() for one in (_lookup(part) or [])]
    return next((_lookup(text) for text in spellings[-1:] if len(text) > 3), None)


def _unknown(name: str, text: str) -> RecordingError:
    guess = nearest(name, [*COMMON_UNITS, "min", "in", "ft", "lbf", "ozf", "kgf", "bar", "count", "gon", "arcmin"])
    hint = f" Did you mean '{guess}'?" if guess else ""
    where = "" if name == text else f" in '{text}'"
    return RecordingError(f"unknown unit '{name}'{where}.{hint} Units are written like {', '.join(COMMON_UNITS)}")


def _tokens(text: str) -> list[re.Match[str]]:
    """Cut a unit into names, slashes and brackets."""
    tokens, at = [], 0
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise _unknown(text, text)
        tokens.append(match)
        at = match.end()
    tokens = [token for token in tokens if not token["times"]]
    if not SHAPE.fullmatch("".join(token["sign"] or "n" for token in tokens)):
        raise _unknown(text, text)
    return tokens


def _factors(text: str) -> list[tuple[Named, int]]:
    """Return units and powers in the order written; a denominator of several factors needs brackets."""
    factors: list[tuple[Named, int]] = []
    below, open_bracket, denominators = False, False, 0
    for token in _tokens(text):
        if token["sign"] == "/":
            below, denominators = True, 0
        elif token["sign"] == "(":
            open_bracket = True
        elif token["sign"] == ")":
            below, open_bracket = False, False
        elif token["name"]:
            denominators += below
            if denominators > 1 and not open_bracket:
                raise RecordingError(f"unit '{text}' can be read in two ways: write a/(b c) or a c/b")
            units = _lookup(token["name"])
            power = re.fullmatch(r"\W*?(-?\d)", (token["power"] or "1").translate(SIGNS))
            if units is None or power is None:
                raise _unknown(token["name"] if power else text, text)
            factors += [(unit, -int(power[1]) if below else int(power[1])) for unit in units]
    return factors


def write_factors(factors: Sequence[tuple[str, int]]) -> str:
    """Write a unit, e.g. ``N m s²/rad``; ``1`` for no factors."""

    def product(terms: list[tuple[str, int]]) -> str:
        powers = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
        return " ".join(symbol + (str(power).translate(powers) if power > 1 else "") for symbol, power in terms)

    above = product([(symbol, power) for symbol, power in factors if power > 0])
    below = [(symbol, -power) for symbol, power in factors if power < 0]
    if not below:
        return above or "1"
    bracketed = f"({product(below)})" if len(below) > 1 else product(below)
    return f"{above or '1'}/{bracketed}"


@cache
def parse_unit(text: str) -> Unit:
    """Parse a unit.

    Parameters
    ----------
    text : str
        E.g. ``N m``, ``Nm``, ``N*m``, ``mm/s``, ``°/s``, ``rad s^-2``, ``rpm`` (also ``1/min``), ``%``,
        ``1``.

    Returns
    -------
    Unit

    Raises
    ------
    RecordingError
        For an unknown unit; the message names the nearest one.
    """
    plain = re.sub(r"[\s_]+per[\s_]+", "/", text.strip()).replace("º", "°")
    compact = re.sub(r"\s+", "", plain)
    if compact.casefold() in SPEEDS:
        plain = "rpm"
    elif compact == "dps":
        plain = "deg/s"
    elif compact == "-":
        plain = "1"
    elif compact in ("0.1%", "0,1%"):
        plain = "‰"
    if not compact:
        raise RecordingError(f"a unit is empty; units are written like {', '.join(COMMON_UNITS)}")
    si, dimension, symbols = 1.0, Counter[str](), Counter[str]()  # rad/s/s is rad/s²
    for unit, power in _factors(plain):
        si *= unit.si**power
        symbols[unit.symbol] += power
        for name, times in BY_NAME[unit.unit][2].items():
            dimension[name] += power * times
    factors = tuple(symbols.items())
    return Unit(write_factors(factors), factors, si, tuple(sorted(item for item in dimension.items() if item[1])))


def is_unit(text: str) -> bool:
    """Return True if `text` can be read as a unit."""
    try:
        parse_unit(text)
    except RecordingError:
        return False
    return True
