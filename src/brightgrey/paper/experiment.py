"""The paper's experiment (section 4) as a task for a search: reference recording, ranges, verdict on a result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from brightgrey.estimation import scales
from brightgrey.excitation import PAPER_EXPERIMENT, Experiment
from brightgrey.kit import PAPER, Structure
from brightgrey.paper.assumed import ASSUMED, RANGE, RESOLUTION
from brightgrey.recordings import Recording, Signal
from brightgrey.search.genetic.history import Run
from brightgrey.search.task import IdentificationTask
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference

__all__ = [
    "RecoveryVerdict",
    "assumed_bounds",
    "first_appearance",
    "recovery_verdict",
    "reference_recording",
    "task_of",
]

RecoveryVerdict = Literal["true", "true with extras", "other"]


def reference_recording(
    structure: Structure | None = None,
    values: Mapping[str, float] | None = None,
    experiment: Experiment = PAPER_EXPERIMENT,
    resolution: float = RESOLUTION,
) -> Recording:
    """Velocity at mass 1 of a known drive under the experiment's torque, by the reference solver, without noise.

    Parameters
    ----------
    structure : Structure, optional
    values : mapping of str to float, optional
        Its parameters, SI; the experiment's own drive by default.
    experiment : Experiment
    resolution : float
        Step in rad/s that velocity is rounded to.
    """
    torque = experiment.torque()
    (velocity,) = reference(
        str(structure or experiment.structure),
        values or experiment.values,
        torque,
        experiment.dt,
        f_tanh=experiment.f_tanh,
    )
    return Recording(
        name="reference",
        t=np.arange(experiment.samples, dtype=np.float64) * experiment.dt,
        u=torque,
        y=resolution * np.round(velocity / resolution)[None, :],
        input=Signal("torque", "input", "N m"),
        outputs=(Signal("velocity", "velocity", "rad/s"),),
        resolution=np.array([resolution]),
    )


def assumed_bounds(recording: Recording, assumed: Mapping[str, float] = ASSUMED) -> dict[str, tuple[float, float]]:
    """Ranges from half to twice the assumed values; parameters of either sign are centred on zero (section 4)."""
    known = scales(recording)
    declared = {name: q for s in PAPER.structures() for name, q in s.parameters.items()}
    low, high = RANGE
    return {
        name: (-high * value, high * value) if declared[name].bounds(known)[0] < 0.0 else (low * value, high * value)
        for name, value in assumed.items()
    }


def task_of(
    recording: Recording, experiment: Experiment = PAPER_EXPERIMENT, assumed: Mapping[str, float] = ASSUMED
) -> IdentificationTask:
    """Task to identify models on `recording` within the ranges of the paper's experiment; f_tanh is known."""
    known, bounds = scales(recording), assumed_bounds(recording, assumed)
    return IdentificationTask(
        recordings=(recording,),
        scales=known,
        settings=Settings(f_tanh=experiment.f_tanh, speed_scale=known.speed, level="fast", hold=recording.hold),
        bounds=bounds,
        start={name: assumed[name] if low > 0.0 else 0.0 for name, (low, _) in bounds.items()},
    )


def recovery_verdict(found: Structure, truth: Structure) -> RecoveryVerdict:
    """Compare a found structure with the true one: the same, the same with redundant extras, or another.

    Extras are further submodels, or more masses.
    """
    if found == truth:
        return "true"
    own, wanted = ({p for p in s.placed if not p.effect.masses} for s in (found, truth))
    return "true with extras" if wanted <= own and truth.masses <= found.masses else "other"


def first_appearance(run: Run, truth: Structure) -> int | None:
    """Generation in which `truth` first is in the population, None if it never is."""
    return next((e.generation for e in run.evaluations if e.job.structure == truth), None)
