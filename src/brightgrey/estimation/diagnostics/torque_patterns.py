"""Torques that no effect describes but that a residual may follow, each with the symptom it means.

A new symptom of this kind is one more entry of `TORQUE_PATTERNS`; CONTRIBUTING.md shows an example.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales
from brightgrey.estimation.diagnostics.options import REGRESSOR_DEFAULTS, RegressorOptions
from brightgrey.estimation.noise.orthonormal_basis import orthonormal_basis

__all__ = [
    "FRICTION_WAVE",
    "TORQUE_PATTERNS",
    "TORQUE_WAVE",
    "MovedSegment",
    "SimulatedMotion",
    "TorquePattern",
    "clearest_wave",
]


@dataclass(frozen=True)
class SimulatedMotion:
    """Simulated motion of mass 1 in one recording, rad/s and rad (m/s, m), shape (samples,)."""

    speed: Array
    position: Array

    def relative_position(self) -> Array:
        """Position between -1 and 1 over the travel of the recording."""
        middle = 0.5 * (self.position.max() + self.position.min())
        return np.asarray((self.position - middle) / max(0.5 * float(np.ptp(self.position)), np.finfo(float).tiny))


class MovedSegment(NamedTuple):
    """One output of one recording beside the motion, each of shape (samples,)."""

    residual: Array  #: Weighted.
    weight: float  #: Of the output.
    order: int  #: Time derivatives of the position in the output.
    position: Array
    side: Array  #: Torque of amplitude 1 whose waves are looked for: 1, or the sign of the speed for friction.
    interval: float  #: Sampling interval in s.


def clearest_wave(
    recordings: Sequence[Sequence[MovedSegment]], options: RegressorOptions = REGRESSOR_DEFAULTS
) -> tuple[float, int]:
    """Find the wave over the position whose torque explains most of the residuals of a rigid drive.

    It is a periodogram over the position (Lomb 1976, doi:10.1007/BF00648343) of what the torque does to the outputs.
    Each recording has a phase of its own, because a position often counts from where the recording begins.

    Parameters
    ----------
    recordings : sequence of sequence of MovedSegment
        Segments of each recording.
    options : RegressorOptions

    Returns
    -------
    number : float
        Wave number in 1/rad; 0 if nothing moves, or if no wave explains as much as matters (`min_share`).
    count : int
        Wave numbers that were compared.
    """
    thinned = [[_every_nth(s, options.wave_samples) for s in segments] for segments in recordings]
    travel = max(float(np.ptp(s.position)) for segments in thinned for s in segments)
    step = 2.0 * np.pi * options.wave_step / travel if travel > 0.0 else np.inf
    if not np.isfinite(step):
        return 0.0, 1
    gains = np.zeros(int(options.most_waves / options.wave_step))
    for segments in thinned:
        own = _gains_by_wave(segments, step, gains.size)
        gains[: own.size] += own
    least = options.min_share * sum(float(s.residual @ s.residual) for segments in thinned for s in segments)
    return step * (1 + int(np.argmax(gains))) if gains.max() > least else 0.0, gains.size


def _gains_by_wave(segments: Sequence[MovedSegment], step: float, most: int) -> Array:
    """Decrease of the sum of squares of a recording by each wave number that its samples resolve."""
    steepest = max(float(np.abs(np.diff(s.position)).max(initial=0.0)) for s in segments)
    count = min(most, int(0.5 * np.pi / (steepest * step))) if steepest > 0.0 else 0
    power, squares, along = np.zeros(count), np.zeros(count, complex), np.zeros(count, complex)
    for s in segments:
        turn, wave = np.exp(1j * step * s.position), s.side.astype(complex)
        left, basis = s.residual.astype(complex), _free_motions(s).astype(complex)
        for k in range(count):
            wave = wave * turn
            response = s.weight * wave
            for _ in range(2 - s.order):
                response = np.cumsum(response) * s.interval
            known = response @ basis
            power[k] += np.vdot(response, response).real - np.vdot(known, known).real
            squares[k] += response @ response - known @ known
            along[k] += response @ left
    cosine, sine = 0.5 * (power + squares.real), 0.5 * (power - squares.real)
    both = 0.5 * squares.imag
    clear = np.maximum(cosine * sine - both**2, 1e-9 * power**2 + np.finfo(float).tiny)  # slow waves are nearly free
    gains = sine * along.real**2 + cosine * along.imag**2 - 2.0 * both * along.real * along.imag
    return np.asarray(gains / clear)


def _every_nth(segment: MovedSegment, samples: int) -> MovedSegment:
    """Every n-th sample of a segment, so that at most so many are left, its residual without free motions."""
    n = -(-segment.residual.size // samples)
    thin = {name: getattr(segment, name)[::n] for name in ("residual", "position", "side")}
    thinned = segment._replace(**thin, interval=n * segment.interval)
    basis = _free_motions(thinned)
    return thinned._replace(residual=thinned.residual - basis @ (basis.T @ thinned.residual))


def _free_motions(segment: MovedSegment) -> Array:
    """Orthonormal basis of what initial states and a constant torque do to an output."""
    return orthonormal_basis(np.vander(np.linspace(-1.0, 1.0, segment.residual.size), 2 + (segment.order == 0)))


_HARMONICS = 4  # periods over the travel of the fastest wave of a course over the position
_SLIPS = (1e-3, 1e-2)  # distances over which friction builds up, as parts of the travel


def _harmonics(motion: SimulatedMotion) -> tuple[Array, ...]:
    """Waves over the position, with one to four periods over the travel."""
    angle = np.pi * motion.relative_position()
    return tuple(np.asarray(wave(k * angle)) for k in range(1, _HARMONICS + 1) for wave in (np.sin, np.cos))


def _slipping(motion: SimulatedMotion, sign: Array, share: float) -> Array:
    """Friction of size 1 that builds up over a part of the travel (Dahl 1968), from rest."""
    distance = share * float(np.ptp(motion.position))
    kept = np.exp(-np.abs(np.diff(motion.position, prepend=motion.position[0])) / distance)
    state, course = 0.0, np.empty(sign.size)
    for k, (keep, side) in enumerate(zip(kept.tolist(), sign.tolist(), strict=True)):
        state = side + (state - side) * keep
        course[k] = state
    return course


@dataclass(frozen=True)
class TorquePattern:
    """Torque that may be missing in a model, and the symptom if the residual follows it.

    Attributes
    ----------
    name : str
        Unique name; no effect may have it.
    torques : callable
        ``torques(motion, sign, scales)`` gives one or more arrays of shape (samples,), 1 at most in size. `sign` is
        the smoothed sign of the speed, `scales` holds the largest speed of the recordings.
    title : str
        Title of the symptom, a few words.
    follows : str
        What the residual follows then; it completes "the residual follows".
    advice : str
        What to try; one sentence without its full stop.
    effects : tuple of str
        Names of the effects that the advice tells to try.
    """

    name: str
    torques: Callable[[SimulatedMotion, Array, Scales], tuple[Array, ...]]
    title: str
    follows: str
    advice: str
    effects: tuple[str, ...] = ()


TORQUE_PATTERNS = (
    TorquePattern(
        "direction",
        lambda m, sign, scales: (sign**2, sign * m.speed / scales.speed),
        "Friction depends on the direction",
        "a torque that acts in motion only and in one direction",
        "try direction-dependent viscous friction; constant torque takes a part of it, and friction near standstill is "
        "uncertain",
        ("directional_viscous",),
    ),
    TorquePattern(
        "square of speed",
        lambda m, sign, scales: (sign * (m.speed / scales.speed) ** 2,),
        "Friction grows with the square of speed",
        "the square of speed against the motion",
        "no effect describes it (air, churning oil); use the model within the speeds of the recording",
    ),
    TorquePattern(
        "position",
        lambda m, sign, scales: (sign * m.relative_position(), sign**2 * m.relative_position()),
        "Torque or friction depends on the position",
        "the position",
        "try a spring to the ground; nothing describes a misaligned guide: record only the part of the travel in use",
        ("ground_spring",),
    ),
    TorquePattern(
        "torque ripple with position",
        lambda m, sign, scales: _harmonics(m),
        "Torque repeats with the position",
        "a torque that repeats with the position",
        "try a position-dependent load: an arm, an eccentric load, cogging. Where the structure has one, this one is no"
        " sine, or has another period",
        ("pendulum",),
    ),
    TorquePattern(
        "friction ripple with position",
        lambda m, sign, scales: tuple(sign * wave for wave in _harmonics(m)),
        "Friction repeats with the position",
        "friction that repeats with the position",
        "no effect describes it (a bent spindle, joints of a rail); look for the part that repeats so",
    ),
    TorquePattern(
        "presliding",
        lambda m, sign, scales: tuple(
            _slipping(m, sign, share) - sign for share in _SLIPS if share * float(np.ptp(m.position)) > 0.0
        ),
        "Friction builds up over a distance",
        "friction that builds up over a distance after each reversal (presliding)",
        "no effect describes it; friction near standstill is uncertain, and a gap or a soft shaft may stand for it",
    ),
)
"""All patterns that are tried, in the order in which symptoms are named."""

TORQUE_WAVE, FRICTION_WAVE = "torque ripple with position", "friction ripple with position"
"""Names of the patterns that a wave of any length over the position belongs to."""
