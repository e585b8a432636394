"""Residuals of a structure on recordings, for many parameter sets side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Self

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.initial_state import Initial, InitialState, InitialStateParameter, output_noise
from brightgrey.estimation.problem.normal_equations import LARGEST, add_products, add_squares
from brightgrey.estimation.problem.output_feedback import measured_speed, with_output_feedback
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response, squares

__all__ = ["SimulationErrorProblem", "predict_many", "system_for", "systems"]

_FEWEST = 100  # samples of a beginning
_LOST = 10.0  # residual of a diverged simulation, in standard deviations of the output


def predict_many(
    structure: Structure,
    values: Mapping[str, Array],
    recording: Recording,
    settings: Settings,
    *,
    initial_state: InitialState | None = None,
    initial: Mapping[str, float] | None = None,
    group: int = 1,
    threads: int = 1,
    gain: float = 0.0,
) -> Array:
    """Simulated outputs of K parameter sets, shape (outputs, samples, K), SI; not-a-number where diverged.

    The initial state is `initial`, or else that of `onset`, whose unknown parts stand among the values. With a `gain`,
    in torque per speed, the simulation is held to the measured motion.
    """
    system, u, x0 = systems(
        structure, values, recording, settings, initial_state=initial_state, initial=initial, gain=gain
    )
    found = response(system, u, recording.dt, x0, settings, group=group, threads=threads)
    y, (sample, follower) = found.y, found.rejoined.T
    for out, signal in enumerate(recording.outputs):
        if signal.kind == "velocity-differenced":
            before = y[out, :1] - recording.dt * x0[system.state_names.index("v1")]  # it moved as it does at first
            y[out] = np.diff(y[out], axis=0, prepend=before) / recording.dt
            y[out, sample, follower] = y[out, sample, follower // group * group]  # going on elsewhere is no motion
    return y


def systems(
    structure: Structure,
    values: Mapping[str, Array],
    recording: Recording,
    settings: Settings,
    *,
    initial_state: InitialState | None = None,
    initial: Mapping[str, float] | None = None,
    gain: float = 0.0,
) -> tuple[StateSpace, Array, Array]:
    """K systems as :func:`system_for` makes them, their input, shape (samples,), and initial states, shape (n, K)."""
    system = system_for(structure, values, recording, settings)
    if initial is not None:
        x0 = np.array([[initial[state.name]] for state in system.states])
    else:
        x0 = (initial_state or InitialState.of(recording)).state(system, float(recording.u[0]), values)
    sets = max((np.size(values[name]) for name in structure.parameters), default=1)
    system, u = with_output_feedback(system, recording, gain)
    return system, u, np.broadcast_to(x0, (len(x0), sets))


def system_for(
    structure: Structure, values: Mapping[str, Array], recording: Recording, settings: Settings
) -> StateSpace:
    """K systems with the outputs of a recording; for a differenced velocity it is its position."""
    kinds = [signal.kind for signal in recording.outputs]
    outputs = ["position" if kind == "velocity-differenced" else kind for kind in kinds]
    return assemble(structure, {name: values[name] for name in structure.parameters}, settings.f_tanh, outputs)


def _beginning(recording: Recording, share: float) -> Recording:
    """Cut to the samples in which the input does `share` of what it does, counted by its magnitude and its changes."""
    r = recording
    size, change = np.abs(r.u), np.abs(np.diff(r.u, prepend=r.u[0]))
    work = np.cumsum(size / max(size.sum(), 1e-300) + change / max(change.sum(), 1e-300))
    samples = int(np.searchsorted(work, share * work[-1])) + 1
    samples = int(np.clip(samples, min(_FEWEST, r.samples), r.samples))
    return replace(r, t=r.t[:samples], u=r.u[:samples], y=r.y[:, :samples])


@cache
def _limited_states(structure: Structure) -> tuple[str, ...]:
    """Names of the states that are kept between limits, such as positions in gaps."""
    system = assemble(structure, dict.fromkeys(structure.parameters, 1.0), 1.0)
    return tuple(system.state_names[e.limits.state] for e in system.elements if e.limits is not None)


@dataclass(frozen=True)
class SimulationErrorProblem:
    """Weighted residuals of `structure` on `recordings`.

    Attributes
    ----------
    structure : Structure
    recordings : tuple of Recording
    weights : ndarray, shape (outputs,)
        1 over the noise of each output; a noise below a thousandth of the output's spread counts as that, so
        that a fine sensor does not silence the others.
    onsets : tuple of InitialState
        How each recording begins.
    threads : int
    gain : float
        By which simulations are held to the measured motion, in torque per speed.
    """

    structure: Structure
    recordings: tuple[Recording, ...]
    weights: Array
    initial_states: tuple[InitialState, ...]
    threads: int = 1
    gain: float = 0.0

    @classmethod
    def of(
        cls, structure: Structure, recordings: Sequence[Recording], threads: int = 1, initial: Initial = "auto"
    ) -> Self:
        """Problem with weights from the recordings' noise; `initial` as for `InitialState`."""
        noise = np.median([output_noise(r) for r in recordings], axis=0)
        spread = np.max([r.y.std(axis=1) for r in recordings], axis=0)
        floor = np.maximum(noise, 1e-3 * spread)
        tags = [f"#{k + 1}" if len(recordings) > 1 else "" for k in range(len(recordings))]
        limited = _limited_states(structure)
        onsets = tuple(
            InitialState.of(r, initial, tag, limited, structure.masses) for r, tag in zip(recordings, tags, strict=True)
        )
        return cls(structure, tuple(recordings), 1.0 / np.where(floor > 0.0, floor, 1.0), onsets, threads)

    @property
    def unknown_initial(self) -> tuple[InitialStateParameter, ...]:
        """Parts of the initial states that are searched for beside the parameters."""
        return tuple(unknown for onset in self.initial_states for unknown in onset.unknown)

    def states(self, values: Mapping[str, float], f_tanh: float) -> tuple[Mapping[str, float], ...]:
        """Initial state by name for each recording, SI."""
        own = {name: values[name] for name in self.structure.parameters}
        arrays = {name: np.array([value]) for name, value in values.items()}
        system = assemble(self.structure, own, f_tanh)
        found = []
        for r, onset in zip(self.recordings, self.initial_states, strict=True):
            x0 = onset.state(system, float(r.u[0]), arrays)[:, 0]
            found.append(dict(zip(system.state_names, x0.tolist(), strict=True)))
        return tuple(found)

    @property
    def has_hard_limit(self) -> bool:
        """A state of the structure is kept between limits: the cost is rugged then."""
        return self.structure.has_hard_limit

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return sum(r.y.size for r in self.recordings)

    def spent(self, sets: int) -> SimulationCount:
        """What it takes to simulate `sets` parameter sets on the recordings."""
        return SimulationCount(sets, sets * sum(r.samples for r in self.recordings))

    def residuals(self, values: Mapping[str, Array], settings: Settings, *, group: int = 1) -> Array:
        """Weighted residuals, shape (residuals, K): simulated minus measured; large but finite if diverged."""
        parts = []
        for r, onset, lost in zip(self.recordings, self.initial_states, self._lost, strict=True):
            y = self._predicted(values, r, onset, settings, group)
            apart = (y - r.y[:, :, None]) * self.weights[:, None, None]
            apart = np.where(np.isfinite(apart), np.clip(apart, -LARGEST, LARGEST), lost[:, None, None])
            parts.append(apart.reshape(-1, apart.shape[-1]))
        return np.concatenate(parts)

    def normal_products(
        self,
        values: Mapping[str, Array],
        settings: Settings,
        per_step: Array,
    ) -> Array:
        """Products of residual and derivatives, shape (S, 1 + P, 1 + P), lower triangles; see `add_products`.

        `values` hold S starts, each followed by its P neighbours.
        """
        starts, count = per_step.shape
        total = np.zeros((starts, 1 + count, 1 + count))
        for r, onset, lost in zip(self.recordings, self.initial_states, self._lost, strict=True):
            y = self._predicted(values, r, onset, settings, 1 + count)
            y = np.ascontiguousarray(y).reshape(*y.shape[:2], starts, -1)
            add_products(y, r.y, self.weights, lost, per_step, total)
        return total

    def costs(self, values: Mapping[str, Array], settings: Settings, upper_limits: Array | None = None) -> Array:
        """Sums of squared weighted residuals, shape (K,).

        With limits `most`, shape (K,), simulations are given up as soon as their sum reaches its limit, and the sum
        is infinite; so it is where a simulation has diverged. Differenced velocities are simulated to their end.
        """
        total = np.zeros(len(next(iter(values.values()))))
        for r, onset, lost in zip(self.recordings, self.initial_states, self._lost, strict=True):
            if upper_limits is not None and not any(signal.kind == "velocity-differenced" for signal in r.outputs):
                system, u, x0 = systems(self.structure, values, r, settings, initial_state=onset, gain=self.gain)
                weights = self.weights**2
                total = squares(
                    system,
                    u,
                    r.dt,
                    x0,
                    settings,
                    r.y,
                    weights,
                    sums=total,
                    upper_limits=upper_limits,
                    threads=self.threads,
                )
                continue
            y = self._predicted(values, r, onset, settings, 1)
            add_squares(np.ascontiguousarray(y), r.y, self.weights, lost, total)
            if upper_limits is not None:
                total = np.where(np.isfinite(y).all(axis=(0, 1)) & (total < upper_limits), total, np.inf)
        return total

    def _predicted(
        self, values: Mapping[str, Array], r: Recording, onset: InitialState, settings: Settings, group: int
    ) -> Array:
        return predict_many(
            self.structure, values, r, settings, initial_state=onset, group=group, threads=self.threads, gain=self.gain
        )

    @cached_property
    def _lost(self) -> tuple[Array, ...]:
        """Weighted residual of a simulation that has diverged, shape (outputs,), of each recording."""
        return tuple(np.asarray(np.maximum(_LOST * r.y.std(axis=1) * self.weights, 1.0)) for r in self.recordings)

    def truncated(self, share: float) -> SimulationErrorProblem:
        """The same on the beginnings of the recordings, which hold `share` of what the input does."""
        if share >= 1.0:
            return self
        return replace(self, recordings=tuple(_beginning(r, share) for r in self.recordings))

    def with_output_feedback(self, share: float) -> SimulationErrorProblem | None:
        """The same with simulations that are held to the measured motion; None if that is not known.

        By `share` of the usual torque per usual speed: as much torque for an error as large as the speed is.
        """
        speeds = [measured_speed(r) for r in self.recordings]
        known = np.concatenate([v for v in speeds if v is not None] or [np.zeros(1)])
        if any(v is None for v in speeds) or not known.any():
            return None
        u = np.concatenate([r.u for r in self.recordings])
        return replace(self, gain=share * float(np.sqrt(np.mean(u**2) / np.mean(known**2))))
