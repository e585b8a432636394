"""Candidate regressors of a residual: torques and motions that the model may lack.

A residual of speed is no torque: it is the response of the drive to a missing torque. Each candidate torque is
therefore simulated with the fitted model, as a small torque beside the input. Its response is the regressor. Friction
at masses that the input does not act on is simulated as a small effect there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Effect, Scales, registry
from brightgrey.estimation.diagnostics.options import REGRESSOR_DEFAULTS, RegressorOptions
from brightgrey.estimation.diagnostics.torque_patterns import (
    FRICTION_WAVE,
    TORQUE_PATTERNS,
    TORQUE_WAVE,
    MovedSegment,
    SimulatedMotion,
    TorquePattern,
    clearest_wave,
)
from brightgrey.estimation.problem.segments import segments
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import Placed, Structure
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

_MOTION = (Signal("speed", "velocity", "rad/s"), Signal("position", "position", "rad"))

TIME_SHIFT = "shift"
"""Kind of the regressor whose coefficient is the time in s by which the output comes late."""
DRIFT = "drift"
"""Kind of the regressor that is a straight line over time."""
RESONANCE = "resonance"
"""Kind of the regressors that are resonances."""


@dataclass(frozen=True)
class ResidualRegressor:
    """Candidate regressor of a residual."""

    kind: str  #: Name of an effect with its place, or of a torque that no effect describes.
    #: Makes the derivatives of the weighted residuals by its coefficients, shape (residuals, k). Those of all
    #: resonances together would take too much memory.
    columns: Callable[[], Array]
    described: bool = True  #: True if an effect describes it.
    frequency: float = 0.0  #: Frequency of a resonance in Hz.
    compared: int = 1  #: Like regressors of which this one is the best.


def motions(problem: SimulationErrorProblem, values: Mapping[str, Array], settings: Settings) -> list[SimulatedMotion]:
    """Simulated motion of mass 1 in every recording, for one parameter set: arrays of shape (1,) by name."""
    found = []
    for r, state in zip(problem.recordings, problem.initial_states, strict=True):
        empty = replace(r, outputs=_MOTION, y=np.zeros((2, r.samples)), resolution=np.ones(2))
        speed, position = predict_many(problem.structure, values, empty, settings, initial_state=state)[:, :, 0]
        found.append(SimulatedMotion(speed, position))
    return found


Torques = Callable[[SimulatedMotion], tuple[Array, ...]]


def candidate_torques(structure: Structure, scales: Scales, f_tanh: float) -> dict[str, Torques]:
    """Torques of amplitude 1 at most that the model may lack: of missing effects, and some that no effect describes."""
    present = {p.name for p in structure.placed}
    missing = [
        e
        for e in registry().values()
        if e.residual_signature
        and e.name not in present
        and not (e.port_reads == "position" and len(e.parameters) > 1)  # a pattern stands for any course over position
    ]
    return {e.name: _effect_torque(e, scales, f_tanh) for e in missing} | {
        p.name: partial(_pattern_torques, p, scales, f_tanh) for p in TORQUE_PATTERNS
    }


def candidate_regressors(
    problem: SimulationErrorProblem,
    values: Mapping[str, Array],
    settings: Settings,
    scales: Scales,
    residual: Array,
    options: RegressorOptions = REGRESSOR_DEFAULTS,
) -> list[ResidualRegressor]:
    """All candidate regressors of a weighted residual.

    Parameters
    ----------
    problem : SimulationErrorProblem
    values : mapping of str to ndarray, shape (1,)
        Estimates by name, SI.
    settings : Settings
    scales : Scales
    residual : ndarray, shape (residuals,)
        Weighted residual at these values.
    options : RegressorOptions
    """
    structure, moved = problem.structure, motions(problem, values, settings)
    if not all(np.isfinite(m.speed).all() and np.isfinite(m.position).all() for m in moved):
        return []
    lags = sum(float(values[name][0]) for name, p in structure.parameters.items() if p.lag)
    size = options.torque * scales.torque

    def responses(torques: Iterable[Sequence[Array]]) -> Array:
        """Columns of torques, each given for every recording."""
        each = [[size * torque for torque in by_recording] for by_recording in torques]
        return np.stack([_response(problem, values, settings, residual, one, lags) for one in each], axis=1)

    found = []
    for kind, torques in candidate_torques(structure, scales, settings.f_tanh).items():
        columns = responses(zip(*(torques(m) for m in moved), strict=True))
        found.append(ResidualRegressor(kind, _made_once(columns), kind in registry()))
    for kind in (TORQUE_WAVE, FRICTION_WAVE):
        sides = [np.tanh(settings.f_tanh * m.speed) if kind == FRICTION_WAVE else np.ones(m.speed.size) for m in moved]
        number, compared = clearest_wave(_moved_segments(problem, moved, sides, residual), options)
        if not number:
            continue
        waves = [
            [
                side * wave(number * m.position) * (k == own)
                for k, (side, m) in enumerate(zip(sides, moved, strict=True))
            ]
            for own in range(len(moved))  # with a phase of its own
            for wave in (np.sin, np.cos)
        ]
        found.append(ResidualRegressor(kind, _made_once(responses(waves)), False, compared=compared))
    for placed in _friction_elsewhere(structure):
        column = _response_of_effect(problem, values, settings, residual, placed, scales)
        found.append(ResidualRegressor(str(placed), _made_once(column[:, None])))
    found.append(ResidualRegressor(DRIFT, partial(_straight_lines, problem), False))
    for frequency in _frequencies(scales, options).tolist():
        twist_and_rate = partial(_resonance_response, problem, frequency, options.damping_ratio, lags)
        found.append(ResidualRegressor(RESONANCE, twist_and_rate, frequency=frequency))
    if not any(p.lag for p in structure.parameters.values()):
        found.append(ResidualRegressor(TIME_SHIFT, _made_once(_output_rates(problem, residual)[:, None])))
    return [regressor for regressor in found if _may_be_followed(regressor.columns())]


def _made_once(columns: Array) -> Callable[[], Array]:
    """Keep columns that took a simulation, in place of making them whenever they are asked for."""
    return lambda: columns


def _may_be_followed(columns: Array) -> bool:
    """True if a residual can follow the columns."""
    return bool(np.isfinite(columns).all() and columns.any())


def _moved_segments(
    problem: SimulationErrorProblem, moved: Sequence[SimulatedMotion], sides: Sequence[Array], residual: Array
) -> list[list[MovedSegment]]:
    """Residual of every output beside its motion, by recording."""
    found: list[list[MovedSegment]] = [[] for _ in moved]
    numbers = [k for k, r in enumerate(problem.recordings) for _ in r.outputs]
    for k, (rows, r, output) in zip(numbers, segments(problem.recordings), strict=True):
        kind, m = r.outputs[output].kind, moved[k]
        left = residual[rows] * (np.sign(m.speed) if kind == "speed" else 1.0)  # as if it had its sign
        part = MovedSegment(left, float(problem.weights[output]), KINDS[kind], m.position, sides[k], r.dt)
        found[k].append(part)
    return found


def _pattern_torques(
    pattern: TorquePattern, scales: Scales, f_tanh: float, motion: SimulatedMotion
) -> tuple[Array, ...]:
    """Torques of a pattern for one motion."""
    return pattern.torques(motion, np.asarray(np.tanh(f_tanh * motion.speed)), scales)


def _effect_torque(effect: Effect, scales: Scales, f_tanh: float) -> Torques:
    """Torque of an effect at its declared start values, over its largest value."""
    law = effect.law
    assert law is not None
    values = {q.symbol: abs(float(q.start(scales))) for q in effect.parameters} | {"f_tanh": f_tanh}
    p = tuple(values[symbol] for symbol in law.parameters)

    def torques(m: SimulatedMotion) -> tuple[Array, ...]:
        port = m.position if effect.port_reads == "position" else m.speed
        torque = np.broadcast_to(law.value((port,)[: law.ports], p)[0], m.speed.shape)
        return (np.asarray(torque / max(float(np.abs(torque).max()), np.finfo(float).tiny)),)

    return torques


def _response(
    problem: SimulationErrorProblem,
    values: Mapping[str, Array],
    settings: Settings,
    residual: Array,
    torques: list[Array],
    lags: float,
) -> Array:
    """Change of the weighted outputs by torques beside the inputs, ahead by the lags of the drive."""
    disturbed: list[Recording] = []
    for r, torque in zip(problem.recordings, torques, strict=True):
        disturbed.append(replace(r, u=r.u + np.interp(r.t + lags, r.t, torque)))
    changed = replace(problem, recordings=tuple(disturbed)).residuals(dict(values), settings)[:, 0]
    return np.asarray(changed - residual)


def _friction_elsewhere(structure: Structure) -> list[Placed]:
    """Friction that a structure lacks at masses beyond the first; elsewhere other torques hardly differ from there."""
    laws = [e.name for e in registry().values() if e.residual_signature and e.port_reads == "speed" and not e.requires]
    possible = [Placed(name, place) for place in range(2, structure.masses + 1) for name in laws]
    lacking = [placed for placed in possible if placed not in structure.placed]
    return [placed for placed in lacking if not any(placed.excludes(other) for other in structure.placed)]


def _response_of_effect(
    problem: SimulationErrorProblem,
    values: Mapping[str, Array],
    settings: Settings,
    residual: Array,
    placed: Placed,
    scales: Scales,
) -> Array:
    """Change of the weighted outputs by one more effect of the least size that matters, or else as declared."""
    larger = replace(problem, structure=Structure((*problem.structure.placed, placed)))
    declared = {placed.parameter(q.symbol): float(q.start(scales)) for q in placed.effect.parameters}
    size = placed.relevant_size(scales, {name: float(value[0]) for name, value in values.items()})
    more = {name: np.array([value]) for name, value in {**declared, **size}.items()}
    return np.asarray(larger.residuals({**values, **more}, settings)[:, 0] - residual)


def _frequencies(scales: Scales, options: RegressorOptions) -> Array:
    """Frequencies in Hz, so close that each resonance in the range is near one of them."""
    low, high = options.min_periods / scales.duration, options.max_frequency / scales.interval
    return np.geomspace(low, high, max(int(np.log(high / low) / (2.0 * options.damping_ratio)), 2))


def _resonance_response(problem: SimulationErrorProblem, frequency: float, damping_ratio: float, lags: float) -> Array:
    """Response of a resonance to the input: the twist of a shaft and its rate, in terms of each output.

    The twist of two masses that are coupled by a shaft is a resonance driven by the torque on the first mass. The speed
    of that mass is the common speed of both plus a part of the twist's rate: exactly, whatever their ratio.
    """
    omega = 2.0 * np.pi * frequency
    columns = np.zeros((problem.samples, 2))
    for rows, r, output in segments(problem.recordings):
        u = np.interp(r.t - lags, r.t, r.u) - r.u[0]
        order = KINDS[r.outputs[output].kind]
        for column, rate in enumerate((order, order + 1 if order < 2 else order - 1)):
            response = lfilter(*_resonance_filter(rate, omega, damping_ratio, r.dt), u)
            columns[rows, column] = problem.weights[output] * response
    return columns


def _resonance_filter(rate: int, omega: float, damping_ratio: float, dt: float) -> tuple[Array, Array]:
    """Digital filter of w^(2-rate) s^rate / (s^2 + 2 D w s + w^2) by the bilinear transform."""
    k = 2.0 / dt
    damping = 2.0 * damping_ratio * omega * k
    numerator = np.array(([1.0, 2.0, 1.0], [k, 0.0, -k], [k**2, -2.0 * k**2, k**2])[rate])
    denominator = np.array([k**2 + damping + omega**2, 2.0 * (omega**2 - k**2), k**2 - damping + omega**2])
    return omega ** (2 - rate) * numerator / denominator[0], denominator / denominator[0]


def _straight_lines(problem: SimulationErrorProblem) -> Array:
    """A straight line over time for each segment, 1 from its first to its last sample in the output's SI unit."""
    lengths = problem.segment_lengths
    columns = np.zeros((problem.samples, len(lengths)))
    for column, (rows, r, output) in enumerate(segments(problem.recordings)):
        columns[rows, column] = problem.weights[output] * np.linspace(-0.5, 0.5, r.samples)
    return columns


def _output_rates(problem: SimulationErrorProblem, residual: Array) -> Array:
    """Derivative by time of the weighted simulated outputs."""
    rates = np.zeros(problem.samples)
    for rows, r, output in segments(problem.recordings):
        rates[rows] = np.gradient(residual[rows] + problem.weights[output] * r.y[output], r.dt)
    return rates
