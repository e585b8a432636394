"""Measured and simulated outputs side by side, in the recording's units."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.residual_analysis import nrmse_fit_percent
from brightgrey.model.schema import OutputFitPart
from brightgrey.recordings import Recording, Signal

__all__ = ["Trace", "pooled_fit"]


@dataclass(frozen=True)
class Trace:
    """One recording with the simulation of a model under its input."""

    name: str  #: Name of the recording.
    t: Array  #: Time in s, shape (samples,).
    u: Array  #: Input in `input.unit`, shape (samples,).
    #: Outputs in their own units. Simulated values are NaN from where the simulation diverged. Shape (outputs,
    #: samples).
    measured: Array
    simulated: Array
    input: Signal
    outputs: tuple[Signal, ...]
    test: bool = False  #: The recording was not used to identify the model.

    @classmethod
    def of(cls, recording: Recording, simulated: Array, *, test: bool = False) -> Trace:
        """Trace of `recording` and `simulated`, shape (outputs, samples) in SI units."""
        factors = np.array([signal.factor for signal in recording.outputs])[:, None]
        return cls(
            name=recording.name,
            t=recording.t,
            u=recording.u * recording.input.factor,
            measured=recording.y * factors,
            simulated=simulated * factors,
            input=recording.input,
            outputs=recording.outputs,
            test=test,
        )

    @property
    def residual(self) -> Array:
        """Measured minus simulated, shape (outputs, samples)."""
        return self.measured - self.simulated

    def csv_text(self) -> str:
        """Time, input, and each output measured and simulated, as CSV; floats read back exactly."""
        text = io.StringIO()
        names = ["t [s]", f"{self.input.name} [{self.input.unit}]"]
        columns = [self.t, self.u]
        for signal, measured, simulated in zip(self.outputs, self.measured, self.simulated, strict=True):
            names += [f"{signal.name} [{signal.unit}]", f"{signal.name} simulated [{signal.unit}]"]
            columns += [measured, simulated]
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*(column.tolist() for column in columns), strict=True))
        return text.getvalue()


def pooled_fit(traces: Sequence[Trace]) -> Mapping[str, OutputFitPart]:
    """Fit by output name, all recordings taken together.

    fit_percent = 100 (1 - |y - ysim| / |y - mean y|), the mean taken per recording. A diverged simulation has
    no fit: all three are None.
    """
    fits = {}
    for row, signal in enumerate(traces[0].outputs):
        rss = sum(float(np.sum(trace.residual[row] ** 2)) for trace in traces)
        variation = sum(float(np.sum((trace.measured[row] - trace.measured[row].mean()) ** 2)) for trace in traces)
        samples = sum(trace.t.size for trace in traces)
        if np.isfinite(rss) and variation > 0.0:
            fit = OutputFitPart(
                rss=rss,
                rmse=float(np.sqrt(rss / samples)),
                fit_percent=nrmse_fit_percent(rss, variation),
            )
        else:
            fit = OutputFitPart(rss=None, rmse=None, fit_percent=None)
        fits[signal.name] = fit
    return fits
