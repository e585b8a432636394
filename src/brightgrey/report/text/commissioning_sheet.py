"""Commissioning sheet: the quantities that a drive engineer sets a drive up with, in their usual words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import INERTIA, POSITION, SPEED, TORQUE
from brightgrey.model.model import Model
from brightgrey.numerics.number_format import significant, with_uncertainty
from brightgrey.report.charts.friction import friction_at, friction_elements
from brightgrey.report.quantities.assembled_model import AssembledModel
from brightgrey.report.quantities.propagation import Correlation, intervals
from brightgrey.report.text.tables import interval_text

__all__ = ["SheetEntry", "commissioning_sheet"]


@dataclass(frozen=True)
class SheetEntry:
    """One line of the sheet."""

    name: str
    value: float  #: In `unit`.
    unit: str
    interval: tuple[float, float] | None = None  #: 95 %, where it is known.
    note: str = ""  #: Its origin: parameters, or the conditions it holds under.

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


def commissioning_sheet(assembled: AssembledModel, correlation: Correlation) -> tuple[SheetEntry, ...]:
    """Lines of the commissioning sheet that apply to a model, in its units.

    Parameters
    ----------
    assembled : AssembledModel
    correlation : mapping of (str, str) to float
        Of the estimates' errors, for the intervals of quantities that follow from several parameters.
    """
    return (
        *_inertia_entries(assembled, correlation),
        *_oscillation_entries(assembled),
        *_friction_entries(assembled, correlation),
        *_constant_load_entries(assembled.model),
        *_gap_entries(assembled),
        *_delay_entries(assembled.model),
    )


def _drive_words(model: Model) -> tuple[str, str, str]:
    """Names of inertia, friction and constant load in this drive."""
    inertia = "inertia" if model.is_rotary else "mass"
    kind = {"N m": "torque", "N": "force"}.get(model.input.unit)
    if kind is None:
        return inertia, "friction, as input,", "constant load, as input"
    return inertia, f"friction {kind}", f"constant {kind} on the drive"


def _inertia_entries(assembled: AssembledModel, correlation: Correlation) -> Iterator[SheetEntry]:
    model = assembled.model
    names = [name for name, q in model.structure.parameters.items() if q.dimension == INERTIA]
    word, _, _ = _drive_words(model)
    unit, factor = model.units.of(INERTIA)
    motor = names[model.input.mass - 1]
    loads = [name for name in names if name != motor]

    def quantities(sets: Mapping[str, Array]) -> Array:
        load = sum((sets[name] for name in loads), start=np.zeros_like(sets[motor]))
        return np.array([(sets[motor] + load) * factor, load / sets[motor]])

    (total, ratio), ends = _values_of(assembled, quantities), intervals(assembled, correlation, quantities)
    yield SheetEntry(f"total {word}", total, unit, ends[0], " + ".join(names))
    if loads:
        load = " + ".join(loads)
        note = f"({load}) / {motor}" if len(loads) > 1 else f"{load} / {motor}"
        yield SheetEntry(f"{word} ratio, load to motor", ratio, "", ends[1], note)


def _values_of(assembled: AssembledModel, quantities: Callable[[Mapping[str, Array]], Array]) -> list[float]:
    """Quantities of the model itself."""
    one = {name: np.array([value]) for name, value in assembled.values.items()}
    return [float(value) for value in quantities(one)[:, 0]]


def _oscillation_entries(assembled: AssembledModel) -> Iterator[SheetEntry]:
    analysis = assembled.analysis
    if analysis is None:
        return
    for word, modes in (("resonance", analysis.resonances), ("antiresonance", analysis.antiresonances())):
        for number, mode in enumerate(modes, start=1):
            which = word if len(modes) == 1 else f"{word} {number}"
            note = "at position 0; elsewhere it is another one" if assembled.varies_with_position else ""
            yield SheetEntry(f"{which} frequency", mode.frequency, "Hz", note=note)
            yield SheetEntry(f"{which}, damping ratio", mode.damping, "")


def _friction_entries(assembled: AssembledModel, correlation: Correlation) -> Iterator[SheetEntry]:
    model = assembled.model
    unit, factor = model.units.of(TORQUE)
    speed_unit, per_speed = model.units.of(SPEED)
    _, word, _ = _drive_words(model)
    top = assembled.settings.speed_scale
    masses = tuple(friction_elements(assembled.system))
    for mass in masses:

        def quantities(sets: Mapping[str, Array], mass: int = mass) -> Array:
            elements = friction_elements(assembled.with_values(sets))[mass]
            still = friction_at(elements, np.zeros(1), standstill=True)
            forward, backward = (np.sign(v) * friction_at(elements, np.array([v])) for v in (top, -top))
            shape = (1, len(next(iter(sets.values()))))
            return np.concatenate([np.broadcast_to(part * factor, shape) for part in (still, forward, backward)])

        values, ends = _values_of(assembled, quantities), intervals(assembled, correlation, quantities)
        where = "" if len(masses) == 1 else f" of mass {mass}"
        at = f"at {significant(top * per_speed, 3)} {speed_unit}"
        yield SheetEntry(f"{word}{where} at standstill", values[0], unit, ends[0], "as the speed goes to zero")
        if np.isclose(values[1], values[2], rtol=1e-9):
            yield SheetEntry(f"{word}{where} {at}", values[1], unit, ends[1], "largest speed of the recording")
            continue
        for which, value, interval in zip(("forward", "backward"), values[1:], ends[1:], strict=True):
            note = f"largest speed of the recording, {which}"
            yield SheetEntry(f"{word}{where} {at}, {which}", value, unit, interval, note)


def _constant_load_entries(model: Model) -> Iterator[SheetEntry]:
    """Parameters of laws that depend on no state."""
    _, _, word = _drive_words(model)
    for placed in model.structure.placed:
        law = placed.effect.law
        if law is not None and law.ports == 0:
            for symbol in law.parameters:
                name = placed.parameter(symbol)
                part = model.parameters[name]
                note = f"{name}, positive in the direction of positive motion"
                where = "" if placed.place == 1 else f" at mass {placed.place}"
                yield SheetEntry(f"{word}{where}", part.value, part.unit, part.ci95, note)


def _gap_entries(assembled: AssembledModel) -> Iterator[SheetEntry]:
    """Whole gaps; the parameter of the effect is half of one."""
    model = assembled.model
    unit, factor = model.units.of(POSITION)
    for e in assembled.system.elements:
        if e.limits is not None:
            width = float(e.limits.upper - e.limits.lower) * factor
            name = model.placed(e).parameter(e.law.parameters[0])
            ends = model.parameters[name].ci95
            share = width / model.parameters[name].value
            interval = None if ends is None else (share * ends[0], share * ends[1])
            place = model.placed(e).place
            where = "at the load" if model.structure.masses == 2 else f"between masses {place} and {place + 1}"
            yield SheetEntry(f"backlash {where} (whole gap)", width, unit, interval, f"{share:g} {name}")


def _delay_entries(model: Model) -> Iterator[SheetEntry]:
    """Times by which the input comes late."""
    late = [name for name, q in model.structure.parameters.items() if q.lag]
    for name in late:
        part = model.parameters[name]
        yield SheetEntry(model.structure.parameters[name].about, part.value, part.unit, part.ci95, name)
    if len(late) > 1:
        unit = model.parameters[late[0]].unit
        total = sum(model.parameters[name].value for name in late)
        yield SheetEntry("total delay of the input", total, unit, None, " + ".join(late))
