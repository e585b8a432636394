"""Torque over the position of a mass, or over the twist of a shaft, where the model has more than a linear spring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import POSITION, TORQUE, Element
from brightgrey.kit import StateSpace
from brightgrey.kit.in_words import effects_in_words, enumerated
from brightgrey.model.trace import Trace
from brightgrey.report.charts.backlash import simulated_states
from brightgrey.report.charts.chart import Chart, Line, Panel
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.report.quantities.assembled_model import AssembledModel

__all__ = ["position_elements", "position_torque_charts"]


def position_elements(system: StateSpace) -> dict[tuple[int, ...], list[Element]]:
    """Elements with a torque over the position of a mass, or over a twist, by the numbers of one or two masses."""
    positions = [i for i, state in enumerate(system.states) if state.at_rest == "position"]
    found: dict[tuple[int, ...], list[Element]] = {}
    for e in system.elements:
        reads = np.unique(np.nonzero(e.H)[1]).tolist()
        if reads and e.law.ports == 1 and e.limits is None and set(reads) <= set(positions):
            found.setdefault(tuple(positions.index(i) + 1 for i in reads), []).append(e)
    return found


def position_torque_charts(assembled: AssembledModel, traces: Sequence[Trace]) -> tuple[Chart, ...]:
    """One curve for each mass or shaft, over the positions that the model runs through in the first recording.

    Parameters
    ----------
    assembled : AssembledModel
    traces : sequence of Trace
    """
    found = position_elements(assembled.system)
    if not found or not traces or not assembled.model.initial_state:
        return ()
    states = simulated_states(assembled, traces[0])
    if not np.isfinite(states).all():
        return ()
    return tuple(_curve(assembled, masses, elements, states) for masses, elements in found.items())


def _curve(assembled: AssembledModel, masses: tuple[int, ...], elements: list[Element], states: Array) -> Chart:
    model = assembled.model
    course = np.tensordot(np.reshape(elements[0].H, (1, -1)), states, 1)[0]
    x = np.linspace(course.min(), course.max(), REPORT_OPTIONS.friction_points)
    torque = -np.sum([e.law.value((x,), e.p)[0] for e in elements], axis=0)
    motion_unit, per_motion = model.units.of(POSITION)
    torque_unit, per_torque = model.units.of(TORQUE)
    names = enumerated(effects_in_words(dict.fromkeys(model.placed(e) for e in elements)))
    word = "torque" if model.is_rotary else "force"
    lines, where = [], f"position of mass {masses[0]}"
    caption = f"{word.capitalize()} by {names}, against the motion to larger positions, over the simulated positions."
    if len(masses) == 2:
        linear = assembled.values[f"c{masses[0]}"] * x
        lines = [Line(x * per_motion, linear * per_torque, "linear part", "soft", "dashed")]
        torque, where = torque + linear, f"twist between mass {masses[0]} and {masses[1]}"
        caption = f"{word.capitalize()} in the shaft without its damper, with {names}, over the simulated twist."
    lines.append(Line(x * per_motion, torque * per_torque, "model" if lines else "", "simulated", width=1.6))
    panel = Panel(
        y_label=f"{word}\nin {torque_unit}", lines=tuple(lines), x_label=f"{where} in {motion_unit}", levels=(0.0,)
    )
    return Chart("position", (panel,), caption)
