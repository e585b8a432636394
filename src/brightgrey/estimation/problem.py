"""Residuals of a structure on recordings, for many parameter sets side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.scales import speed_of
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response

__all__ = ["Problem", "initial_state", "noise_of", "predict_many"]

Array = NDArray[np.float64]
_AT_REST = 0.1  # of the largest speed
_FIRST = 10  # samples that tell the speed at the start
_LOST = 10.0  # residual of a diverged simulation, in standard deviations of the output


def initial_state(recording: Recording, system: StateSpace) -> Array:
    """State, shape (n,), before the first sample.

    Position is the first measured one; the axis is at rest unless the first samples clearly move (a tenth of
    the largest speed): a free initial speed would be abused to absorb drift. All masses move alike, no shaft is
    wound up, and T is the first input.
    """
    kinds = [signal.kind for signal in recording.outputs]
    position = float(recording.y[kinds.index("position")][0]) if "position" in kinds else 0.0
    course = speed_of(recording)
    speed = float(np.mean(course[:_FIRST]))
    if abs(speed) < _AT_REST * float(np.abs(course).max()):
        speed = 0.0
    return system.rest(position, speed, float(recording.u[0]))


def noise_of(recording: Recording) -> Array:
    """Noise of each output, shape (outputs,), SI: from second differences, at least the resolution's."""
    bend = np.diff(recording.y, n=2, axis=1)
    spread = 1.4826 * np.median(np.abs(bend), axis=1) / np.sqrt(6.0)
    least = np.maximum(recording.resolution / np.sqrt(12.0), 1e-12 * recording.y.std(axis=1))
    return np.asarray(np.maximum(spread, least))


def predict_many(
    structure: Structure,
    values: Mapping[str, Array],
    recording: Recording,
    settings: Settings,
    *,
    initial: Mapping[str, float] | None = None,
    frozen: bool = False,
    threads: int = 1,
) -> Array:
    """Simulated outputs of K parameter sets, shape (outputs, samples, K), SI; not-a-number where diverged."""
    kinds = [signal.kind for signal in recording.outputs]
    outputs = ["position" if kind == "velocity-differenced" else kind for kind in kinds]
    system = assemble(structure, values, settings.f_tanh, outputs)
    x0 = (
        initial_state(recording, system)
        if initial is None
        else np.array([initial[state.name] for state in system.states])
    )
    y = response(system, recording.u, recording.dt, x0, settings, frozen=frozen, threads=threads).y
    for out, kind in enumerate(kinds):
        if kind == "velocity-differenced":
            before = y[out, :1] - recording.dt * x0[system.state_names.index("v1")]
            y[out] = np.diff(y[out], axis=0, prepend=before) / recording.dt
    return y


@dataclass(frozen=True)
class Problem:
    """Weighted residuals of `structure` on `recordings`.

    Attributes
    ----------
    structure : Structure
    recordings : tuple of Recording
    weights : ndarray, shape (outputs,)
        1 over the noise of each output; a noise below a thousandth of the output's spread counts as that, so
        that a fine sensor does not silence the others.
    threads : int
    """

    structure: Structure
    recordings: tuple[Recording, ...]
    weights: Array
    threads: int = 1

    @classmethod
    def of(cls, structure: Structure, recordings: Sequence[Recording], threads: int = 1) -> Problem:
        """Problem with weights from the recordings' noise."""
        noise = np.median([noise_of(r) for r in recordings], axis=0)
        spread = np.max([r.y.std(axis=1) for r in recordings], axis=0)
        floor = np.maximum(noise, 1e-3 * spread)
        return cls(structure, tuple(recordings), 1.0 / np.where(floor > 0.0, floor, 1.0), threads)

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return sum(r.y.size for r in self.recordings)

    def residuals(self, values: Mapping[str, Array], settings: Settings, *, frozen: bool = False) -> Array:
        """Weighted residuals, shape (residuals, K): simulated minus measured; large but finite if diverged."""
        parts = []
        for r in self.recordings:
            y = predict_many(self.structure, values, r, settings, frozen=frozen, threads=self.threads)
            apart = (y - r.y[:, :, None]) * self.weights[:, None, None]
            lost = _LOST * (r.y.std(axis=1) * self.weights)[:, None, None]
            apart = np.where(np.isfinite(apart), np.clip(apart, -1e6, 1e6), np.maximum(lost, 1.0))
            parts.append(apart.reshape(-1, apart.shape[-1]))
        return np.concatenate(parts)
