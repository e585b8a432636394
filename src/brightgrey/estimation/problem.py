"""Residuals of a structure on recordings, for many parameter sets side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.normal import LARGEST, add_products, add_squares
from brightgrey.estimation.scales import speed_of
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response

__all__ = ["Problem", "initial_state", "noise_of", "predict_many"]

Array = NDArray[np.float64]
_AT_REST = 0.1  # of the largest speed
_FEWEST = 100  # samples of a beginning
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
    group: int = 1,
    threads: int = 1,
) -> Array:
    """Simulated outputs of K parameter sets, shape (outputs, samples, K), SI; not-a-number where diverged."""
    kinds = [signal.kind for signal in recording.outputs]
    outputs = ["position" if kind == "velocity-differenced" else kind for kind in kinds]
    system = assemble(structure, values, settings.f_tanh, outputs)
    x0 = initial_state(recording, system)
    if initial is not None:
        x0 = np.array([initial[state.name] for state in system.states])
    y = response(system, recording.u, recording.dt, x0, settings, group=group, threads=threads).y
    for out, kind in enumerate(kinds):
        if kind == "velocity-differenced":
            before = y[out, :1] - recording.dt * x0[system.state_names.index("v1")]
            y[out] = np.diff(y[out], axis=0, prepend=before) / recording.dt
    return y


def _beginning(recording: Recording, share: float) -> Recording:
    """Cut to the samples in which the input does `share` of what it does, counted by its magnitude and its changes."""
    r = recording
    size, change = np.abs(r.u), np.abs(np.diff(r.u, prepend=r.u[0]))
    work = np.cumsum(size / max(size.sum(), 1e-300) + change / max(change.sum(), 1e-300))
    samples = int(np.searchsorted(work, share * work[-1])) + 1
    samples = int(np.clip(samples, min(_FEWEST, r.samples), r.samples))
    return replace(r, t=r.t[:samples], u=r.u[:samples], y=r.y[:, :samples])


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

    def residuals(self, values: Mapping[str, Array], settings: Settings, *, group: int = 1) -> Array:
        """Weighted residuals, shape (residuals, K): simulated minus measured; large but finite if diverged."""
        parts = []
        for r in self.recordings:
            y = predict_many(self.structure, values, r, settings, group=group, threads=self.threads)
            apart = (y - r.y[:, :, None]) * self.weights[:, None, None]
            lost = self._lost(r)[:, None, None]
            apart = np.where(np.isfinite(apart), np.clip(apart, -LARGEST, LARGEST), lost)
            parts.append(apart.reshape(-1, apart.shape[-1]))
        return np.concatenate(parts)

    def products(
        self,
        values: Mapping[str, Array],
        settings: Settings,
        width: int,
        lane: NDArray[np.int64],
        per_step: Array,
    ) -> Array:
        """Products of residual and derivatives, shape (S, 1 + P, 1 + P), lower triangles; see `add_products`.

        `values` hold S starts of equally many lanes, led by the first of every `width`.
        """
        starts, count = per_step.shape
        total = np.zeros((starts, 1 + count, 1 + count))
        for r in self.recordings:
            y = predict_many(self.structure, values, r, settings, group=width, threads=self.threads)
            y = np.ascontiguousarray(y).reshape(*y.shape[:2], starts, -1)
            add_products(y, r.y, self.weights, self._lost(r), lane, per_step, total)
        return total

    def costs(self, values: Mapping[str, Array], settings: Settings) -> Array:
        """Sums of squared weighted residuals, shape (K,)."""
        total = np.zeros(len(next(iter(values.values()))))
        for r in self.recordings:
            y = predict_many(self.structure, values, r, settings, threads=self.threads)
            add_squares(np.ascontiguousarray(y), r.y, self.weights, self._lost(r), total)
        return total

    def _lost(self, r: Recording) -> Array:
        """Weighted residual of a simulation that has diverged, shape (outputs,)."""
        return np.asarray(np.maximum(_LOST * r.y.std(axis=1) * self.weights, 1.0))

    def beginning(self, share: float) -> Problem:
        """The same on the beginnings of the recordings, which hold `share` of what the input does."""
        return replace(self, recordings=tuple(_beginning(r, share) for r in self.recordings))
