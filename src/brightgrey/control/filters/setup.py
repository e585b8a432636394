"""Setup of the filters: data and first state from a recording and a model, and the noise by maximum likelihood."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.arrays import Array
from brightgrey.control.filters.extended_kalman import Noise, extended_kalman_filter
from brightgrey.control.filters.state_transition import FilterInput
from brightgrey.control.linear.twist_coordinates import TwistModel, to_twist_coordinates
from brightgrey.effects import Element
from brightgrey.errors import RecordingError
from brightgrey.estimation.problem.initial_state import initial_state, output_noise
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = [
    "FilterSetup",
    "NoiseGrid",
    "PreparedRecording",
    "estimate_noise",
    "initial_distribution",
    "prepare",
    "shaft_torque",
]


@dataclass(frozen=True)
class FilterSetup:
    """Uncertainty of the first state, and accuracy of the filter's steps."""

    #: Standard deviation of the first speed over the largest speed, and of a lagging input over the largest input.
    initial_std: float = 0.02
    step_tolerance: float = 0.1  #: Error of a step over the noise of the speed; exact friction reverses within it.
    #: Limits of that noise, over the largest speed.
    min_speed_noise: float = 1e-4
    max_speed_noise: float = 1e-2


@dataclass(frozen=True)
class NoiseGrid:
    """Candidates of the maximum-likelihood search for the noise."""

    #: Standard deviations of the disturbance over the largest input.
    torques: tuple[float, ...] = tuple(10.0 ** (0.5 * k) for k in range(-8, 1))
    sensors: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)  #: Factors on the measurement noise that the recording shows.
    #: Factors on both for the second grid, around the best point of the first.
    refinement: tuple[float, ...] = tuple(10.0 ** (k / 8.0) for k in range(-2, 3))
    max_samples: int = 6000  #: Of a longer recording only the middle part is used.


FILTER_SETUP = FilterSetup()
NOISE_GRID = NoiseGrid()


@dataclass(frozen=True)
class PreparedRecording:
    """Input of the filters for a recording, and its coordinates."""

    filter_input: FilterInput
    twist_model: TwistModel  #: Transformation from the filter's states to all states.
    #: Standard deviation of the noise that the recording shows in each output, SI, shape (K, outputs).
    sensor_noise: Array


def prepare(
    structure: Structure,
    values: Mapping[str, ArrayLike],
    recording: Recording | Sequence[Recording],
    settings: Settings,
    setup: FilterSetup = FILTER_SETUP,
) -> PreparedRecording:
    """Prepare recordings for a filter with the model `values` of `structure`.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float or ndarray, shape (K,)
        SI. With arrays K parameter sets are filtered side by side.
    recording : Recording or sequence of Recording
        One for all parameter sets, or one for each; then of the same length, signals, sampling time and hold.
    settings : Settings
        ``f_tanh`` and ``speed_scale`` are used. With exact dry friction the filters still need a slope: its sign
        then reverses within the error that is tolerated in a step, which no measured speed resolves.
    setup : FilterSetup

    Returns
    -------
    PreparedRecording

    Raises
    ------
    RecordingError
        If the recordings cannot be filtered side by side.
    """
    first = recording if isinstance(recording, Recording) else recording[0]
    kinds = [signal.kind for signal in first.outputs]
    if "speed" in kinds:
        name = first.outputs[kinds.index("speed")].name
        raise RecordingError(f"'{name}' is a speed without sign, which no Kalman filter here can use")
    differenced = tuple(kind == "velocity-differenced" for kind in kinds)
    outputs = [signal.simulated for signal in first.outputs]
    system = assemble(structure, values, _sharpness(first, settings, setup), outputs, first.input.mass)
    K = system.batch[0] if system.batch else 1
    each = [first] * K if isinstance(recording, Recording) else list(recording)
    _check_compatible(each, K)
    coordinates = to_twist_coordinates(system)
    own = {id(r): (np.asarray(output_noise(r)), initial_state(r, system), float(np.abs(r.u).max())) for r in each}
    sensors, starts, torques = (np.array(part) for part in zip(*(own[id(r)] for r in each), strict=True))
    speed_noise = _speed_noise_of(kinds, sensors, settings, setup)
    speed = setup.initial_std * settings.speed_scale
    z0, P0 = initial_distribution(coordinates, starts, speed, speed_noise, setup.initial_std * torques)
    if "position" in kinds:
        P0[:, 0, 0] = np.square(sensors[:, kinds.index("position")])
    filter_input = FilterInput(
        coordinates.system,
        np.stack([r.u for r in each], axis=1),
        np.stack([r.y.T for r in each], axis=1),
        first.dt,
        first.hold,
        z0,
        P0,
        differenced,
        setup.step_tolerance * speed_noise,
    )
    return PreparedRecording(filter_input, coordinates, sensors)


def _sharpness(recording: Recording, settings: Settings, setup: FilterSetup) -> float:
    """Gain of the sign of speed, s/rad (s/m); of an exact sign one that reverses within the error of a step."""
    if math.isfinite(settings.f_tanh):
        return settings.f_tanh
    kinds = [signal.kind for signal in recording.outputs]
    noise = _speed_noise_of(kinds, output_noise(recording)[None], settings, setup)
    return 1.0 / (setup.step_tolerance * float(noise[0]))


def _check_compatible(each: Sequence[Recording], sets: int) -> None:
    """Refuse recordings that cannot be filtered side by side."""
    natures = {(r.samples, r.dt, r.hold, tuple(s.sensor for s in r.outputs)) for r in each}
    if len(each) != sets or len(natures) != 1:
        raise RecordingError(
            f"{len(each)} recordings for {sets} parameter sets; give one for each, all with the same length, signals, "
            "sampling time and hold"
        )


def _speed_noise_of(kinds: Sequence[str], sensors: Array, settings: Settings, setup: FilterSetup) -> Array:
    """Noise of the best measured speed within the limits of `setup`, shape (K,); the lower limit without one."""
    speeds = [i for i, kind in enumerate(kinds) if kind.startswith("velocity")]
    noise = sensors[:, speeds].min(axis=1) if speeds else np.zeros(len(sensors))
    low, high = setup.min_speed_noise * settings.speed_scale, setup.max_speed_noise * settings.speed_scale
    return np.asarray(np.clip(noise, low, high))


def initial_distribution(
    coordinates: TwistModel, x0: Array, speed: float, speed_difference: Array, torque: Array
) -> tuple[Array, Array]:
    """Mean, shape (K, n), and covariance of the first state.

    All masses move at a common speed, the position in a gap is uniformly distributed, and shafts are relaxed.

    Parameters
    ----------
    coordinates : TwistModel
    x0 : ndarray, shape (K, states)
        Expected state, apart from the positions in gaps.
    speed : float
        Standard deviation of the common speed, rad/s (m/s).
    speed_difference : ndarray, shape (K,)
        Standard deviation of a mass's speed against the common one where the drive starts from rest.
    torque : ndarray, shape (K,)
        Standard deviation of a lagging input.
    """
    system = coordinates.system
    n, K = len(system.states), len(x0)
    z0 = x0 @ coordinates.W.T
    P0 = np.zeros((K, n, n))
    A = np.broadcast_to(system.A.reshape(n, n, -1), (n, n, K))
    fastest = np.sqrt(np.abs(A).sum(axis=(0, 1)))  # bound of the natural frequencies, which scales the twists
    speeds = np.array([state.at_rest == "speed" for state in system.states])
    P0 += np.square(speed) * np.outer(speeds, speeds)
    for i, state in enumerate(system.states):
        if speeds[i]:
            at_rest = z0[:, i] == 0.0
            P0[:, i, i] += np.square(np.where(at_rest, speed_difference, speed))
        elif state.at_rest == "input":
            P0[:, i, i] = np.square(torque)
        elif state.name.startswith("twist"):
            P0[:, i, i] = np.square(speed / fastest)
    for e in system.elements:
        if e.limits is not None:
            low, high = np.broadcast_to(e.limits.lower, (K,)), np.broadcast_to(e.limits.upper, (K,))
            direction = np.zeros((K, n))
            direction[:, e.limits.state] = 1.0
            twist = _twist_beside_gap(e, system)
            H = e.H[0].reshape(n, -1)
            direction[:, twist] = -H[e.limits.state] / H[twist]
            z0 += (0.5 * (low + high))[:, None] * direction
            z0[:, e.limits.state] = 0.5 * (low + high)
            P0 += (np.square(high - low) / 12.0)[:, None, None] * direction[:, :, None] * direction[:, None, :]
    return z0, P0


def _twist_beside_gap(gap: Element, system: StateSpace) -> int:
    """Index of the twist that equals the position in `gap` when the shaft is relaxed."""
    assert gap.limits is not None
    H = np.abs(gap.H[0].reshape(len(system.states), -1)).max(axis=1)
    twists = [i for i, state in enumerate(system.states) if state.name.startswith("twist") and H[i] > 0.0]
    return max(twists, key=lambda i: float(H[i]))


def estimate_noise(
    structure: Structure,
    values: Mapping[str, float],
    recording: Recording,
    settings: Settings,
    grid: NoiseGrid = NOISE_GRID,
) -> Noise:
    """Estimate the noise of a drive from a recording that its model explains.

    Parameters
    ----------
    structure, values, settings
        The model, SI.
    recording : Recording
        Best one that the model was identified from: its noise is the reference for normal operation.
    grid : NoiseGrid

    Returns
    -------
    Noise

    Notes
    -----
    The likelihood of the innovations of the extended Kalman filter is maximised over the standard deviation of the
    disturbance and one factor on the measurement noise, on a coarse grid and a finer one around its best point.
    """
    part = _middle_part(recording, grid.max_samples)
    largest = float(np.abs(part.u).max()) or 1.0
    prepared = prepare(structure, values, part, settings)
    best = _most_likely_noise(prepared, [(t * largest, s) for t in grid.torques for s in grid.sensors])
    finer = [(best[0] * t, best[1] * s) for t in grid.refinement for s in grid.refinement]
    torque, factor = _most_likely_noise(prepared, finer)
    return Noise(torque, factor * prepared.sensor_noise[0])


def _middle_part(recording: Recording, samples: int) -> Recording:
    extra = recording.samples - samples
    if extra <= 0:
        return recording
    part = slice(extra // 2, extra // 2 + samples)
    return replace(recording, t=recording.t[part], u=recording.u[part], y=recording.y[:, part])


def _most_likely_noise(prepared: PreparedRecording, grid: list[tuple[float, float]]) -> tuple[float, float]:
    """Disturbance and sensor factor with the largest likelihood; all candidates are filtered side by side."""
    one, sets = prepared.filter_input, len(grid)
    repeated = replace(
        one,
        u=np.repeat(one.u, sets, axis=1),
        y=np.repeat(one.y, sets, axis=1),
        z0=np.repeat(one.z0, sets, axis=0),
        P0=np.repeat(one.P0, sets, axis=0),
        tolerance=np.repeat(one.tolerance, sets),
    )
    torques, factors = np.array(grid).T
    found = extended_kalman_filter(repeated, Noise(torques, factors[:, None] * prepared.sensor_noise)).log_likelihood
    return grid[int(np.argmax(np.where(np.isfinite(found), found, -np.inf)))]


def shaft_torque(system: StateSpace, z: Array) -> Array:
    """Torque that the first shaft takes from mass 1, shape (...,), for states `z` (..., n) in twist coordinates.

    It is the part of mass 1's acceleration that is neither input nor friction, times the inertia. With a gap use the
    ``most_likely`` states of a Gaussian-sum filter, because the mean of an open and a closed gap is neither.
    """
    v = system.state_names.index("v1")
    row = system.A[v].copy()
    drive = [i for i, state in enumerate(system.states) if state.at_rest == "input"]
    per_torque = float(row[drive[0]]) if drive else float(system.B[v, 0])
    row[drive] = 0.0
    rate = z @ row
    for e in system.elements:
        if e.limits is None:
            continue
        ports = np.einsum("pj,...j->p...", e.H, z)
        rate = rate + e.G[v] * e.law.value(tuple(ports), e.p)[0]
    return np.asarray(-rate / per_torque)
