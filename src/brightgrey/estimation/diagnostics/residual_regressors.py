"""What a residual might come from: patterns of torque or motion that it may follow.

A residual of speed is no torque: it is what a missing torque has left after the drive has answered it. Each pattern is
therefore put through the fitted model, as a small torque beside the input, and the residual is asked whether it follows
the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Effect, Scales, registry
from brightgrey.estimation.diagnostics.torque_patterns import TORQUE_PATTERNS, SimulatedMotion, TorquePattern
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import Structure
from brightgrey.numerics.digital_filter import lfilter
from brightgrey.recordings import Recording, Signal
from brightgrey.recordings.units.signals import KINDS
from brightgrey.simulation import Settings

__all__ = [
    "DRIFT",
    "RESONANCE",
    "TIME_SHIFT",
    "ResidualRegressor",
    "candidate_regressors",
    "motions",
]

_SMALL = 0.01  # of the largest torque
_PERIODS = 3.0
_FASTEST = 0.3  # of the sampling rate
_DAMPED = 0.05  # damping ratio of the resonances that are tried; they overlap
_MOTION = (Signal("speed", "velocity", "rad/s"), Signal("position", "position", "rad"))

TIME_SHIFT = "shift"
"""Kind of the suspect whose coefficient is a time in s by which the output comes late."""
DRIFT = "drift"
"""Kind of the suspect that is a straight line over time."""
RESONANCE = "resonance"
"""Kind of the suspects that are resonances."""


@dataclass(frozen=True)
class ResidualRegressor:
    """What a residual might come from.

    Attributes
    ----------
    kind : str
        Name of an effect, or of a pattern that no effect describes.
    columns : ndarray, shape (residuals, k)
        How the weighted residuals change with it.
    described : bool
        Some effect describes it.
    frequency : float
        In Hz, of a resonance.
    """

    kind: str
    columns: Array
    described: bool = True
    frequency: float = 0.0


def motions(problem: SimulationErrorProblem, named: Mapping[str, Array], settings: Settings) -> list[SimulatedMotion]:
    """Simulated motion of mass 1 in every recording, for one parameter set."""
    found = []
    for r, onset in zip(problem.recordings, problem.initial_states, strict=True):
        empty = replace(r, outputs=_MOTION, y=np.zeros((2, r.samples)), resolution=np.ones(2))
        speed, position = predict_many(problem.structure, named, empty, settings, initial_state=onset)[:, :, 0]
        found.append(SimulatedMotion(speed, position))
    return found


Torques = Callable[[SimulatedMotion], tuple[Array, ...]]


def patterns(structure: Structure, scales: Scales, f_tanh: float) -> dict[str, Torques]:
    """Torques, 1 at most, that may be missing: those of effects that say what follows them, and some of no effect."""
    present = {p.name for p in structure.placed}
    missing = [e for e in registry().values() if e.residual_signature and e.name not in present]
    return {e.name: _torque(e, scales, f_tanh) for e in missing} | {
        p.name: partial(_pattern, p, scales, f_tanh) for p in TORQUE_PATTERNS
    }


def candidate_regressors(
    problem: SimulationErrorProblem, named: Mapping[str, Array], settings: Settings, scales: Scales, residual: Array
) -> list[ResidualRegressor]:
    """All suspects at the values `named`, arrays of shape (1,), where the weighted residual is `residual`."""
    structure, moved = problem.structure, motions(problem, named, settings)
    if not all(np.isfinite(m.speed).all() and np.isfinite(m.position).all() for m in moved):
        return []
    lags = sum(float(named[name][0]) for name, p in structure.parameters.items() if p.lag)
    size = _SMALL * scales.torque
    found = []
    for kind, torques in patterns(structure, scales, settings.f_tanh).items():
        by_torque = zip(*([size * torque for torque in torques(m)] for m in moved), strict=True)
        columns = [_answer(problem, named, settings, residual, list(each), lags) for each in by_torque]
        found.append(ResidualRegressor(kind, np.stack(columns, axis=1), kind in registry()))
    found.append(ResidualRegressor(DRIFT, _lines(problem), False))
    found += [ResidualRegressor(RESONANCE, _swing(problem, f, lags), frequency=f) for f in _frequencies(scales)]
    if not any(p.lag for p in structure.parameters.values()):
        found.append(ResidualRegressor(TIME_SHIFT, _rates(problem, residual)[:, None]))
    return [s for s in found if np.isfinite(s.columns).all() and s.columns.any()]


def _pattern(pattern: TorquePattern, scales: Scales, f_tanh: float, motion: SimulatedMotion) -> tuple[Array, ...]:
    """Torques of a pattern for one motion."""
    return pattern.torques(motion, np.asarray(np.tanh(f_tanh * motion.speed)), scales)


def _torque(effect: Effect, scales: Scales, f_tanh: float) -> Torques:
    """Torque of an effect at its declared start, over its largest value."""
    law = effect.law
    assert law is not None
    values = {q.symbol: abs(float(q.start(scales))) for q in effect.parameters} | {"f_tanh": f_tanh}
    p = tuple(values[symbol] for symbol in law.parameters)

    def torques(m: SimulatedMotion) -> tuple[Array, ...]:
        torque = np.broadcast_to(law.value((m.speed,)[: law.ports], p)[0], m.speed.shape)
        return (np.asarray(torque / max(float(np.abs(torque).max()), np.finfo(float).tiny)),)

    return torques


def _answer(
    problem: SimulationErrorProblem,
    named: Mapping[str, Array],
    settings: Settings,
    residual: Array,
    torques: list[Array],
    lags: float,
) -> Array:
    """Change of the weighted outputs by torques beside the inputs, ahead by what the drive lags."""
    disturbed: list[Recording] = []
    for r, torque in zip(problem.recordings, torques, strict=True):
        disturbed.append(replace(r, u=r.u + np.interp(r.t + lags, r.t, torque)))
    changed = replace(problem, recordings=tuple(disturbed)).residuals(dict(named), settings)[:, 0]
    return np.asarray(changed - residual)


def _frequencies(scales: Scales) -> Array:
    """Frequencies in Hz at which one resonance or another is near: three periods in a recording to 0.3 of its rate."""
    low, high = _PERIODS / scales.duration, _FASTEST / scales.interval
    return np.geomspace(low, high, max(int(np.log(high / low) / (2.0 * _DAMPED)), 2))


def _swing(problem: SimulationErrorProblem, frequency: float, lags: float) -> Array:
    """What a resonance makes of the input: the twist of a shaft and its rate, in terms of each output.

    The twist of two masses that are coupled by a shaft is a resonance driven by the torque on the first, and the speed
    of that is the speed of both together plus a part of the twist's rate: exactly, whatever their ratio.
    """
    turning = 2.0 * np.pi * frequency
    columns = np.zeros((problem.samples, 2))
    for begin, r, out in _blocks(problem):
        u = np.interp(r.t - lags, r.t, r.u) - r.u[0]
        order = KINDS[r.outputs[out].kind]
        for column, rate in enumerate((order, order + 1 if order < 2 else order - 1)):
            answer = lfilter(*_resonance(rate, turning, r.dt), u)
            columns[begin : begin + r.samples, column] = problem.weights[out] * answer
    return columns


def _resonance(rate: int, turning: float, dt: float) -> tuple[Array, Array]:
    """Digital filter of w^(2-rate) s^rate / (s^2 + 2 D w s + w^2) by the bilinear transform."""
    k = 2.0 / dt
    damped = 2.0 * _DAMPED * turning * k
    above = np.array(([1.0, 2.0, 1.0], [k, 0.0, -k], [k**2, -2.0 * k**2, k**2])[rate])
    below = np.array([k**2 + damped + turning**2, 2.0 * (turning**2 - k**2), k**2 - damped + turning**2])
    return turning ** (2 - rate) * above / below[0], below / below[0]


def _blocks(problem: SimulationErrorProblem) -> list[tuple[int, Recording, int]]:
    """First residual, recording and output of every stretch."""
    found, begin = [], 0
    for r in problem.recordings:
        for out in range(len(r.outputs)):
            found.append((begin, r, out))
            begin += r.samples
    return found


def _lines(problem: SimulationErrorProblem) -> Array:
    """A straight line over time for each stretch, 1 from its begin to its end in the output's SI unit."""
    blocks = _blocks(problem)
    columns = np.zeros((problem.samples, len(blocks)))
    for column, (begin, r, out) in enumerate(blocks):
        columns[begin : begin + r.samples, column] = problem.weights[out] * np.linspace(-0.5, 0.5, r.samples)
    return columns


def _rates(problem: SimulationErrorProblem, residual: Array) -> Array:
    """Derivative by time of the weighted simulated outputs."""
    rates = np.zeros(problem.samples)
    for begin, r, out in _blocks(problem):
        part = slice(begin, begin + r.samples)
        rates[part] = np.gradient(residual[part] + problem.weights[out] * r.y[out], r.dt)
    return rates
