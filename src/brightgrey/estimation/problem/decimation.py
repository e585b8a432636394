"""Decimation of recordings for descents: samples are left out where the motion does not need them.

A step of the simulation is as long as a sample. So a recording with every k-th sample costs a k-th. What a descent has
found is then fitted to all samples. A search decides structures by the samples that are left, too. A noise model of
tens of samples sees ten times as slow a noise, and on a long recording model error is slow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.initial_state import output_noise
from brightgrey.recordings import Recording
from brightgrey.recordings.clocks import straight_lines

__all__ = ["decimated", "decimated_together"]


@dataclass(frozen=True)
class _Policy:
    """Samples that are left out."""

    largest_factor: int = 10
    least_samples: int = 2000  #: Samples that all recordings keep together.
    least_of_each: int = 500  #: Samples that every recording keeps: its noise has a model of its own.
    #: Largest error of the motion of a rigid drive, as part of the noise of each output.
    allowed_error: float = 0.5
    #: Part of the input's power that may be lost: more may excite a resonance.
    allowed_loss: float = 0.01
    min_relative_noise: float = 1e-3  #: Least noise, as part of an output's standard deviation.


POLICY = _Policy()


def decimated_together(recordings: Sequence[Recording], inertia: float) -> tuple[Recording, ...]:
    """Recordings with every k-th sample, for the largest k that all of them allow; they are the same ones if that is 1.

    Parameters
    ----------
    recordings : sequence of Recording
    inertia : float
        Inertia of the drive (mass of an axis in metres), SI.
    """
    samples = [r.samples for r in recordings]
    most = min(POLICY.largest_factor, sum(samples) // POLICY.least_samples, min(samples) // POLICY.least_of_each)
    factor = min(_largest_factor(r, inertia, most) for r in recordings)
    return tuple(recordings if factor == 1 else (decimated(r, factor) for r in recordings))


def decimated(recording: Recording, factor: int) -> Recording:
    """Every `factor`-th sample of a recording.

    A differenced velocity becomes the mean over `factor` samples, which is the difference over the longer interval. An
    input that is held becomes the mean, which has the same impulse. An interpolated one becomes the polygon nearest to
    it in the mean square, which has nearly the same impulse and moment on every interval.
    """
    r, last = recording, (recording.samples - 1) // factor * factor
    y = r.y[:, : last + 1 : factor].copy()
    for row, signal in zip(range(len(y)), r.outputs, strict=True):
        if signal.kind == "velocity-differenced":
            y[row, 1:] = r.y[row, 1 : last + 1].reshape(-1, factor).mean(axis=1)
    if r.hold == "zoh":
        u = np.append(r.u[:last].reshape(-1, factor).mean(axis=1), r.u[last])
    else:
        u = straight_lines(r.t[: last + 1], r.u[: last + 1], r.t[: last + 1 : factor])
    return replace(r, t=r.t[: last + 1 : factor], u=u, y=y)


def _largest_factor(recording: Recording, inertia: float, most: int) -> int:
    """Largest factor up to `most` that keeps the input's power, and whose error moves a rigid drive less than noise."""
    r = recording
    noise = np.maximum(output_noise(r), POLICY.min_relative_noise * r.y.std(axis=1))
    for factor in range(most, 1, -1):
        lost = _interpolated(r, factor) - r.u
        if lost @ lost > POLICY.allowed_loss * float(np.square(r.u - r.u.mean()).sum()):
            continue
        moved = _motions(lost, r.dt, inertia)
        error = [float(np.sqrt(np.mean(np.square(moved[signal.physical.partition("@")[0]])))) for signal in r.outputs]
        if np.all(np.array(error) <= POLICY.allowed_error * noise):
            return factor
    return 1


def _interpolated(recording: Recording, factor: int) -> Array:
    """Input of the decimated recording at the samples of the whole one."""
    coarse = decimated(recording, factor)
    if recording.hold == "zoh":
        held = np.repeat(coarse.u, factor)[: recording.samples]
        return np.concatenate([held, recording.u[held.size :]])
    return np.asarray(np.interp(recording.t, coarse.t, coarse.u))


def _motions(torque: Array, dt: float, inertia: float) -> dict[str, Array]:
    """Motion of a rigid drive by a torque, free from what grows without bounds."""
    acceleration = torque / inertia
    velocity = np.cumsum(acceleration) * dt
    velocity -= velocity.mean()
    position = np.cumsum(velocity) * dt
    return {"acceleration": acceleration, "velocity": velocity, "position": position - position.mean()}
