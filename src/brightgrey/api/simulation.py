"""A model on a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from brightgrey import estimation
from brightgrey.api.to_si import check_signals_of_model
from brightgrey.arguments import checked_arguments
from brightgrey.errors import RecordingError
from brightgrey.estimation.diagnostics.instability import parting_text, parting_time
from brightgrey.model.model import Model
from brightgrey.model.schema import OutputFitPart
from brightgrey.model.trace import Trace, pooled_fit
from brightgrey.recordings import Recording, read_recording
from brightgrey.recordings.recording_toml import is_recording_toml, read_recordings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Simulation", "read_for", "simulate"]

NO_UNITS: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True)
class Simulation:
    """A model beside a recording.

    Attributes
    ----------
    model : Model
    trace : Trace
        Time in s, input, measured and simulated outputs in the recording's units.
    fit : mapping of str to OutputFitPart
        ``rss``, ``rmse`` and ``fit_percent`` by output name, in the outputs' units; None where the simulation
        diverged.
    notes : tuple of str
        Repairs of the recording, assumptions about it, and the time from which an unstable motion parts.
    """

    model: Model
    trace: Trace = field(repr=False)
    fit: Mapping[str, OutputFitPart]
    notes: tuple[str, ...] = ()

    def plot(self) -> Figure:
        """Measured against simulated, residual below."""
        from brightgrey.report.drawing.matplotlib_figure import comparison

        return comparison([self.trace])


@checked_arguments
def simulate(model: Model, recording: Recording) -> Simulation:
    """Simulate `model` with the input of `recording`, starting from the recording's first samples.

    Parameters
    ----------
    model : Model
    recording : Recording
        With signals of the kinds the model was identified from; :func:`read_for` reads one.

    Returns
    -------
    Simulation

    Raises
    ------
    RecordingError
        If the recording's signals are not those of the model.
    """
    check_signals_of_model(model, recording)
    settings = replace(model.settings_si(), hold=recording.hold)
    simulated = estimation.predict(model.structure, model.values_si(), recording, settings)
    trace = Trace.of(recording, simulated)
    time = parting_time(model.structure, model.values_si(), recording, settings)
    unstable = () if time is None else (f"{recording.name}: {parting_text(time)}",)
    return Simulation(model, trace, pooled_fit([trace]), (*recording.notes, *_own_values(model, recording), *unstable))


def _own_values(model: Model, recording: Recording) -> tuple[str, ...]:
    """Note on parameters that had values of their own in a recording when the model was identified."""
    names = [
        name
        for name, part in model.parameters.items()
        if any(own.recording == recording.name for own in part.in_recordings or ())
    ]
    if not names:
        return ()
    return (f"{recording.name}: it was fitted with its own {', '.join(names)}, and is simulated with their mean",)


@checked_arguments
def read_for(
    model: Model,
    path: str | Path,
    *,
    time: str | None = None,
    dt: float | None = None,
    units: Mapping[str, str] = NO_UNITS,
) -> Recording:
    """Read a recording with the columns, kinds, units, gain and hold that `model` was identified from.

    Parameters
    ----------
    model : Model
    path : str or Path
        Or a recording.toml, which says all itself.
    time, dt
        As for :func:`read_recording`.
    units : mapping of str to str
        Units of columns that stand in other units than the model's.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        If a column is missing, its header says another unit than the model, or the file cannot be used.
    """
    if is_recording_toml(path):
        several = read_recordings(path, {"dt": dt, "time": time} if dt or time else None, stretches=False)
        if len(several) > 1:
            raise RecordingError(f"{path} names {len(several)} recordings; one is wanted here")
        return several[0]

    def read(units: Mapping[str, str]) -> Recording:
        recording = read_recording(
            path,
            input=model.input.name,
            outputs=[(s.name, s.sensor) for s in model.outputs],
            time=time,
            dt=dt,
            input_gain=model.input.gain,
            actuator=model.input.mass,
            units=units,
            hold=model.settings.hold,
        )
        return _with_gains(recording, [signal.gain for signal in model.outputs])

    signals = (model.input, *model.outputs)
    recording = read({**{s.name: s.unit for s in signals}, **units})
    try:
        by_header = read(units)
    except RecordingError:  # units that only the model can tell
        return recording
    for expected, came in zip(signals, (by_header.input, *by_header.outputs), strict=True):
        # With a gain the header is about other numbers than the model: counts, parts of a rated value.
        plain = expected.gain == 1.0 and came.name not in units
        if came.unit_given and came.unit != expected.unit and plain:
            raise RecordingError(
                f"{recording.name}: column '{came.name}' is in {came.unit}, the model was identified from "
                f"{expected.unit}; say which one is right, for example --unit '{came.name}={came.unit}'"
            )
    return recording


def _with_gains(recording: Recording, gains: list[float]) -> Recording:
    """Return a recording with its outputs times their gains."""
    if all(gain == 1.0 for gain in gains):
        return recording
    factors = np.array(gains)
    return replace(
        recording,
        y=recording.y * factors[:, None],
        resolution=recording.resolution * np.abs(factors),
        outputs=tuple(replace(s, gain=gain) for s, gain in zip(recording.outputs, gains, strict=True)),
    )
