"""Drives that a self-test simulates: the found model, its rivals, and the model with an effect at a relevant size."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from brightgrey.estimation.problem.simulation_error import predict_many
from brightgrey.kit import Placed, Structure
from brightgrey.recordings import Recording
from brightgrey.search import IdentificationTask
from brightgrey.search.detectability import relevant_sizes
from brightgrey.search.fitting.refined_fit import accurate
from brightgrey.self_test.sensor_noise import SensorNoise

__all__ = ["DriveKind", "SimulatedDrive", "measured", "simulated_drives"]

DriveKind = Literal["found", "equivalent", "with effect"]


@dataclass(frozen=True)
class SimulatedDrive:
    """Drive whose structure and parameters are known."""

    kind: DriveKind
    structure: Structure
    values: Mapping[str, float]  #: SI, nuisances included.
    effect: str = ""  #: That it has beside the found model.
    without: Structure | None = None  #: The found model's structure, if it has an effect more.
    size: Mapping[str, float] = field(default_factory=dict)  #: Of that effect, SI.


def simulated_drives(
    task: IdentificationTask, minimal: Sequence[tuple[Structure, Mapping[str, float]]], not_needed: Iterable[str]
) -> tuple[tuple[SimulatedDrive, ...], ...]:
    """Drives of a self-test; where an effect may have two signs, both stand beside each other and are drawn in turn.

    Parameters
    ----------
    task : IdentificationTask
    minimal : sequence of (Structure, mapping of str to float)
        Minimal structures with their values, SI, the found one first.
    not_needed : iterable of str
        Effects that the recordings refute at the size that matters.
    """
    (own, values), *rivals = minimal
    drives: list[tuple[SimulatedDrive, ...]] = [(SimulatedDrive("found", own, values),)]
    drives += [(SimulatedDrive("equivalent", s, known),) for s, known in rivals]
    for effect in not_needed:
        big = _with_effect(own, effect)
        sizes = relevant_sizes(task, values, effect)
        start = task.default_start(big)
        made = tuple(
            SimulatedDrive("with effect", big, {**start, **values, **size}, effect, own, size) for size in sizes
        )
        drives += [made] if made else []
    return tuple(drives)


def _with_effect(structure: Structure, effect: str) -> Structure:
    """Structure with one effect more; further masses take the place of those that it has."""
    placed = Placed.parse(effect)
    kept = [p for p in structure.placed if not (placed.effect.masses and p.effect.masses)]
    return Structure((*kept, placed))


def measured(
    task: IdentificationTask, drive: SimulatedDrive, noises: Sequence[SensorNoise], rng: np.random.Generator
) -> tuple[Recording, ...]:
    """Recordings of a simulated drive with the recorded inputs, as the sensors would have taken them."""
    problem, settings = task.problem(drive.structure), accurate(task).settings
    start = {part.name: part.start for part in problem.nuisances}
    names = (*drive.structure.parameters, *start)
    values = {name: np.array([{**start, **drive.values}[name]]) for name in names}
    made, left = [], iter(noises)
    for r, state in zip(task.recordings, problem.initial_states, strict=True):
        y = predict_many(drive.structure, values, r, settings, initial_state=state)[:, :, 0]
        rows = [next(left).measure(row, rng) for row in y]
        made.append(replace(r, y=np.array(rows), source=None))
    return tuple(made)
