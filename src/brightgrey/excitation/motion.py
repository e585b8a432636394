"""Jerk-limited motions of an axis, as the generator of a drive commands them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError

__all__ = ["Motion", "MotionLimits", "moves", "reversing"]


@dataclass(frozen=True)
class MotionLimits:
    """Largest speed (rad/s), acceleration (rad/s²) and jerk (rad/s³) of a move; m in a linear axis.

    Raises
    ------
    SettingsError
        If one of them is not a positive number.
    """

    speed: float
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "jerk"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise SettingsError(f"limit of {name} = {value:g} must be a positive number")


@dataclass(frozen=True)
class Motion:
    """A motion sampled at equal intervals."""

    t: Array  #: Time in s from 0, shape (samples,).
    #: rad, rad/s, rad/s² (m in a linear axis), shape (samples,).
    position: Array
    velocity: Array
    acceleration: Array


def moves(
    targets: Sequence[float], limits: MotionLimits, *, dt: float, samples: int, before: float, between: float
) -> Motion:
    """Return jerk-limited, time-optimal moves from one position to the next, with rests in between.

    Parameters
    ----------
    targets : sequence of float
        Positions in rad, one after the other; the motion starts at 0, at rest.
    limits : MotionLimits
    dt : float
        Sampling interval in s.
    samples : int
        Number of samples; after the last move the axis rests.
    before, between : float
        Rest before the first move and between moves in s.

    Returns
    -------
    Motion

    Raises
    ------
    SettingsError
        If the moves do not fit into `samples`, or if `dt`, a rest or a target is invalid.

    Notes
    -----
    The trajectories are ruckig's (Berscheid, Kröger 2021, doi:10.15607/RSS.2021.XVII.015).
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise SettingsError(f"dt = {dt:g} must be a positive number of seconds")
    if not (before >= 0.0 and between >= 0.0 and all(math.isfinite(x) for x in targets)):
        raise SettingsError("rests must not be negative, and targets must be finite")
    t: Array = np.arange(samples, dtype=np.float64) * np.float64(dt)
    motion: Array = np.zeros((3, samples))
    here, begin = 0.0, before
    for target in targets:
        move = _move(here, target, limits)
        end = begin + move.duration
        during = (t >= begin) & (t < end)
        motion[:, during] = np.array([move.at_time(s) for s in t[during] - begin]).reshape(-1, 3).T
        motion[:, t >= end] = [[target], [0.0], [0.0]]
        here, begin = target, end + between
    if targets and end > t[-1]:
        raise SettingsError(f"the moves end at {end:.3f} s, the recording at {t[-1]:.3f} s")
    return Motion(t, motion[0], motion[1], motion[2])


def reversing(
    distance: float, limits: MotionLimits, *, dt: float, samples: int, before: float, between: float
) -> Motion:
    """Return a move by `distance` (rad) and back; for all else, errors included, see :func:`moves`."""
    return moves((distance, 0.0), limits, dt=dt, samples=samples, before=before, between=between)


def _move(start: float, target: float, limits: MotionLimits) -> Trajectory:
    """Return the time-optimal move from rest to rest."""
    request = InputParameter(1)
    request.current_position, request.target_position = [start], [target]
    request.max_velocity, request.max_acceleration = [limits.speed], [limits.acceleration]
    request.max_jerk = [limits.jerk]
    move = Trajectory(1)
    outcome = Ruckig(1).calculate(request, move)
    if outcome not in (Result.Working, Result.Finished):
        raise SettingsError(f"no move from {start:g} to {target:g} within {limits}: {outcome}")
    return move
