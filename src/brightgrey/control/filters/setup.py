"""From a recording and a model to what the filters take, and noise levels from a recording that the model explains."""

from __future__ import annotations

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

__all__ = ["PreparedRecording", "estimate_noise", "initial_distribution", "prepare", "shaft_torque"]

_AT_REST = 0.02  # of the speed scale: how well the first speed is known
_TORQUES = tuple(10.0 ** (0.5 * k) for k in range(-8, 1))  # of the largest input
_SENSORS = (0.5, 1.0, 2.0, 4.0)  # of the noise seen in the recording
_FINER = tuple(10.0 ** (k / 8.0) for k in range(-2, 3))
_ENOUGH = 6000  # samples
_STEP_ERROR = 0.1  # of the speed's noise


@dataclass(frozen=True)
class PreparedRecording:
    """A recording as the filters take it.

    Attributes
    ----------
    watched : FilterInput
    twisted : TwistModel
        Coordinates, and the way back to all states.
    sensors : ndarray, shape (K, outputs)
        Noise of each output as its recording shows it, SI.
    """

    filter_input: FilterInput
    twist_model: TwistModel
    sensor_noise: Array


def prepare(
    structure: Structure,
    values: Mapping[str, ArrayLike],
    recording: Recording | Sequence[Recording],
    settings: Settings,
) -> PreparedRecording:
    """Prepare recordings for a filter with the model `values` of `structure`.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float or ndarray, shape (K,)
        SI. Arrays watch with K parameter sets at once.
    recording : Recording or sequence of Recording
        One for all parameter sets, or one for each; then of the same length, signals, sampling time and hold.
    settings : Settings
        ``f_tanh`` and ``speed_scale`` are used.

    Returns
    -------
    PreparedRecording
    """
    first = recording if isinstance(recording, Recording) else recording[0]
    kinds = [signal.kind for signal in first.outputs]
    differenced = tuple(kind == "velocity-differenced" for kind in kinds)
    outputs = ["position" if d else kind for d, kind in zip(differenced, kinds, strict=True)]
    system = assemble(structure, values, settings.f_tanh, outputs)
    K = system.batch[0] if system.batch else 1
    each = [first] * K if isinstance(recording, Recording) else list(recording)
    _check_compatible(each, K)
    coordinates = to_twist_coordinates(system)
    own = {id(r): (np.asarray(output_noise(r)), initial_state(r, system), float(np.abs(r.u).max())) for r in each}
    sensors, starts, torques = (np.array(part) for part in zip(*(own[id(r)] for r in each), strict=True))
    speed_noise = _speed_tolerance(kinds, sensors, settings)
    speed = _AT_REST * settings.speed_scale
    z0, P0 = initial_distribution(coordinates, starts, speed, speed_noise, _AT_REST * torques)
    if "position" in kinds:
        P0[:, 0, 0] = np.square(sensors[:, kinds.index("position")])
    watched = FilterInput(
        coordinates.system,
        np.stack([r.u for r in each], axis=1),
        np.stack([r.y.T for r in each], axis=1),
        first.dt,
        first.hold,
        z0,
        P0,
        differenced,
        _STEP_ERROR * speed_noise,
    )
    return PreparedRecording(watched, coordinates, sensors)


def _check_compatible(each: Sequence[Recording], lanes: int) -> None:
    """Refuse recordings that cannot be filtered side by side."""
    natures = {(r.samples, r.dt, r.hold, tuple(s.kind for s in r.outputs)) for r in each}
    if len(each) != lanes or len(natures) != 1:
        raise RecordingError(
            f"{len(each)} recordings for {lanes} parameter sets; one for each is wanted, all of the same length, "
            "signals, sampling time and hold"
        )


def _speed_tolerance(kinds: Sequence[str], sensors: Array, settings: Settings) -> Array:
    """Size of speed that does not matter, shape (K,): the noise of a measured one, else a thousandth of the largest."""
    seen = [i for i, kind in enumerate(kinds) if kind.startswith("velocity")]
    least = sensors[:, seen].min(axis=1) if seen else np.zeros(len(sensors))
    return np.asarray(np.clip(least, 1e-4 * settings.speed_scale, 1e-2 * settings.speed_scale))


def initial_distribution(
    coordinates: TwistModel, x0: Array, speed: float, apart: Array, torque: Array
) -> tuple[Array, Array]:
    """First state, shape (K, n), and its covariance: all masses move alike, gaps stand anywhere, shafts are relaxed.

    Parameters
    ----------
    coordinates : TwistModel
    x0 : ndarray, shape (K, states)
        Expected state but for gaps.
    speed : float
        How well the common speed is known.
    apart : ndarray, shape (K,)
        How equal the speeds of the masses are where the drive starts from rest.
    torque : ndarray, shape (K,)
        How well a lagging input is known.
    """
    system = coordinates.system
    n, K = len(system.states), len(x0)
    z0 = x0 @ coordinates.W.T
    P0 = np.zeros((K, n, n))
    A = np.broadcast_to(system.A.reshape(n, n, -1), (n, n, K))
    fastest = np.sqrt(np.abs(A).sum(axis=(0, 1)))  # a bound of the turning rate; twists are small against it
    speeds = np.array([state.at_rest == "speed" for state in system.states])
    P0 += np.square(speed) * np.outer(speeds, speeds)
    for i, state in enumerate(system.states):
        if speeds[i]:
            rests = z0[:, i] == 0.0
            P0[:, i, i] += np.square(np.where(rests, apart, speed))
        elif state.at_rest == "input":
            P0[:, i, i] = np.square(torque)
        elif state.name.startswith("twist"):
            P0[:, i, i] = np.square(speed / fastest)
    for e in system.elements:
        if e.limits is not None:
            low, high = np.broadcast_to(e.limits.lower, (K,)), np.broadcast_to(e.limits.upper, (K,))
            follows = np.zeros((K, n))
            follows[:, e.limits.state] = 1.0
            twist = _twist_beside_gap(e, system)
            H = e.H[0].reshape(n, -1)
            follows[:, twist] = -H[e.limits.state] / H[twist]
            z0 += (0.5 * (low + high))[:, None] * follows
            z0[:, e.limits.state] = 0.5 * (low + high)
            P0 += (np.square(high - low) / 12.0)[:, None, None] * follows[:, :, None] * follows[:, None, :]
    return z0, P0


def _twist_beside_gap(gap: Element, system: StateSpace) -> int:
    """Number of the twist that stands where the position in `gap` does, when its shaft is relaxed."""
    assert gap.limits is not None
    H = np.abs(gap.H[0].reshape(len(system.states), -1)).max(axis=1)
    ways = [i for i, state in enumerate(system.states) if state.name.startswith("twist") and H[i] > 0.0]
    return max(ways, key=lambda i: float(H[i]))


def estimate_noise(
    structure: Structure, values: Mapping[str, float], recording: Recording, settings: Settings
) -> Noise:
    """Noise levels under which the model explains `recording` best.

    Parameters
    ----------
    structure, values, settings
        The model, SI.
    recording : Recording
        One that the model was identified from: what is found here is the measure of what is normal.

    Returns
    -------
    Noise

    Notes
    -----
    Maximum likelihood of the innovations over the standard deviation of a disturbing torque and one factor on the
    sensors' noise, on a grid and a finer one around its best point; of a long recording the middle 6000 samples.
    """
    part = _middle_part(recording)
    torque = float(np.abs(part.u).max()) or 1.0
    seen = prepare(structure, values, part, settings)
    grid = [(t * torque, s) for t in _TORQUES for s in _SENSORS]
    best = _most_likely_noise(seen, grid)
    best = _most_likely_noise(seen, [(best[0] * t, best[1] * s) for t in _FINER for s in _FINER])
    return Noise(best[0], best[1] * seen.sensor_noise[0])


def _middle_part(recording: Recording) -> Recording:
    extra = recording.samples - _ENOUGH
    if extra <= 0:
        return recording
    part = slice(extra // 2, extra // 2 + _ENOUGH)
    return replace(recording, t=recording.t[part], u=recording.u[part], y=recording.y[:, part])


def _most_likely_noise(seen: PreparedRecording, grid: list[tuple[float, float]]) -> tuple[float, float]:
    """Torque and sensor factor with the largest likelihood; all of a grid are filtered side by side."""
    w, lanes = seen.filter_input, len(grid)
    wide = replace(
        w,
        u=np.repeat(w.u, lanes, axis=1),
        y=np.repeat(w.y, lanes, axis=1),
        z0=np.repeat(w.z0, lanes, axis=0),
        P0=np.repeat(w.P0, lanes, axis=0),
        tolerance=np.repeat(w.tolerance, lanes),
    )
    torques, factors = np.array(grid).T
    found = extended_kalman_filter(wide, Noise(torques, factors[:, None] * seen.sensor_noise)).log_likelihood
    return grid[int(np.argmax(np.where(np.isfinite(found), found, -np.inf)))]


def shaft_torque(system: StateSpace, z: Array) -> Array:
    """Torque that the first shaft takes from mass 1, shape (...,), for states `z` (..., n) in twist coordinates.

    Read from the assembled matrices: what of mass 1's acceleration is neither input nor friction, times its inertia.
    Through a gap, ask for the ``likeliest`` states of a filter: a mean of contact and none is neither.
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
