"""Fault detection with an identified model. Inside, all values are SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brightgrey.api.to_si import check_signals_of_model
from brightgrey.arguments import checked_arguments
from brightgrey.control.faults.detection import FaultCase, FaultFinding, detect_faults
from brightgrey.control.filters.extended_kalman import FilterResult, Noise
from brightgrey.control.filters.gaussian_sum import gaussian_sum_filter
from brightgrey.control.filters.setup import PreparedRecording, estimate_noise, prepare
from brightgrey.model.model import Model
from brightgrey.recordings import Recording

__all__ = ["Watch", "innovation_correlation", "watch"]


@dataclass(frozen=True)
class Watch:
    """Result of fault detection in one recording.

    Attributes
    ----------
    prepared : PreparedRecording
        Coordinates and data of the filter.
    filtered : FilterResult
        Estimated states and innovations, SI.
    noise : Noise
        From the recording without fault.
    findings : tuple of FaultFinding
        One for each fault of the structure.
    """

    prepared: PreparedRecording
    filtered: FilterResult
    noise: Noise
    findings: tuple[FaultFinding, ...]


@checked_arguments
def watch(
    model: Model, recording: Recording, *, baseline: Recording, min_change: float = 0.1, confidence: float = 0.99
) -> Watch:
    """Run a Kalman filter over a new recording and look for faults.

    Parameters
    ----------
    model : Model
    recording : Recording
        With the model's signals.
    baseline : Recording
        A recording without fault, for the noise; best the one that the model was identified from.
    min_change : float
        Smallest relative change of interest, a ratio.
    confidence : float
        Probability at which a change is reported, 0.5 to 1 (a ratio).

    Returns
    -------
    Watch

    Raises
    ------
    SettingsError
        If `min_change` or `confidence` is out of range.
    RecordingError
        If the signals of a recording are not those of the model.
    """
    for came in (recording, baseline):
        check_signals_of_model(model, came)
    settings, values = model.settings_si(), model.values_si()
    noise = estimate_noise(model.structure, values, baseline, settings)
    std = {
        name: (part.std or 0.0) / model.units.of(model.structure.parameters[name].dimension)[1]
        for name, part in model.parameters.items()
    }
    case = FaultCase(values, recording, noise, std)
    (findings,) = detect_faults(model.structure, settings, [case], min_change=min_change, confidence=confidence)
    prepared = prepare(model.structure, values, recording, settings)
    return Watch(prepared, gaussian_sum_filter(prepared.filter_input, noise), noise, findings)


def innovation_correlation(filtered: FilterResult) -> float:
    """Correlation of neighbouring innovations: 0 if only noise is left, near 1 for a systematic error of the model."""
    white = filtered.normalised_innovations[1:, 0]
    return float(np.mean(white[1:] * white[:-1]) / np.mean(white**2))
