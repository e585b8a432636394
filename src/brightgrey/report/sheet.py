"""Commissioning sheet: what a drive engineer wants to know of a drive, in a drive engineer's words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.export.model import SPEED, Model
from brightgrey.kit import assemble
from brightgrey.recordings.unit_text import parse_unit
from brightgrey.report.frequency import linearised
from brightgrey.report.friction import TORQUE, draws, friction_at, friction_of
from brightgrey.report.gap import MOTION
from brightgrey.report.numbers import significant

__all__ = ["Entry", "sheet"]

Array = NDArray[np.float64]
INERTIA = (1, -1, 2)


@dataclass(frozen=True)
class Entry:
    """One line of the sheet.

    Attributes
    ----------
    name : str
    value : float
        In `unit`.
    unit : str
    interval : (low, high) or None
        95 %, where it is known.
    note : str
        How it follows from the parameters.
    """

    name: str
    value: float
    unit: str
    interval: tuple[float, float] | None = None
    note: str = ""

    @property
    def shown(self) -> str:
        """Value with four digits."""
        return significant(self.value)

    @property
    def range(self) -> str:
        """Interval with three digits, or nothing."""
        return " … ".join(significant(end, 3) for end in self.interval) if self.interval else ""


def sheet(model: Model, correlation: Mapping[tuple[str, str], float]) -> tuple[Entry, ...]:
    """Lines of the commissioning sheet that apply to a model, in its units.

    Parameters
    ----------
    model : Model
    correlation : mapping of (str, str) to float
        Of the estimates' errors, for the intervals of what follows from several parameters.
    """
    sets = draws(model, correlation)
    return (
        *_inertias(model, sets),
        *_oscillations(model),
        *_friction(model, sets),
        *_constant(model),
        *_gaps(model),
        *_lags(model),
    )


def _words(model: Model) -> tuple[str, str]:
    """What inertia and torque are called in this drive."""
    bases = dict(parse_unit(model.units.motion).dimension)
    inertia = "mass" if "[length]" in bases else "inertia"
    return inertia, {"N m": "torque", "N": "force"}.get(model.input.unit, f"input ({model.input.unit})")


def _inertias(model: Model, sets: Mapping[str, Array]) -> Iterator[Entry]:
    names = [name for name, q in model.structure.parameters.items() if tuple(q.dimension) == INERTIA]
    if not names:
        return
    word, _ = _words(model)
    unit, factor = model.units.of(model.structure.parameters[names[0]].dimension)
    total = sum(model.parameters[name].value for name in names)
    several = sum((sets[name] for name in names), start=np.zeros(())) * factor if sets else None
    yield Entry(f"total {word}", total, unit, _interval(several), " + ".join(names))
    if len(names) > 1:
        motor = model.parameters[names[0]].value
        ratio = several / (sets[names[0]] * factor) - 1.0 if several is not None else None
        note = f"({' + '.join(names[1:])}) / {names[0]}"
        yield Entry(f"{word} ratio, load to motor", total / motor - 1.0, "", _interval(ratio), note)


def _interval(values: Array | None) -> tuple[float, float] | None:
    """95 % of the draws; None where they do not differ."""
    if values is None or not np.ptp(values) > 0.0:
        return None
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)


def _oscillations(model: Model) -> Iterator[Entry]:
    analysis = linearised(model)
    if analysis is None:
        return
    for word, found in (("resonance", analysis.resonances), ("antiresonance", analysis.antiresonances())):
        for number, swing in enumerate(found, start=1):
            which = word if len(found) == 1 else f"{word} {number}"
            yield Entry(f"{which} frequency", swing.frequency, "Hz")
            yield Entry(f"{which}, damping ratio", swing.damping, "")


def _friction(model: Model, sets: Mapping[str, Array]) -> Iterator[Entry]:
    settings = model.settings_si()
    unit, factor = model.units.of(TORQUE)
    speed_unit, per_speed = model.units.of(SPEED)
    _, word = _words(model)
    held = friction_of(assemble(model.structure, model.values_si(), settings.f_tanh))
    drawn = friction_of(assemble(model.structure, sets, settings.f_tanh)) if sets else {}
    top = f"{significant(settings.speed_scale * per_speed, 3)} {speed_unit}"
    for mass, elements in held.items():
        where = "" if len(held) == 1 else f" of mass {mass}"
        for speed, what, still in ((0.0, "at standstill", True), (settings.speed_scale, f"at {top}", False)):
            at = np.array([speed])
            value = float(friction_at(elements, at, standstill=still)[0, 0]) * factor
            spread = friction_at(drawn[mass], at, standstill=still)[0] * factor if drawn else None
            note = "without smoothing of the sign" if still else "largest speed of the recording"
            yield Entry(f"friction {word}{where} {what}", value, unit, _interval(spread), note)


def _constant(model: Model) -> Iterator[Entry]:
    """Parameters of laws that depend on no state."""
    _, word = _words(model)
    for placed in model.structure.placed:
        law = placed.effect.law
        if law is not None and law.ports == 0:
            for symbol in law.parameters:
                name = placed.parameter(symbol)
                part = model.parameters[name]
                note = f"{name}, positive in the direction of positive motion"
                yield Entry(f"constant {word} on the drive", part.value, part.unit, part.ci95, note)


def _gaps(model: Model) -> Iterator[Entry]:
    """Whole gaps: a declared gap is half of it."""
    system = assemble(model.structure, model.values_si(), model.settings_si().f_tanh)
    unit, factor = model.units.of(MOTION)
    for e in system.elements:
        if e.limits is not None:
            width = float(e.limits.upper - e.limits.lower) * factor
            placed = next(p for p in model.structure.placed if f"{p.name}@{p.place}" == e.name)
            name = placed.parameter(e.law.parameters[0])
            ends = model.parameters[name].ci95
            share = width / model.parameters[name].value
            interval = None if ends is None else (share * ends[0], share * ends[1])
            yield Entry("backlash at the load (whole gap)", width, unit, interval, f"{share:g} {name}")


def _lags(model: Model) -> Iterator[Entry]:
    """Times by which the input comes late."""
    late = [name for name, q in model.structure.parameters.items() if q.lag]
    for name in late:
        part = model.parameters[name]
        yield Entry(model.structure.parameters[name].about, part.value, part.unit, part.ci95, name)
    if len(late) > 1:
        unit = model.parameters[late[0]].unit
        total = sum(model.parameters[name].value for name in late)
        yield Entry("all delay of the input together", total, unit, None, " + ".join(late))
