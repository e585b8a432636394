"""Commissioning sheet: what a drive engineer wants to know of a drive, in a drive engineer's words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import INERTIA, POSITION, SPEED, TORQUE
from brightgrey.kit import assemble
from brightgrey.model.model import Model
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.report.charts.frequency_response import linearised
from brightgrey.report.charts.friction import friction_at, friction_elements
from brightgrey.report.quantities.number_format import significant, with_uncertainty
from brightgrey.report.quantities.propagation import Correlation, intervals
from brightgrey.report.text.tables import interval_text

__all__ = ["SheetEntry", "commissioning_sheet"]


@dataclass(frozen=True)
class SheetEntry:
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
        """Value with the digits that its interval justifies, four if there is none."""
        if self.interval is None:
            return significant(self.value)
        return with_uncertainty(self.value, 0.5 * (self.interval[1] - self.interval[0]))[0]

    @property
    def range(self) -> str:
        """Interval with the same digits, or nothing."""
        return interval_text(self.interval)


def commissioning_sheet(model: Model, correlation: Correlation) -> tuple[SheetEntry, ...]:
    """Lines of the commissioning sheet that apply to a model, in its units.

    Parameters
    ----------
    model : Model
    correlation : mapping of (str, str) to float
        Of the estimates' errors, for the intervals of what follows from several parameters.
    """
    return (
        *_inertias(model, correlation),
        *_oscillations(model),
        *_friction(model, correlation),
        *_constant(model),
        *_gaps(model),
        *_lags(model),
    )


def _words(model: Model) -> tuple[str, str, str]:
    """What inertia, friction and constant load are called in this drive."""
    bases = dict(parse_unit(model.units.motion).dimension)
    inertia = "mass" if "[length]" in bases else "inertia"
    kind = {"N m": "torque", "N": "force"}.get(model.input.unit)
    if kind is None:
        return inertia, "friction, as input,", "constant load, as input"
    return inertia, f"friction {kind}", f"constant {kind} on the drive"


def _inertias(model: Model, correlation: Correlation) -> Iterator[SheetEntry]:
    names = [name for name, q in model.structure.parameters.items() if q.dimension == INERTIA]
    word, _, _ = _words(model)
    unit, factor = model.units.of(INERTIA)

    def quantities(sets: Mapping[str, Array]) -> Array:
        load = sum((sets[name] for name in names[1:]), start=np.zeros_like(sets[names[0]]))
        return np.array([(sets[names[0]] + load) * factor, load / sets[names[0]]])

    (total, ratio), ends = _values(model, quantities), intervals(model, correlation, quantities)
    yield SheetEntry(f"total {word}", total, unit, ends[0], " + ".join(names))
    if len(names) > 1:
        load = " + ".join(names[1:])
        note = f"({load}) / {names[0]}" if len(names) > 2 else f"{load} / {names[0]}"
        yield SheetEntry(f"{word} ratio, load to motor", ratio, "", ends[1], note)


def _values(model: Model, quantities: Callable[[Mapping[str, Array]], Array]) -> list[float]:
    """Quantities of the model itself."""
    one = {name: np.array([value]) for name, value in model.values_si().items()}
    return [float(value) for value in quantities(one)[:, 0]]


def _oscillations(model: Model) -> Iterator[SheetEntry]:
    analysis = linearised(model)
    if analysis is None:
        return
    for word, found in (("resonance", analysis.resonances), ("antiresonance", analysis.antiresonances())):
        for number, swing in enumerate(found, start=1):
            which = word if len(found) == 1 else f"{word} {number}"
            yield SheetEntry(f"{which} frequency", swing.frequency, "Hz")
            yield SheetEntry(f"{which}, damping ratio", swing.damping, "")


def _friction(model: Model, correlation: Correlation) -> Iterator[SheetEntry]:
    settings = model.settings_si()
    unit, factor = model.units.of(TORQUE)
    speed_unit, per_speed = model.units.of(SPEED)
    _, word, _ = _words(model)
    top = settings.speed_scale
    held = friction_elements(assemble(model.structure, model.values_si(), settings.f_tanh))
    for mass in held:

        def quantities(sets: Mapping[str, Array], mass: int = mass) -> Array:
            elements = friction_elements(assemble(model.structure, sets, settings.f_tanh))[mass]
            still = friction_at(elements, np.zeros(1), standstill=True)
            turning = friction_at(elements, np.array([top]))
            shape = (1, len(next(iter(sets.values()))))
            return np.concatenate([np.broadcast_to(part * factor, shape) for part in (still, turning)])

        values, ends = _values(model, quantities), intervals(model, correlation, quantities)
        where = "" if len(held) == 1 else f" of mass {mass}"
        at = f"at {significant(top * per_speed, 3)} {speed_unit}"
        yield SheetEntry(f"{word}{where} at standstill", values[0], unit, ends[0], "without smoothing of the sign")
        yield SheetEntry(f"{word}{where} {at}", values[1], unit, ends[1], "largest speed of the recording")


def _constant(model: Model) -> Iterator[SheetEntry]:
    """Parameters of laws that depend on no state."""
    _, _, word = _words(model)
    for placed in model.structure.placed:
        law = placed.effect.law
        if law is not None and law.ports == 0:
            for symbol in law.parameters:
                name = placed.parameter(symbol)
                part = model.parameters[name]
                note = f"{name}, positive in the direction of positive motion"
                yield SheetEntry(word, part.value, part.unit, part.ci95, note)


def _gaps(model: Model) -> Iterator[SheetEntry]:
    """Whole gaps: a declared gap is half of it."""
    system = assemble(model.structure, model.values_si(), model.settings_si().f_tanh)
    unit, factor = model.units.of(POSITION)
    for e in system.elements:
        if e.limits is not None:
            width = float(e.limits.upper - e.limits.lower) * factor
            placed = next(p for p in model.structure.placed if f"{p.name}@{p.place}" == e.name)
            name = placed.parameter(e.law.parameters[0])
            ends = model.parameters[name].ci95
            share = width / model.parameters[name].value
            interval = None if ends is None else (share * ends[0], share * ends[1])
            yield SheetEntry("backlash at the load (whole gap)", width, unit, interval, f"{share:g} {name}")


def _lags(model: Model) -> Iterator[SheetEntry]:
    """Times by which the input comes late."""
    late = [name for name, q in model.structure.parameters.items() if q.lag]
    for name in late:
        part = model.parameters[name]
        yield SheetEntry(model.structure.parameters[name].about, part.value, part.unit, part.ci95, name)
    if len(late) > 1:
        unit = model.parameters[late[0]].unit
        total = sum(model.parameters[name].value for name in late)
        yield SheetEntry("all delay of the input together", total, unit, None, " + ".join(late))
