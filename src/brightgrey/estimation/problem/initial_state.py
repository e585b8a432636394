"""How a recording begins: the state before its first sample, known or searched for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Literal, get_args

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Element
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.problem.scales import ORDER, speed_of
from brightgrey.kit import Placed, StateSpace
from brightgrey.recordings import Recording

__all__ = ["Initial", "InitialState", "InitialStateParameter", "check_initial", "initial_state", "output_noise"]

Initial = Literal["auto", "rest", "samples", "estimated"]
_INITIALS: tuple[Initial, ...] = get_args(Initial)
_REMEMBERED = 8  # recordings of which what does not depend on parameters is kept
_AT_REST = 0.1  # of the largest speed
_FIRST = 10  # samples that tell position and speed at the start
_INTERCEPT = 2.0  # standard deviation of a line's beginning, in that of a mean
_SURE = 3.0  # standard deviations of what the sensor allows
_WOUND = 3.0  # times the twist that the largest input gives in even acceleration: swings add to it
_APART = 0.5  # of the largest speed: what masses may differ by
_MEANS = (10, 20, 40)  # samples
_BEND = 6  # differences of such means, in which little is left of motion


def check_initial(initial: str) -> Initial:
    """Return `initial` if it is one of those allowed; else SettingsError names the nearest."""
    for allowed in _INITIALS:
        if initial == allowed:
            return allowed
    raise SettingsError(unknown_name("initial state", initial, _INITIALS))


@dataclass(frozen=True)
class InitialStateParameter:
    """A part of the initial state that is searched for, in SI; searched linearly.

    Attributes
    ----------
    name : str
    low, high, start : float
    drawn : bool
        Whether fresh starts of a search draw it, too; else they begin at `start`.
    """

    name: str
    low: float
    high: float
    start: float
    drawn: bool = True


@lru_cache(maxsize=_REMEMBERED)
def output_noise(recording: Recording) -> Array:
    """Noise of each output, shape (outputs,), SI: from second differences, at least the resolution's; read-only."""
    bend = np.diff(recording.y, n=2, axis=1)
    spread = 1.4826 * np.median(np.abs(bend), axis=1) / np.sqrt(6.0)
    least = np.maximum(recording.resolution / np.sqrt(12.0), 1e-12 * recording.y.std(axis=1))
    noise = np.asarray(np.maximum(spread, least))
    noise.setflags(write=False)
    return noise


@lru_cache(maxsize=_REMEMBERED)
def _first_speed(recording: Recording) -> tuple[float, float, float]:
    """Speed at the first sample if it is even, and if it rises or falls; and the largest of all."""
    course = speed_of(recording)
    first = course[:_FIRST]
    even, bent = (float(np.polyfit(np.arange(len(first)), first, degree)[-1]) for degree in (1, 2))
    return even, bent, float(np.abs(course).max())


def initial_state(recording: Recording, system: StateSpace) -> Array:
    """State, shape (n,), before the first sample of `recording` where nothing about it is searched for."""
    onset = InitialState.of(recording)
    return system.rest(onset.position, onset.speed, float(recording.u[0]))


@dataclass(frozen=True)
class InitialState:
    """Position and speed before the first sample; T is the first input.

    Attributes
    ----------
    position, speed : float
        SI, of all masses but for what is unknown of the others.
    torque : float
        Largest input in SI: twists are counted in those that it gives in even acceleration.
    unknown : tuple of InitialStateParameter
        Parts that are searched for. Their names end in `tag`.
    tag : str
        Tells recordings apart.
    """

    position: float
    speed: float
    torque: float = 0.0
    unknown: tuple[InitialStateParameter, ...] = ()
    tag: str = ""

    @classmethod
    def of(
        cls,
        recording: Recording,
        initial: Initial = "auto",
        tag: str = "",
        limited: tuple[str, ...] = (),
        masses: int = 1,
    ) -> InitialState:
        """Onset of a recording.

        Parameters
        ----------
        recording : Recording
        initial : {'auto', 'rest', 'samples', 'estimated'}
            Speed zero; as the first samples say; or searched for within what the noise of those samples leaves
            open (a free speed would be abused to absorb drift). ``auto`` is at rest unless the first samples clearly
            move, by a tenth of the largest speed; then it is ``estimated``.
        tag : str
        limited : tuple of str
            Names of the limited states, which ``estimated`` searches for, too.
        masses : int
            Masses in a row. ``estimated`` searches for the twist of each shaft and the speed of each further mass, too:
            a drive that moves has swung, and what is left of that is as large as the effects that are looked for.
        """
        kinds = [signal.kind for signal in recording.outputs]
        at = kinds.index("position") if "position" in kinds else None
        position = float(recording.y[at][0]) if at is not None else 0.0
        speed, bent, largest = _first_speed(recording)
        moving = abs(speed) >= _AT_REST * largest > 0.0
        if initial == "rest" or (initial == "auto" and not moving):
            return cls(position, 0.0, 0.0, (), tag)
        unknown: list[InitialStateParameter] = []
        torque = float(np.abs(recording.u).max())
        if initial != "samples":
            noise = output_noise(recording)
            if at is not None:
                slack = _SURE * float(noise[at])
                unknown.append(InitialStateParameter(f"position(0){tag}", position - slack, position + slack, position))
            slack = _SURE * _speed_noise(recording, noise) + abs(bent - speed)
            low, high = speed - slack, speed + slack
            if abs(speed) <= _SURE * _slow_noise(recording):  # it may be at rest, too
                low, high = min(low, 0.0), max(high, 0.0)
            unknown.append(InitialStateParameter(f"speed(0){tag}", low, high, speed))
            unknown += [InitialStateParameter(f"{name}(0)/width{tag}", -1.0, 0.0, -0.5) for name in limited]
            if torque > 0.0:
                share, fast = float(recording.u[0]) / torque, _APART * largest
                for i in range(1, masses):
                    unknown.append(InitialStateParameter(f"twist{i}(0)/full{tag}", -_WOUND, _WOUND, share, drawn=False))
                    unknown.append(
                        InitialStateParameter(f"speed{i + 1}-speed{i}(0){tag}", -fast, fast, 0.0, drawn=False)
                    )
        return cls(position, speed, torque, tuple(unknown), tag)

    def state(self, system: StateSpace, u: float, values: Mapping[str, Array]) -> Array:
        """Initial states, shape (n, K) or (n, 1): of the unknown parts, `values` holds arrays of shape (K,).

        A limited state is counted in widths of its range, from its upper limit, and the shaft it stands in is relaxed;
        then twists are added: those of even acceleration by `u` where they are not known.
        """

        def known(name: str, otherwise: float) -> Array:
            return np.atleast_1d(np.asarray(values.get(name + self.tag, otherwise), float))

        parts = {
            "position": known("position(0)", self.position),
            "speed": known("speed(0)", self.speed),
            "zero": np.zeros(1),
            "input": np.full(1, u),
        }
        rows = [parts[state.at_rest] for state in system.states]
        for element in system.elements:
            if element.limits is not None:
                low, high = element.limits.lower, element.limits.upper
                share = known(f"{system.state_names[element.limits.state]}(0)/width", 0.0)
                rows[element.limits.state] = np.atleast_1d(high + share * (high - low))
        x = np.empty((len(rows), max(map(len, rows))))
        for i, row in enumerate(rows):
            x[i] = row
        for element in system.elements:
            if element.limits is not None:
                _relax(x, system, element)
        speeds, positions = _masses(system)
        if self.torque > 0.0 and len(positions) > 1:
            full = _wound(system, self.torque, speeds, positions)
            x = x + np.zeros(full.shape[1])
            for i in range(1, len(positions)):
                x[positions[i:]] += known(f"twist{i}(0)/full", u / self.torque) * full[i - 1]
                x[speeds[i:]] += known(f"speed{i + 1}-speed{i}(0)", 0.0)
        return x


def _relax(x: Array, system: StateSpace, element: Element) -> None:
    """Shift the masses behind a limited state so that it rests: a shaft that moves evenly is not wound up."""
    row = element.H[0].reshape(len(x), -1)
    place = Placed.parse(element.name).place
    behind = [i for i, name in enumerate(system.state_names) if name.startswith("q") and int(name[1:]) > place]
    x[behind] -= (row * x).sum(axis=0) / row[behind].sum(axis=0)


def _masses(system: StateSpace) -> tuple[list[int], list[int]]:
    """Numbers of the states that are speeds, and of those that are positions, in the order of the masses."""
    kinds = [state.at_rest for state in system.states]
    return [i for i, k in enumerate(kinds) if k == "speed"], [i for i, k in enumerate(kinds) if k == "position"]


def _wound(system: StateSpace, torque: float, speeds: list[int], positions: list[int]) -> Array:
    """Twist of each shaft, shape (masses - 1, K) or (masses - 1, 1), where `torque` accelerates all masses alike.

    Friction aside: this is a measure to count twists by.
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


def _speed_noise(recording: Recording, noise: Array) -> float:
    """Standard deviation of the speed that the first samples tell, the best output counts."""
    found = [np.inf]
    for signal, sigma in zip(recording.outputs, noise.tolist(), strict=True):
        if signal.kind == "position":
            found.append(_INTERCEPT * sigma * np.sqrt(12.0 / _FIRST**3) / recording.dt)
        elif signal.kind != "acceleration":
            found.append(_INTERCEPT * sigma / np.sqrt(_FIRST))
    least = min(found)
    return float(least) if np.isfinite(least) else 0.0


def _slow_noise(recording: Recording) -> float:
    """Standard deviation of the speed that the first samples tell if noise is slow, the worst measured speed counts.

    Slow noise hardly shows from sample to sample, but in differences of means over some of them. Swings of the drive
    show there, too, so that this may be too large.
    """
    found = [0.0]
    for signal, y in zip(recording.outputs, recording.y, strict=True):
        for length in _MEANS if ORDER[signal.kind] == 1 else ():
            means = y[: len(y) // length * length].reshape(-1, length).mean(axis=1)
            if len(means) > 2 * _BEND:
                bend = 1.4826 * float(np.median(np.abs(np.diff(means, n=_BEND))))
                found.append(_INTERCEPT * bend / float(np.sqrt(comb(2 * _BEND, _BEND))))
    return max(found)
