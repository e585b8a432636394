"""Units of the signals of a recording and of the parameters of its models."""

from __future__ import annotations

from dataclasses import dataclass

from brightgrey.errors import RecordingError, one_of
from brightgrey.recordings.units.parser import Unit, parse_unit, write_factors

__all__ = ["KINDS", "Units", "assumed_unit", "check_kind", "kind_in_words", "motion_unit"]

# Kind of output, and its order as a time derivative of the motion.
KINDS = {"position": 0, "velocity": 1, "velocity-differenced": 1, "speed": 1, "acceleration": 2}
KIND_WORDS = {"velocity-differenced": "velocity from encoder differences", "speed": "speed without sign"}
BASES = {"[angle]": "rad", "[length]": "m"}
FITTING = {
    0: "an angle or a length, e.g. rad, deg, m, mm",
    1: "an angle or a length per time, e.g. rad/s, rpm, m/s, mm/s",
    2: "an angle or a length per time squared, e.g. rad/s², deg/s², m/s²",
}
# Composed units that have a name of their own.
NAMED = {("N m", "rad", (1, -1, 2)): "kg m²", ("N", "m", (1, -1, 2)): "kg"}


def check_kind(kind: str) -> str:
    """Return `kind` if it is one of `KINDS`; raise RecordingError if it is not."""
    return one_of("kind of output", kind, KINDS, error=RecordingError)


def kind_in_words(kind: str) -> str:
    """Return the name of a kind of signal for people."""
    return KIND_WORDS.get(kind, kind)


def base_of(unit: Unit, kind: str) -> str | None:
    """Return ``rad`` or ``m`` if `unit` fits an output of this `kind`, else None."""
    order = KINDS[kind]
    for name, base in BASES.items():
        if dict(unit.dimension) == ({name: 1, "[time]": -order} if order else {name: 1}):
            return base
    return None


def kind_of(unit: Unit) -> str | None:
    """Return the kind of output that has such a unit, or None."""
    return next((kind for kind in KINDS if base_of(unit, kind)), None)


def fits(kind: str) -> str:
    """Describe the units that an output of this `kind` may have."""
    return FITTING[KINDS[kind]]


def assumed_unit(kind: str, base: str) -> str:
    """Return the coherent SI unit of an output of this `kind`; `base` is ``rad`` or ``m``."""
    return base + ("", "/s", "/s²")[KINDS[kind]]


def motion_unit(unit: Unit) -> str:
    """Return the length or angle in the unit of a motion, or ``rad`` or ``m`` where it shows none, as in rpm or g.

    A speed in rpm thus gives parameters in rad and s, a speed in mm/s gives parameters in mm and s.

    Raises
    ------
    RecordingError
        If there is neither an angle nor a length in the unit.
    """
    bases = dict(unit.dimension)
    for symbol, power in unit.factors:
        if power == 1 and any(dict(parse_unit(symbol).dimension) == {name: 1} for name in BASES):
            return symbol
    for name, base in BASES.items():
        if name in bases:
            return base
    raise RecordingError(f"unit '{unit.text}' of the motion holds neither an angle nor a length")


@dataclass(frozen=True)
class Units:
    """Units that parameters, states and signals are shown in.

    Raises
    ------
    RecordingError
        For unknown units and for a motion that is neither angle nor length.
    """

    input: str = "N m"  #: Unit of the input, e.g. ``N m``, ``V``.
    motion: str = "rad"  #: Angle or length in the unit of the first output, e.g. ``rad``, ``mm``.

    def __post_init__(self) -> None:
        motion = parse_unit(self.motion)
        if base_of(motion, "position") is None:
            raise RecordingError(f"unit '{self.motion}' of the motion is neither an angle nor a length")
        object.__setattr__(self, "input", parse_unit(self.input).text)
        object.__setattr__(self, "motion", motion.text)

    def of(self, dimension: tuple[int, int, int]) -> tuple[str, float]:
        """Return the unit of a quantity and the factor from SI to it.

        Parameters
        ----------
        dimension : tuple of int
            Powers of input, motion and second, e.g. (1, -1, 2) for an inertia.

        Returns
        -------
        text : str
            E.g. ``N m s/rad``, ``V s²/mm``; ``kg m²`` and ``kg`` for inertias from N m and rad, N and m.
        factor : float
            Shown value = factor · value in coherent SI.
        """
        u, motion = parse_unit(self.input), parse_unit(self.motion)
        a, b, c = dimension
        text = NAMED.get((self.input, self.motion, (a, b, c)))
        if text is None:
            powers = [(symbol, power * a) for symbol, power in u.factors]
            powers += [(symbol, power * b) for symbol, power in motion.factors] + [("s", c)]
            text = write_factors(powers)
        return text, 1.0 / (u.si**a * motion.si**b)
