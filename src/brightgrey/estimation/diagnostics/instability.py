"""Unstable motions: a small shift grows, so that a simulation parts from the recording whatever the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.problem.initial_state import InitialState
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import Structure
from brightgrey.recordings import Recording, Signal
from brightgrey.simulation import Settings

__all__ = ["instability_findings", "parting_text", "parting_time"]

_POSITION = (Signal("position", "position", "rad"),)


@dataclass(frozen=True)
class InstabilityOptions:
    """Size of the shift that shows an unstable motion."""

    shift: float = 1e-3  #: Of the first position, as a part of the travel.
    growth: float = 100.0  #: Factor by which it has to grow.


INSTABILITY_DEFAULTS = InstabilityOptions()


def parting_time(
    structure: Structure,
    values: Mapping[str, float],
    recording: Recording,
    settings: Settings,
    state: InitialState | None = None,
    options: InstabilityOptions = INSTABILITY_DEFAULTS,
) -> float | None:
    """Time from the first sample, s, after which a simulation says nothing, because the motion is unstable.

    An arm that stands upright falls to one side or the other. A model that is off by little then parts from the
    recording. The first position is shifted by a thousandth of the travel. A stable drive keeps or loses that shift.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        Parameters and nuisances, SI.
    recording : Recording
        Gives the input.
    settings : Settings
    state : InitialState, optional
        By default that of the recording with nothing to estimate.
    options : InstabilityOptions

    Returns
    -------
    float or None
        None for a motion that is stable, or that no torque can make unstable.
    """
    if not structure.may_be_unstable:
        return None
    empty = replace(recording, outputs=_POSITION, y=np.zeros((1, recording.samples)), resolution=np.ones(1))
    start = InitialState.of(recording, "samples") if state is None else state
    first = f"position(0){start.tag}"
    arrays = {name: np.array([value]) for name, value in values.items()}

    def position(shift: float) -> Array:
        shifted = arrays | {first: np.array([values.get(first, start.position) + shift])}
        return np.asarray(predict_many(structure, shifted, empty, settings, initial_state=start)[0, :, 0])

    undisturbed = position(0.0)
    shift = options.shift * float(np.ptp(undisturbed))
    if not np.isfinite(shift) or shift == 0.0:
        return None
    apart = np.abs(position(shift) - undisturbed) >= options.growth * shift
    return float(np.argmax(apart)) * recording.dt if apart.any() else None


def instability_findings(
    problem: SimulationErrorProblem, values: Mapping[str, float], settings: Settings
) -> list[Finding]:
    """Report the recordings whose motion is unstable for values of all parameters, with the time until that shows."""
    found = []
    for r, state in zip(problem.recordings, problem.initial_states, strict=True):
        time = parting_time(problem.structure, values, r, settings, state)
        if time is not None:
            found.append(Finding("unstable", parting_text(time, r.name if len(problem.recordings) > 1 else "")))
    return found


def parting_text(time: float, name: str = "") -> str:
    """Sentence about an unstable motion, without its full stop."""
    return (
        f"{name}{': ' if name else ''}the motion is unstable: a shift of the first position by a thousandth of the "
        f"travel grows a hundredfold within {time:.3g} s, so that model and recording part from there on"
    )
