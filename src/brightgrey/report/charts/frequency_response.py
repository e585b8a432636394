"""Frequency response of the linearised model beside the measured one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array, Complex
from brightgrey.control.linear.analysis import Analysis
from brightgrey.effects import SPEED
from brightgrey.model.model import Model
from brightgrey.model.trace import Trace
from brightgrey.numerics.digital_filter import csd
from brightgrey.numerics.number_format import significant
from brightgrey.report.charts.chart import Chart, Line, Mark, Panel
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.report.quantities.assembled_model import AssembledModel

__all__ = ["MeasuredResponse", "measured_response", "response_chart"]


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """Frequency response estimated from recordings."""

    frequency: Array  #: Hz, shape (m,).
    response: Complex  #: Output over input, complex, in the recording's units, shape (m,).
    coherence: Array  #: Share of the output's power that follows the input linearly, from 0 to 1, shape (m,).


def measured_response(traces: Sequence[Trace], row: int) -> MeasuredResponse | None:
    """Average response of one output to the input by Welch's method (H1), all recordings pooled.

    Returns
    -------
    MeasuredResponse or None
        None if the recordings are too short, or differ in their sampling.
    """
    steps = {round(float(trace.t[1] - trace.t[0]), 12) for trace in traces}
    length = min((2 * trace.t.size // (REPORT_OPTIONS.welch_segments + 1) for trace in traces), default=0)
    if len(steps) != 1 or length < REPORT_OPTIONS.min_segment:
        return None
    (dt,) = steps
    parts = []
    for trace in traces:
        u, y = trace.u, trace.measured[row]
        spectra = [csd(a, b, fs=1.0 / dt, nperseg=length)[1] for a, b in ((u, y), (u, u), (y, y))]
        parts.append(trace.t.size * np.array(spectra))
    cross, input_power, output_power = np.sum(parts, axis=0)[:, 1:]
    tiny = np.finfo(float).tiny
    coherence = np.abs(cross) ** 2 / np.maximum(input_power.real * output_power.real, tiny)
    frequency = np.arange(1, length // 2 + 1, dtype=np.float64) / (length * dt)
    return MeasuredResponse(frequency, np.asarray(cross / np.maximum(input_power.real, tiny)), np.asarray(coherence))


def response_chart(assembled: AssembledModel, traces: Sequence[Trace]) -> tuple[Chart, ...]:
    """Bode plot of every output, with resonances and antiresonances marked; none without a linear model."""
    analysis, model = assembled.analysis, assembled.model
    if analysis is None or not traces:
        return ()
    return tuple(_bode_chart(assembled, analysis, traces, row) for row in range(len(model.outputs)))


def _bode_chart(assembled: AssembledModel, analysis: Analysis, traces: Sequence[Trace], row: int) -> Chart:
    model, trace = assembled.model, traces[0]
    dt = model.settings.sampling_time
    low, high = 1.0 / (trace.t[-1] - trace.t[0]), 0.5 / dt
    modes = [*analysis.resonances, *analysis.antiresonances(row)]
    o = REPORT_OPTIONS
    sides = np.linspace(-2.0, 2.0, o.mode_points)  # none at 0, where an undamped mode has no finite response
    around = np.array([s.frequency * (1.0 + max(s.damping, o.min_damping) * at) for s in modes for at in sides])
    f = np.unique(np.concatenate([np.geomspace(low, high, o.bode_points), around[(around > low) & (around < high)]]))
    scale = model.outputs[row].factor / model.input.factor
    response = _differencing_response(model, row, f, dt) * analysis.bode(2.0 * np.pi * f)[1][row] * scale
    phase = np.unwrap(np.angle(response))
    modelled = Line(f, np.abs(response), "linearised model", "simulated", width=1.4)
    turned = Line(f, np.degrees(phase), "", "simulated", width=1.4)
    gains, phases = [modelled], [turned]
    shown = measured_response(traces, row)
    if shown is not None and (good := shown.coherence > REPORT_OPTIONS.min_coherence).any():
        at = shown.frequency[good]
        apart = np.angle(shown.response[good] / np.exp(1j * np.interp(at, f, phase)))
        gains.insert(0, Line(at, np.abs(shown.response[good]), "measured", "measured", "points", 2.6))
        phases.insert(0, Line(at, np.degrees(np.interp(at, f, phase) + apart), "", "measured", "points", 2.6))
    marks = [Mark(s.frequency, f"{significant(s.frequency, 3)} Hz") for s in analysis.resonances]
    marks += [Mark(s.frequency, f"{significant(s.frequency, 3)} Hz", left=True) for s in analysis.antiresonances(row)]
    inside = tuple(mark for mark in marks if low < mark.x < high)
    below = model.input.unit
    unit = f"{model.outputs[row].unit} / " + (f"({below})" if " " in below or "/" in below else below)
    panels = (
        Panel(f"gain in\n{unit}", tuple(gains), marks=inside, x_log=True, y_log=True, title=model.outputs[row].name),
        Panel("phase in degrees", tuple(phases), "frequency in Hz", x_log=True, height=0.6, marks=_unnamed(inside)),
    )
    return Chart("frequency", panels, _caption(assembled, analysis, measured=len(gains) > 1))


def _unnamed(marks: tuple[Mark, ...]) -> tuple[Mark, ...]:
    return tuple(Mark(mark.x, "") for mark in marks)


def _differencing_response(model: Model, row: int, f: Array, dt: float) -> Complex | float:
    """Response of a velocity made by differencing an encoder: the mean over a sampling interval, half of it late."""
    if model.outputs[row].kind != "velocity-differenced":
        return 1.0
    return np.asarray(np.sinc(f * dt) * np.exp(-1j * np.pi * f * dt))


def _caption(assembled: AssembledModel, analysis: Analysis, *, measured: bool) -> str:
    unit, factor = assembled.model.units.of(SPEED)
    text = f"Model linearised in steady motion at {significant(analysis.operating_point.speed * factor, 3)} {unit}"
    if assembled.varies_with_position:
        text += f" past position 0, where it is {analysis.stability}; elsewhere the resonances are others"
    text += ", the gap closed." if analysis.operating_point.contact_mode.limited_elements else "."
    if analysis.resonances:
        text += " Dotted lines mark resonances and antiresonances."
    if not measured:
        return f"{text} The coherence of the recording is too low at all frequencies to show a measured response."
    return (
        f"{text} The measured response (Welch's method, {REPORT_OPTIONS.welch_segments} segments with half overlap) is"
        f" shown where the coherence exceeds {REPORT_OPTIONS.min_coherence:g}. Friction lowers the coherence at low"
        " frequencies, where a linear model cannot be expected to fit. In a closed loop the noise of the sensor enters"
        " the measured response."
    )
