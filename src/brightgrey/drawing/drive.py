"""Content of a drawing: parts of a drive with the texts beside them, and no place on paper yet."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from brightgrey.effects import Symbol, registry
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import structure_in_words

__all__ = ["Drive", "DrivePart", "Sensor", "ValueText", "drive_of", "in_unit", "shown_symbol"]

_GREEK = {"alpha": "α", "omega": "ω", "phi": "φ", "lambda": "λ"}


class ValueText(NamedTuple):
    """Value of a parameter as text; `half_width` is half of the 95 % interval, empty where there is none."""

    value: str
    half_width: str
    unit: str


@dataclass(frozen=True)
class DrivePart:
    """Part of a drive that has a symbol.

    Attributes
    ----------
    effect : str
        Name of the placed effect that it belongs to.
    title : str
        Name for people; empty where the symbol says enough.
    symbol : Symbol
    place : int
        Mass or shaft, counted from the motor.
    values : tuple of (str, ValueText or None)
        Its parameters by name; without a value only the name is written.
    undecided : bool
        The recording does not decide whether it is there.
    """

    effect: str
    title: str
    symbol: Symbol
    place: int
    values: tuple[tuple[str, ValueText | None], ...]
    undecided: bool


@dataclass(frozen=True)
class Sensor:
    """Sensor at a mass, counted from the motor: name of the column, and its kind with the unit."""

    mass: int
    name: str
    kind: str


@dataclass(frozen=True)
class Drive:
    """Everything that a drawing shows.

    Attributes
    ----------
    title : str
        Sentence about the drive for people who do not see the drawing.
    masses : int
        Number of masses, with those that are not decided.
    rotary : bool
    parts : tuple of DrivePart
    sensors : tuple of Sensor
    input : str
        Name and unit of the torque or force.
    actuator : int
        Mass that it acts on.
    """

    title: str
    masses: int
    rotary: bool
    parts: tuple[DrivePart, ...]
    sensors: tuple[Sensor, ...] = ()
    input: str = ""
    actuator: int = 1


def drive_of(
    structure: Structure,
    *,
    rotary: bool = True,
    values: Mapping[str, ValueText] | None = None,
    sensors: Sequence[Sensor] = (),
    input_text: str = "",
    actuator: int = 1,
    undecided: Collection[str] = (),
) -> Drive:
    """Drive of a structure.

    Parameters
    ----------
    structure : Structure
    rotary : bool
        False for a linear axis.
    values : mapping of str to ValueText, optional
        Values of the parameters by name; without them the drawing shows names only.
    sensors : sequence of Sensor
    input_text : str
        Name and unit of the input; by default `torque` or `force`.
    actuator : int
        Mass that the input acts on.
    undecided : collection of str
        Names of placed effects that the recording does not decide, inside the structure or not. A multiple-mass system
        stands for its last mass.

    Returns
    -------
    Drive
    """
    chains = [e for e in registry().values() if e.masses and (e.masses <= structure.masses or e.name in undecided)]
    chain = max(chains, key=lambda e: e.masses)
    doubtful = {e.masses for e in registry().values() if e.masses and e.name in undecided}
    last = {"drive": 1, "mass": chain.masses, "shaft": chain.masses - 1}
    more = {Placed.parse(name) for name in undecided}
    extra = {p for p in more if not p.effect.masses and p.place <= last[p.effect.where]}
    placed = Structure((Placed(chain.name), *(structure.beside | extra))).placed
    known = values or {}
    parts = []
    for p in placed:
        for symbol in p.effect.symbols:
            if symbol.motion not in ("any", "rotary" if rotary else "linear"):
                continue
            place = symbol.place or p.place
            mass = place + 1 if symbol.at in ("spring", "damper") else place
            names = [p.parameter(s) for s in symbol.shows or tuple(q.symbol for q in p.effect.parameters)]
            unsure = mass in doubtful if p.effect.masses else str(p) in undecided
            title = "" if p.effect.masses else p.effect.title
            parts.append(DrivePart(str(p), title, symbol, place, tuple((n, known.get(n)) for n in names), unsure))
    return Drive(
        title=_sentence(placed, rotary, actuator),
        masses=chain.masses,
        rotary=rotary,
        parts=tuple(parts),
        sensors=tuple(sensors),
        input=input_text or ("torque" if rotary else "force"),
        actuator=actuator,
    )


def in_unit(name: str, unit: str) -> str:
    """Name with its unit, which is not torn apart at the end of a line."""
    return f"{name} " + f"in {unit}".replace(" ", "\u00a0")


def shown_symbol(name: str) -> tuple[tuple[str, bool], ...]:
    """Parameter's name as runs of text, each with a mark if it is a subscript: ``M_C@2`` as M with C,2."""
    symbol, _, place = name.partition("@")
    base, _, sub = symbol.partition("_")
    letters = base.rstrip("0123456789")
    low = ",".join(part for part in (base[len(letters) :], sub, place) if part)
    runs = ((_GREEK.get(letters, letters), False), (low, True))
    return tuple(run for run in runs if run[0])


def _sentence(placed: Sequence[Placed], rotary: bool, actuator: int) -> str:
    kind = "Rotary drive" if rotary else "Linear axis"
    driven = f", input at mass {actuator}" if actuator > 1 else ""
    return f"{kind}: {structure_in_words(Structure(tuple(placed)))}{driven}."
