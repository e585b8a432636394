"""Initial state of a recording: before its first sample, known or estimated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Literal, get_args

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Element
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.estimation.problem.scales import speed_of
from brightgrey.kit import Placed, StateSpace
from brightgrey.recordings import Recording
from brightgrey.recordings.sample_values import difference_noise
from brightgrey.recordings.units.signals import KINDS

__all__ = [
    "INITIALS",
    "Initial",
    "InitialState",
    "InitialStateOptions",
    "initial_state",
    "output_noise",
]

Initial = Literal["auto", "rest", "samples", "estimated"]
INITIALS: tuple[Initial, ...] = get_args(Initial)
"""Ways to determine the initial state."""
_CACHED_RECORDINGS = 8


@dataclass(frozen=True)
class InitialStateOptions:
    """Limits of the initial state."""

    rest_speed: float = 0.1  #: A drive whose first speed is below this part of the largest one is at rest.
    first_samples: int = 10  #: Samples from which position and speed at the start are determined.
    #: Standard deviation of the first value of a line through these samples, relative to that of their mean.
    intercept_std: float = 2.0
    sensor_std: float = 3.0  #: Standard deviations of the sensor's noise by which position and speed may be off.
    #: Largest twist of a shaft, relative to that of even acceleration by the largest input; oscillations add to it.
    max_twist: float = 3.0
    #: Largest speed difference of neighbouring masses, relative to the largest speed.
    max_speed_difference: float = 0.5
    mean_lengths: tuple[int, ...] = (10, 20, 40)  #: Samples whose means show slow noise.
    mean_differences: int = 6  #: Order of the difference of such means in which hardly any motion remains.


INITIAL_STATE_DEFAULTS = InitialStateOptions()


@lru_cache(maxsize=_CACHED_RECORDINGS)
def output_noise(recording: Recording) -> Array:
    """Standard deviation of the noise of each output, shape (outputs,), SI; read-only.

    It is estimated from second differences, and is at least the rounding error of the resolution.
    """
    spread = difference_noise(recording.y, 2)
    least = np.maximum(recording.resolution / np.sqrt(12.0), 1e-12 * recording.y.std(axis=1))
    noise = np.asarray(np.maximum(spread, least))
    noise.setflags(write=False)
    return noise


@lru_cache(maxsize=_CACHED_RECORDINGS)
def _first_speed(recording: Recording, samples: int) -> tuple[float, float, float]:
    """First speed by a line and by a parabola through the first samples, and the largest speed of all."""
    speed = speed_of(recording)
    first = speed[:samples]
    line, parabola = (float(np.polyfit(np.arange(len(first)), first, degree)[-1]) for degree in (1, 2))
    return line, parabola, float(np.abs(speed).max())


def initial_state(recording: Recording, system: StateSpace) -> Array:
    """State, shape (n,), before the first sample of `recording` if nothing of it is estimated."""
    state = InitialState.of(recording)
    return system.rest(state.position, state.speed, float(recording.u[0]))


@dataclass(frozen=True)
class InitialState:
    """Position and speed before the first sample, and the parts that are estimated; T is the first input."""

    #: Of all masses in SI, apart from the estimated parts.
    position: float
    speed: float
    torque: float = 0.0  #: Largest input in SI. Twists are relative to those of even acceleration by it.
    unknown: tuple[Nuisance, ...] = ()  #: Parts that are estimated. Their names end in `tag`.
    tag: str = ""  #: Distinguishes recordings.

    @classmethod
    def of(
        cls,
        recording: Recording,
        initial: Initial = "auto",
        tag: str = "",
        limited: tuple[str, ...] = (),
        masses: int = 1,
        options: InitialStateOptions = INITIAL_STATE_DEFAULTS,
    ) -> InitialState:
        """Determine the initial state of a recording.

        Parameters
        ----------
        recording : Recording
        initial : {'auto', 'rest', 'samples', 'estimated'}
            At rest; as the first samples say; or estimated within the noise of those samples (a free speed would be
            abused to absorb drift). ``auto`` is at rest unless the first samples clearly move, by a tenth of the
            largest speed; then it is ``estimated``. Of a drive at rest, it estimates the position alone.
        tag : str
            Ends the names of the estimated parts.
        limited : tuple of str
            Names of the states with hard limits, which ``estimated`` estimates, too.
        masses : int
            Masses in a row. ``estimated`` also estimates the twist of each shaft and the speed of each further mass:
            a drive in motion oscillates, and that is as large as the effects of interest.
        options : InitialStateOptions
        """
        kinds = [signal.kind for signal in recording.outputs]
        output = kinds.index("position") if "position" in kinds else None
        position = float(recording.y[output][0]) if output is not None else 0.0
        speed, _, largest = _first_speed(recording, options.first_samples)
        moving = abs(speed) >= options.rest_speed * largest > 0.0
        if initial == "rest":
            return cls(position, 0.0, 0.0, (), tag)
        if initial == "auto" and not moving:
            return cls(position, 0.0, 0.0, tuple(_first_position(recording, output, tag, options)), tag)
        torque = float(np.abs(recording.u).max())
        unknown: list[Nuisance] = []
        if initial != "samples":
            unknown += _rigid_motion(recording, output, tag, options)
            unknown += [Nuisance(f"{name}(0)/width{tag}", -1.0, 0.0, -0.5) for name in limited]
            if torque > 0.0:
                twist = float(recording.u[0]) / torque
                unknown += _relative_motion(masses, twist, options.max_speed_difference * largest, tag, options)
        return cls(position, speed, torque, tuple(unknown), tag)

    def state(self, system: StateSpace, u: float, values: Mapping[str, Array]) -> Array:
        """Initial states, shape (n, K) or (n, 1).

        A limited state is counted in widths of its range, from its upper limit, and its shaft is relaxed. Then twists
        are added: those of even acceleration by `u` where they are not estimated.

        Parameters
        ----------
        system : StateSpace
        u : float
            First input, SI.
        values : mapping of str to ndarray, shape (K,)
            Estimated parts by name.
        """

        def value(name: str, default: float) -> Array:
            return np.atleast_1d(np.asarray(values.get(name + self.tag, default), float))

        parts = {
            "position": value("position(0)", self.position),
            "speed": value("speed(0)", self.speed),
            "zero": np.zeros(1),
            "input": np.full(1, u),
        }
        rows = [parts[state.at_rest] for state in system.states]
        for element in system.elements:
            if element.limits is not None:
                low, high = element.limits.lower, element.limits.upper
                share = value(f"{system.state_names[element.limits.state]}(0)/width", 0.0)
                rows[element.limits.state] = np.atleast_1d(high + share * (high - low))
        x = np.empty((len(rows), max(map(len, rows))))
        for i, row in enumerate(rows):
            x[i] = row
        for element in system.elements:
            if element.limits is not None:
                _relax(x, system, element)
        speeds, positions = _motion_states(system)
        if self.torque > 0.0 and len(positions) > 1:
            full = _acceleration_twists(system, self.torque, speeds, positions)
            x = x + np.zeros(full.shape[1])
            for i in range(1, len(positions)):
                x[positions[i:]] += value(f"twist{i}(0)/full", u / self.torque) * full[i - 1]
                x[speeds[i:]] += value(f"speed{i + 1}-speed{i}(0)", 0.0)
        return x


def _first_position(
    recording: Recording, output: int | None, tag: str, options: InitialStateOptions
) -> Iterator[Nuisance]:
    """Position at the start, within the noise of the first sample, if output number `output` is a position.

    Taken for exact, the first sample would shift the whole motion by its noise.
    """
    if output is not None:
        y, noise = recording.y[output], float(output_noise(recording)[output])
        first, slack = float(y[0]), options.sensor_std * max(noise, _slow_noise_std(y, options))
        yield Nuisance(f"position(0){tag}", first - slack, first + slack, first, sampled=False)


def _rigid_motion(
    recording: Recording, output: int | None, tag: str, options: InitialStateOptions
) -> Iterator[Nuisance]:
    """Position (of output number `output`) and speed of the whole drive within the noise of the first samples."""
    yield from _first_position(recording, output, tag, options)
    noise = output_noise(recording)
    speed, by_parabola, _ = _first_speed(recording, options.first_samples)
    slack = options.sensor_std * _first_speed_std(recording, noise, options) + abs(by_parabola - speed)
    low, high = speed - slack, speed + slack
    if abs(speed) <= options.sensor_std * _first_speed_std_of_slow_noise(recording, options):
        low, high = min(low, 0.0), max(high, 0.0)  # it may be at rest, too
    yield Nuisance(f"speed(0){tag}", low, high, speed)


def _relative_motion(
    masses: int, twist: float, max_difference: float, tag: str, options: InitialStateOptions
) -> Iterator[Nuisance]:
    """Twist of each shaft and speed difference of its masses; twists begin at `twist`."""
    for i in range(1, masses):
        high = options.max_twist
        yield Nuisance(f"twist{i}(0)/full{tag}", -high, high, twist, sampled=False)
        name = f"speed{i + 1}-speed{i}(0){tag}"
        yield Nuisance(name, -max_difference, max_difference, 0.0, sampled=False)


def _relax(x: Array, system: StateSpace, element: Element) -> None:
    """Shift the masses behind a limited state so that its shaft is relaxed, as it is in even motion."""
    row = element.H[0].reshape(len(x), -1)
    place = Placed.parse(element.name).place
    behind = [i for i, name in enumerate(system.state_names) if name.startswith("q") and int(name[1:]) > place]
    x[behind] -= (row * x).sum(axis=0) / row[behind].sum(axis=0)


def _motion_states(system: StateSpace) -> tuple[list[int], list[int]]:
    """Indices of the states that are speeds, and of those that are positions, in the order of the masses."""
    kinds = [state.at_rest for state in system.states]
    return [i for i, k in enumerate(kinds) if k == "speed"], [i for i, k in enumerate(kinds) if k == "position"]


def _acceleration_twists(system: StateSpace, torque: float, speeds: list[int], positions: list[int]) -> Array:
    """Twist of each shaft, shape (masses - 1, K) or (masses - 1, 1), where `torque` accelerates all masses evenly.

    Friction is neglected: this is a unit for twists.
    """
    n, m = len(system.states), len(positions)
    A = system.A.reshape(n, n, -1)
    drive = system.B[:, 0].reshape(n, -1)[speeds]
    for i, state in enumerate(system.states):
        if state.at_rest == "input":
            drive = drive + A[speeds, i]
    stiff = A[np.ix_(speeds, positions[1:])]
    sets = max(drive.shape[-1], stiff.shape[-1])
    matrix = np.full((sets, m, m), -1.0)  # the last column is the acceleration's
    matrix[:, :, : m - 1] = np.broadcast_to(stiff, (m, m - 1, sets)).transpose(2, 0, 1)
    wanted = -torque * np.broadcast_to(drive, (m, sets)).T
    apart = np.linalg.solve(matrix, wanted[:, :, None])[:, : m - 1, 0].T
    return np.diff(apart, axis=0, prepend=0.0)


def _first_speed_std(recording: Recording, noise: Array, options: InitialStateOptions) -> float:
    """Standard deviation of the speed by the first samples, of the output with the least one.

    A speed without sign counts only where no other output tells the motion: it is not the speed that is known.
    """
    signed = any(KINDS[s.kind] < 2 and s.kind != "speed" for s in recording.outputs)
    found = [np.inf]
    for signal, sigma in zip(recording.outputs, noise.tolist(), strict=True):
        if signal.kind == "position":
            found.append(options.intercept_std * sigma * np.sqrt(12.0 / options.first_samples**3) / recording.dt)
        elif signal.kind != "acceleration" and not (signed and signal.kind == "speed"):
            found.append(options.intercept_std * sigma / np.sqrt(options.first_samples))
    least = min(found)
    return float(least) if np.isfinite(least) else 0.0


def _first_speed_std_of_slow_noise(recording: Recording, options: InitialStateOptions) -> float:
    """Standard deviation of the speed by the first samples if noise is slow, of the worst measured speed."""
    found = [
        _slow_noise_std(y, options) for s, y in zip(recording.outputs, recording.y, strict=True) if KINDS[s.kind] == 1
    ]
    return options.intercept_std * max(found, default=0.0)


def _slow_noise_std(y: Array, options: InitialStateOptions) -> float:
    """Standard deviation of the slow noise of an output, shape (samples,).

    Slow noise hardly shows from sample to sample, but in differences of means over some of them. Oscillations of the
    drive show there, too, so this may be too large.
    """
    found, order = [0.0], options.mean_differences
    for length in options.mean_lengths:
        means = y[: len(y) // length * length].reshape(-1, length).mean(axis=1)
        if len(means) > 2 * order:
            bend = 1.4826 * float(np.median(np.abs(np.diff(means, n=order))))
            found.append(bend / float(np.sqrt(comb(2 * order, order))))
    return max(found)
