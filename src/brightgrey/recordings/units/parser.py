"""Parser of units. Inside brightgrey every quantity is in coherent SI; units appear at its edge only.

A small grammar reads the text (``N m``, ``Nm``, ``mm/s``, ``rad s-2``, ``°/s``, ``rpm``), and pint gives the
value. The registry holds only units that signals of drives have. Pint's own list reads ``Nm`` as a yarn's number
per metre, ``U/min`` as enzyme units and ``Grad`` as a billion radians. Angle is a dimension of its own here, so
that rad/s and 1/s stay apart.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, cast

from brightgrey.errors import RecordingError, nearest

if TYPE_CHECKING:
    import pint

__all__ = ["COMMON_UNITS", "Factors", "Unit", "is_unit", "parse_unit", "write_factors"]

COMMON_UNITS = (
    *("rad", "deg", "rev", "m", "mm", "rad/s", "deg/s", "rpm", "m/s", "mm/s", "rad/s²", "m/s²"),
    *("N m", "N", "V", "A", "%", "s", "ms"),
)

DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
kilo- = 1e3 = k-
mega- = 1e6 = M-
second = [time] = s = sec
minute = 60 * second = min
hour = 60 * minute = h
day = 24 * hour = day
meter = [length] = m = metre
inch = 0.0254 * meter = in
foot = 12 * inch = ft = feet
radian = [angle] = rad
degree = 0.017453292519943295 * radian = deg = ° = Grad
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
gon = 0.9 * degree
turn = 6.283185307179586 * radian = rev = revolution
revolution_per_minute = turn / minute = rpm
revolution_per_second = turn / second = rps
kilogram = [mass] = kg
standard_gravity = 9.80665 * meter / second ** 2 = g
newton = kilogram * meter / second ** 2 = N
pound_force = 4.4482216152605 * newton = lbf = lb = pound
ounce_force = pound_force / 16 = ozf = oz = ounce
kilogram_force = 9.80665 * newton = kgf = kp
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
ampere = [current] = A = amp = Arms = Aeff
volt = kilogram * meter ** 2 / ampere / second ** 3 = V = Vrms
watt = kilogram * meter ** 2 / second ** 3 = W
percent = 0.01 = % = pct
permille = 0.001 = ‰
count = [count] = count = inc = digit = cnt = incr = tick = pulse = ink = increment = inkrement = step = pls = lsb = qc
count_per_second = count / second = pps = cps
"""

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


@cache
def _registry() -> pint.UnitRegistry[float]:
    """Create the registry on first use, because importing pint takes longer than the rest of the package."""
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    registry.load_definitions(DEFINITIONS.strip().splitlines())
    return registry


def _lookup(name: str) -> list[str] | None:
    """Full names of the units in one written name (two for ``Nm``), or None if it is unknown."""
    found = _registry().parse_unit_name(name, case_sensitive=True)
    # Written-out names come in capitals and in the plural: Volts, Degrees, Deg, Min.
    lower = name.lower()
    spellings = [text for text in (lower, lower.removesuffix("s")) if len(text) > 2 and text != name]
    if all(prefix for prefix, _, _ in found):
        for text in spellings:
            if any(not prefix for prefix, _, _ in _registry().parse_unit_name(text)):
                return _lookup(text)
    if found:  # a plain name is preferred to a prefix: min is not milli-inch, kg not kilo-g
        prefix, unit, _ = min(found, key=lambda candidate: len(candidate[0]))
        return [prefix + unit]
    for torque in TORQUES:
        if match := torque.fullmatch(name):
            return [full for part in match.groups() for full in (_lookup(part) or [])]
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


def _factors(text: str) -> Factors:
    """Return full names and powers in the order written; a denominator of several factors needs brackets."""
    factors: list[tuple[str, int]] = []
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
            names = _lookup(token["name"])
            power = re.fullmatch(r"\W*?(-?\d)", (token["power"] or "1").translate(SIGNS))
            if names is None or power is None:
                raise _unknown(token["name"] if power else text, text)
            factors += [(name, -int(power[1]) if below else int(power[1])) for name in names]
    return tuple(factors)


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
    registry = _registry()
    factors = _factors(plain)
    si, powers = 1.0, Counter[str]()
    for name, power in factors:
        one = registry.Quantity(1.0, name).to_root_units()
        si *= float(one.magnitude) ** power
        for dimension, times in one.dimensionality.items():
            powers[str(dimension)] += power * round(cast("float", times))
    merged: dict[str, int] = {}  # rad/s/s is rad/s²
    for name, power in factors:
        symbol = registry.get_symbol(name)
        merged[symbol] = merged.get(symbol, 0) + power
    symbols = tuple(merged.items())
    dimensions = tuple(sorted((name, power) for name, power in powers.items() if power))
    return Unit(write_factors(symbols), symbols, si, dimensions)


def is_unit(text: str) -> bool:
    """Return True if `text` can be read as a unit."""
    try:
        parse_unit(text)
    except RecordingError:
        return False
    return True
