"""Hysteresis loop of a shaft with a gap (the paper's figure 3), as the model runs through it in the recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import POSITION, TORQUE, Element
from brightgrey.kit import StateSpace
from brightgrey.model.trace import Trace
from brightgrey.report.charts.chart import Chart, Line, Mark, Panel, thin
from brightgrey.report.quantities.assembled_model import AssembledModel
from brightgrey.simulation import response

__all__ = ["gap_charts", "loop", "simulated_states"]


def gap_charts(assembled: AssembledModel, traces: Sequence[Trace]) -> tuple[Chart, ...]:
    """Torque in the shaft over its twist, for every gap, in the first of the recordings."""
    gaps = [e for e in assembled.system.elements if e.limits is not None]
    if not gaps or not traces or not assembled.model.initial_state:
        return ()
    states = simulated_states(assembled, traces[0])
    if not np.isfinite(states).all():
        return ()
    return tuple(_loop_chart(assembled, e, states, traces[0]) for e in gaps)


def simulated_states(assembled: AssembledModel, trace: Trace) -> Array:
    """All states, shape (n, samples), SI, simulated with the input of a recording."""
    model, system = assembled.model, assembled.system
    n = len(system.states)
    every = replace(
        system,
        C=np.eye(n),
        D=np.zeros((n, 1)),
        outputs=system.state_names,
        derivative_rows=(-1,) * n,
    )
    initial = {part.recording: part.state for part in model.initial_state}
    state = initial.get(trace.name, model.initial_state[0].state)
    x0 = [state[s.name].value / model.units.of(s.dimension)[1] for s in system.states]
    u = trace.u / trace.input.factor
    return np.asarray(response(every, u, model.settings.sampling_time, x0, assembled.settings).y[:, :, 0])


def loop(system: StateSpace, gap: Element, values: Mapping[str, float], states: Array) -> tuple[Array, Array]:
    """Twist of the shaft with its gap, and the torque ``c tau + d tau'`` in it (eq. 4), shape (samples,), SI.

    Parameters
    ----------
    system : StateSpace
    gap : Element
        The element with limits.
    values : mapping of str to float
        SI.
    states : ndarray, shape (n, samples)
        SI.
    """
    assert gap.limits is not None
    place = int(gap.name.partition("@")[2])
    q_i, q_j, v_i, v_j = (
        system.state_names.index(s) for s in (f"q{place}", f"q{place + 1}", f"v{place}", f"v{place + 1}")
    )
    rate, _ = gap.law.value(tuple(gap.H @ states), gap.p)  # of the position in the gap
    twist = states[q_i] - states[q_j]
    rest = twist - states[gap.limits.state]
    return twist, np.asarray(values[f"c{place}"] * rest + values[f"d{place}"] * (states[v_i] - states[v_j] - rate))


def _loop_chart(assembled: AssembledModel, gap: Element, states: Array, trace: Trace) -> Chart:
    model = assembled.model
    twist, torque = loop(assembled.system, gap, assembled.values, states)
    assert gap.limits is not None
    place = int(gap.name.partition("@")[2])
    motion_unit, per_motion = model.units.of(POSITION)
    torque_unit, per_torque = model.units.of(TORQUE)
    _, x, y = thin(trace.t, twist * per_motion, torque * per_torque)
    panel = Panel(
        y_label=f"torque in the shaft\nin {torque_unit}",
        lines=(Line(x, y, "", "simulated", width=0.9),),
        x_label=f"twist between mass {place} and {place + 1} in {motion_unit}",
        levels=(0.0,),
        marks=(Mark(float(gap.limits.lower) * per_motion, "-2 alpha"), Mark(float(gap.limits.upper) * per_motion, "0")),
    )
    caption = (
        f"Simulated motion of the shaft in {trace.name}. Between the two marks the gap is open and carries no torque."
    )
    return Chart("backlash", (panel,), caption)
