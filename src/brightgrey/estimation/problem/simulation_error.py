"""Simulation-error problem: weighted residuals of a structure on recordings, for many parameter sets at once."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, positive
from brightgrey.estimation.problem.clock_skew import skewed
from brightgrey.estimation.problem.drift import drift_in, drifts_of, with_drift
from brightgrey.estimation.problem.initial_state import Initial, InitialState, output_noise
from brightgrey.estimation.problem.normal_equations import LARGEST, add_products, add_squares
from brightgrey.estimation.problem.nuisance import Nuisance, friction_gain
from brightgrey.estimation.problem.output_feedback import measured_speed, with_output_feedback
from brightgrey.estimation.problem.per_recording import (
    deviations_of,
    is_of_another_recording,
    values_in_recording,
)
from brightgrey.estimation.problem.segments import segment_lengths
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response, squares

__all__ = ["SimulationErrorProblem", "predict_many", "system_for", "systems"]


@dataclass(frozen=True)
class _Policy:
    """Numbers of the residuals."""

    min_truncated_samples: int = 100  #: Of the first part of a recording.
    diverged_residual: float = 10.0  #: In standard deviations of the output.
    #: Noise over the output's standard deviation, so that a fine sensor does not silence the others.
    min_relative_noise: float = 1e-3
    #: Simulated samples that are kept at once, and sets that are simulated together even if they have more.
    most_numbers: int = 5_000_000
    fewest_sets: int = 16


POLICY = _Policy()


def predict_many(
    structure: Structure,
    values: Mapping[str, Array],
    recording: Recording,
    settings: Settings,
    *,
    initial_state: InitialState | None = None,
    initial: Mapping[str, float] | None = None,
    group: int = 1,
    gain: float = 0.0,
) -> Array:
    """Simulate K parameter sets: outputs, shape (outputs, samples, K), SI; not-a-number where diverged.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to ndarray, shape (K,)
        Parameters and nuisances, SI.
    recording : Recording
    settings : Settings
    initial_state : InitialState, optional
        By default that of the recording with nothing to estimate.
    initial : mapping of str to float, optional
        Initial state by state name, SI, in place of `initial_state`.
    group : int
        Sets that take the same steps, the first of them leads.
    gain : float
        Output feedback in torque per speed.
    """
    system, u, x0 = systems(
        structure, values, recording, settings, initial_state=initial_state, initial=initial, gain=gain
    )
    found = response(system, u, recording.dt, x0, settings, group=group)
    y, (sample, follower) = found.y, found.rejoined.T
    for out, signal in enumerate(recording.outputs):
        if signal.kind == "speed":
            y[out] = np.abs(y[out])
        if signal.kind == "velocity-differenced":  # the speed was constant before t = 0
            before = y[out, :1] - recording.dt * x0[system.state_names.index(f"v{signal.mass}")]
            y[out] = np.diff(y[out], axis=0, prepend=before) / recording.dt
            y[out, sample, follower] = y[out, sample, follower // group * group]  # a jump to the leader is no motion
    return skewed(y, values, recording.dt)


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
    """K systems by :func:`system_for`, their input, shape (samples,), and initial states, shape (n, K)."""
    tag = initial_state.tag if initial_state else ""
    values = values_in_recording(structure, values, tag)
    system = system_for(structure, values, recording, settings)
    if initial is not None:
        x0 = np.array([[initial[state.name]] for state in system.states])
    else:
        x0 = (initial_state or InitialState.of(recording)).state(system, float(recording.u[0]), values)
    drift = drift_in(values, tag)
    if drift is not None:
        system, x0 = with_drift(system, x0, drift, (recording.samples - 1) * recording.dt)
    sets = max((np.size(values[name]) for name in structure.parameters), default=1)
    system, u = with_output_feedback(system, recording, gain)
    return system, u, np.broadcast_to(x0, (len(x0), sets))


def system_for(
    structure: Structure, values: Mapping[str, Array], recording: Recording, settings: Settings
) -> StateSpace:
    """K systems with the outputs from which the signals of a recording are made.

    The width of friction's reversal is that of the settings, unless it is among the values.
    """
    outputs = [signal.simulated for signal in recording.outputs]
    own = {name: values[name] for name in structure.parameters}
    return assemble(structure, own, friction_gain(values, settings.f_tanh), outputs, recording.input.mass)


def _truncated(recording: Recording, share: float) -> Recording:
    """Cut to the first samples that hold `share` of the excitation, counted by the input's magnitude and changes."""
    r = recording
    size, change = np.abs(r.u), np.abs(np.diff(r.u, prepend=r.u[0]))
    work = np.cumsum(size / positive(size.sum()) + change / positive(change.sum()))
    samples = int(np.searchsorted(work, share * work[-1])) + 1
    samples = int(np.clip(samples, min(POLICY.min_truncated_samples, r.samples), r.samples))
    return replace(r, t=r.t[:samples], u=r.u[:samples], y=r.y[:, :samples])


def _moving_columns(values: Mapping[str, Array], tag: str, group: int) -> NDArray[np.int64]:
    """Numbers within a group of the first set, and of those that move otherwise in the recording with a tag.

    A drift or an initial state of another recording changes nothing in this one.
    """
    apart = np.arange(group) == 0
    for name, value in values.items():
        if np.ndim(value) and not is_of_another_recording(name, tag, values):
            sets = np.reshape(value, (-1, group))
            apart |= (sets != sets[:, :1]).any(axis=0)
    return np.flatnonzero(apart)


def _columns_of(values: Mapping[str, Array], columns: NDArray[np.int64], group: int) -> Mapping[str, Array]:
    """Values of some sets of every group."""
    if len(columns) == group:
        return values
    return {name: np.reshape(value, (-1, group))[:, columns].ravel() for name, value in values.items()}


def _portions(count: int, numbers: int, group: int) -> Iterator[slice]:
    """Parts of `count` groups of sets, each of so many numbers, no more than are kept at once."""
    size = max(POLICY.most_numbers // numbers, POLICY.fewest_sets // group, 1)
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))


def _portion(values: Mapping[str, Array], some: slice, group: int) -> Mapping[str, Array]:
    """Values of some groups of sets; one that holds for all of them stays."""
    sets = slice(some.start * group, some.stop * group)
    return {name: value[sets] if np.size(value) > 1 else value for name, value in values.items()}


@cache
def _limited_states(structure: Structure) -> tuple[str, ...]:
    """Names of the states with hard limits: positions in gaps."""
    system = assemble(structure, dict.fromkeys(structure.parameters, 1.0), 1.0)
    return tuple(system.state_names[e.limits.state] for e in system.elements if e.limits is not None)


@dataclass(frozen=True)
class SimulationErrorProblem:
    """Weighted residuals of `structure` on `recordings`."""

    structure: Structure
    recordings: tuple[Recording, ...]
    #: Inverse of the noise of each output; at least a thousandth of the output's standard deviation counts as noise,
    #: shape (outputs,).
    weights: Array
    initial_states: tuple[InitialState, ...]  #: One per recording.
    gain: float = 0.0  #: Output feedback in torque per speed, N m s/rad (N s/m).
    friction_width: Nuisance | None = None  #: None if the settings give it, or if no friction reverses.
    drifts: tuple[Nuisance, ...] = ()  #: Of the long recordings, if they are estimated.
    deviations: tuple[Nuisance, ...] = ()  #: Of parameters that may differ between the recordings.
    skews: tuple[Nuisance, ...] = ()  #: Of the outputs but the first one, if they are estimated.

    @classmethod
    def of(
        cls,
        structure: Structure,
        recordings: Sequence[Recording],
        initial: Initial = "auto",
        friction_width: Nuisance | None = None,
        drift: bool = False,
        per_recording: Collection[str] = (),
    ) -> Self:
        """Problem with weights from the noise of the recordings; `initial` as for :meth:`InitialState.of`.

        With `drift`, long recordings have one each. Parameters named in `per_recording` may differ between them.
        """
        noise = np.median([output_noise(r) for r in recordings], axis=0)
        spread = np.max([r.y.std(axis=1) for r in recordings], axis=0)
        floor = np.maximum(noise, POLICY.min_relative_noise * spread)
        tags = [f"#{k + 1}" if len(recordings) > 1 else "" for k in range(len(recordings))]
        limited = _limited_states(structure)
        states = tuple(
            InitialState.of(r, initial, tag, limited, structure.masses) for r, tag in zip(recordings, tags, strict=True)
        )
        return cls(
            structure,
            tuple(recordings),
            1.0 / np.where(floor > 0.0, floor, 1.0),
            states,
            friction_width=friction_width if structure.has_dry_friction else None,
            drifts=drifts_of(recordings, tags) if drift else (),
            deviations=deviations_of(structure, recordings, tags, per_recording),
        )

    @property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Parts of initial states, drifts, skews, deviations and the friction's width, if they are estimated."""
        width = () if self.friction_width is None else (self.friction_width,)
        return (*self.unknown_initial, *self.drifts, *self.skews, *self.deviations, *width)

    @property
    def unknown_initial(self) -> tuple[Nuisance, ...]:
        """Parts of the initial states that are estimated with the parameters."""
        return tuple(unknown for state in self.initial_states for unknown in state.unknown)

    def states(self, values: Mapping[str, float], f_tanh: float) -> tuple[Mapping[str, float], ...]:
        """Initial state of each recording by state name, SI, for parameters and parts of initial states by name."""
        arrays = {name: np.array([value]) for name, value in values.items()}
        found = []
        for r, state in zip(self.recordings, self.initial_states, strict=True):
            here = values_in_recording(self.structure, arrays, state.tag)
            own = {name: float(here[name][0]) for name in self.structure.parameters}
            system = assemble(self.structure, own, f_tanh, actuator=r.input.mass)
            x0 = state.state(system, float(r.u[0]), arrays)[:, 0]
            found.append(dict(zip(system.state_names, x0.tolist(), strict=True)))
        return tuple(found)

    @property
    def has_hard_limit(self) -> bool:
        """True if a state has hard limits, which make the cost rugged."""
        return self.structure.has_hard_limit

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return sum(r.y.size for r in self.recordings)

    @property
    def segment_lengths(self) -> list[int]:
        """Samples of each segment of the residual (one output of one recording)."""
        return segment_lengths(self.recordings)

    def count(self, sets: int) -> SimulationCount:
        """Count of simulating `sets` parameter sets on the recordings."""
        return SimulationCount(sets, sets * sum(r.samples for r in self.recordings))

    def residuals(self, values: Mapping[str, Array], settings: Settings, *, group: int = 1) -> Array:
        """Weighted residuals, simulated minus measured, shape (residuals, K); large but finite if diverged."""
        parts = []
        for r, state, lost in self._parts():
            moving = _moving_columns(values, state.tag, group)
            y = self._predicted(_columns_of(values, moving, group), r, state, settings, len(moving))
            if len(moving) < group:  # the others move as the first one
                own = np.searchsorted(moving, np.arange(group)) * np.isin(np.arange(group), moving)
                y = y.reshape(*y.shape[:2], -1, len(moving))[..., own].reshape(*y.shape[:2], -1)
            y = np.subtract(y, r.y[:, :, None], order="C")
            y *= self.weights[:, None, None]
            diverged = ~np.isfinite(y)
            np.clip(y, -LARGEST, LARGEST, out=y)
            np.copyto(y, lost[:, None, None], where=diverged)
            parts.append(y.reshape(-1, y.shape[-1]))
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def normal_products(self, values: Mapping[str, Array], settings: Settings, per_step: Array) -> Array:
        """Products of residual and derivatives, shape (S, 1 + P, 1 + P), lower triangles; see `add_products`.

        Parameters
        ----------
        values : mapping of str to ndarray, shape (S (1 + P),)
            S starts, each followed by its P neighbours.
        settings : Settings
        per_step : ndarray, shape (S, P)
            Inverse of the distance to each neighbour in the scaled space.
        """
        starts, count = per_step.shape
        total = np.zeros((starts, 1 + count, 1 + count))
        for r, state, lost in self._parts():
            for some in _portions(starts, (1 + count) * r.y.size, 1 + count):
                own = _portion(values, some, 1 + count)
                moving = _moving_columns(own, state.tag, 1 + count)
                y = self._predicted(_columns_of(own, moving, 1 + count), r, state, settings, len(moving))
                y = np.ascontiguousarray(y).reshape(*y.shape[:2], some.stop - some.start, -1)
                products = total[some, moving[:, None], moving]
                add_products(y, r.y, self.weights, lost, per_step[some, moving[1:] - 1], products)
                total[some, moving[:, None], moving] = products
        return total

    def costs(self, values: Mapping[str, Array], settings: Settings, upper_limits: Array | None = None) -> Array:
        """Sums of squared weighted residuals, shape (K,).

        With `upper_limits`, shape (K,), a simulation is aborted as soon as its sum reaches its limit, and the sum is
        infinite, as it is for a simulation that has diverged. Signals that are made from an output are simulated to
        their end.
        """
        total = np.zeros(len(next(iter(values.values()))))
        for r, state, lost in self._parts():
            as_simulated = all(signal.kind == signal.simulated.partition("@")[0] for signal in r.outputs)
            if upper_limits is not None and as_simulated and not self.skews:
                system, u, x0 = systems(self.structure, values, r, settings, initial_state=state, gain=self.gain)
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
                )
                continue
            for some in _portions(len(total), r.y.size, 1):
                y = self._predicted(_portion(values, some, 1), r, state, settings, 1)
                squares_of = total[some].copy()
                add_squares(np.ascontiguousarray(y), r.y, self.weights, lost, squares_of)
                if upper_limits is not None:
                    kept = np.isfinite(y).all(axis=(0, 1)) & (squares_of < upper_limits[some])
                    squares_of = np.where(kept, squares_of, np.inf)
                total[some] = squares_of
        return total

    def _predicted(
        self, values: Mapping[str, Array], r: Recording, state: InitialState, settings: Settings, group: int
    ) -> Array:
        return predict_many(self.structure, values, r, settings, initial_state=state, group=group, gain=self.gain)

    def _parts(self) -> Iterator[tuple[Recording, InitialState, Array]]:
        """Each recording with its initial state and the weighted residual of a diverged simulation."""
        return zip(self.recordings, self.initial_states, self._diverged_residual, strict=True)

    @cached_property
    def _diverged_residual(self) -> tuple[Array, ...]:
        """Weighted residual of a simulation that has diverged, shape (outputs,), of each recording."""
        return tuple(
            np.asarray(np.maximum(POLICY.diverged_residual * r.y.std(axis=1) * self.weights, 1.0))
            for r in self.recordings
        )

    def truncated(self, share: float) -> SimulationErrorProblem:
        """Problem on the first part of each recording, which holds `share` of its excitation."""
        if share >= 1.0:
            return self
        return replace(self, recordings=tuple(_truncated(r, share) for r in self.recordings))

    def with_output_feedback(self, share: float) -> SimulationErrorProblem | None:
        """Problem with output feedback of the measured speed; None if no speed was measured.

        Parameters
        ----------
        share : float
            Gain relative to the root mean square of the torque over that of the speed.
        """
        speeds = [measured_speed(r) for r in self.recordings]
        known = np.concatenate([v for v in speeds if v is not None] or [np.zeros(1)])
        if any(v is None for v in speeds) or not known.any():
            return None
        u = np.concatenate([r.u for r in self.recordings])
        return replace(self, gain=share * float(np.sqrt(np.mean(u**2) / np.mean(known**2))))
