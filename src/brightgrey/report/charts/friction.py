"""Friction over speed from the laws of the model, with the uncertainty band of its parameters."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import SPEED, TORQUE, Element
from brightgrey.kit import StateSpace
from brightgrey.kit.in_words import effects_in_words, enumerated
from brightgrey.report.charts.chart import Chart, Line, Panel
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.report.quantities.assembled_model import AssembledModel
from brightgrey.report.quantities.propagation import Correlation, parameter_draws

__all__ = ["TORQUE", "friction_at", "friction_charts", "friction_elements"]


def friction_elements(system: StateSpace) -> dict[int, list[Element]]:
    """Elements that act against the motion of a mass by its speed, by the number of the mass."""
    speeds = [i for i, state in enumerate(system.states) if state.at_rest == "speed"]
    found: dict[int, list[Element]] = {}
    for e in system.elements:
        reads = np.unique(np.nonzero(e.H)[1]).tolist()
        if len(reads) == 1 and reads[0] in speeds:
            found.setdefault(speeds.index(reads[0]) + 1, []).append(e)
    return found


def friction_at(elements: list[Element], speed: Array, *, standstill: bool = False) -> Array:
    """Torque against the motion, shape (speeds, sets), N m (N).

    Parameters
    ----------
    elements : list of Element
        Of one mass.
    speed : ndarray, shape (speeds,)
        rad/s (m/s).
    standstill : bool
        Leave out the smoothing of the sign: the torque that has to be overcome to start moving.
    """
    v = speed[:, None]
    total = np.zeros((speed.size, 1))
    for e in elements:
        p = tuple(np.atleast_1d(value)[None, :] for value in e.p)
        if e.law.amplitude is not None and (standstill or e.has_exact_sign):
            size = e.law.amplitude(np.abs(v), p[:-1])[0]
            total = total + (size if standstill else np.sign(v) * size)
        else:
            total = total - e.law.value((v,), p)[0]
    return np.asarray(total)


def friction_charts(assembled: AssembledModel, correlation: Correlation) -> tuple[Chart, ...]:
    """Friction torque over speed of every mass that has friction.

    Parameters
    ----------
    assembled : AssembledModel
    correlation : mapping of (str, str) to float
        Of the estimates' errors; without it there is no band.
    """
    by_mass = friction_elements(assembled.system)
    if not by_mass:
        return ()
    sets = parameter_draws(assembled, correlation, REPORT_OPTIONS.friction_draws)
    drawn = friction_elements(assembled.with_values(sets)) if sets else {}
    return tuple(_friction_chart(assembled, mass, elements, drawn.get(mass)) for mass, elements in by_mass.items())


def _friction_chart(
    assembled: AssembledModel, mass: int, elements: list[Element], drawn: list[Element] | None
) -> Chart:
    model = assembled.model
    grid = np.linspace(-1.0, 1.0, REPORT_OPTIONS.friction_points)
    speed = assembled.settings.speed_scale * np.sign(grid) * np.abs(grid) ** 2  # denser near standstill
    speed_unit, per_speed = model.units.of(SPEED)
    torque_unit, per_torque = model.units.of(TORQUE)
    curve = friction_at(elements, speed)[:, 0] * per_torque
    x = speed * per_speed
    lines = []
    if drawn:
        low, high = np.percentile(friction_at(drawn, speed) * per_torque, (2.5, 97.5), axis=1)
        lines.append(Line(x, high, "95 % band", "measured", "band", low=low))
    lines.append(Line(x, curve, "estimate", "simulated", width=1.6))
    panel = Panel(
        y_label=f"friction against\nthe motion in {torque_unit}",
        lines=tuple(lines),
        x_label=f"speed of mass {mass} in {speed_unit}",
        levels=(0.0,),
    )
    names = enumerated(effects_in_words(dict.fromkeys(model.placed(e) for e in elements)))
    caption = f"Sum of {names} over the speeds of the recording, with the width of the reversal at standstill."
    if drawn:
        draws = REPORT_OPTIONS.friction_draws
        caption += f" The band holds 95 % of {draws} draws from the joint distribution of the estimates."
    return Chart("friction", (panel,), caption)
