"""Envelope of a motion: the limits it keeps for all draws of the parameters, and the setpoint that it follows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.initial_state import InitialState
from brightgrey.kit import Structure
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.limits import MachineLimits
from brightgrey.planning.position_loop import Setpoint, setpoint_along
from brightgrey.simulation import response

__all__ = [
    "Envelope",
    "MotionCommand",
    "Reaction",
    "command_of",
    "envelope",
    "nominal_reaction",
    "reaction",
    "recorded_torque",
]


class MotionCommand(NamedTuple):
    """Input of the machine: a torque, or a setpoint with its feed-forward."""

    torque: Array  #: Torque in open loop, feed-forward in closed loop; N m (N), shape (samples,).
    setpoint: Setpoint | None  #: In closed loop.


class Reaction(NamedTuple):
    """Motion of K parameter sets; not-a-number from the sample on at which one diverged."""

    torque: Array  #: As the drive commands it, N m (N), shape (samples, K); in open loop (samples, 1).
    #: Of all masses, shape (masses, samples, K).
    position: Array
    velocity: Array


@dataclass(frozen=True)
class Envelope:
    """Reaction of K parameter sets in a motion; each array of shape (K,), in parts of the limits."""

    use: Mapping[str, Array]  #: By limit; 1 is at the limit.
    end_speed: Array  #: Speed at the end over the limit of speed.

    def share_kept(self) -> float:
        """Share of the sets that keep all limits and end at rest."""
        kept = np.all([use <= 1.0 for use in self.use.values()], axis=0)
        return float(np.mean(kept & (self.end_speed <= REST)))

    def excess(self) -> float:
        """Largest excess over a limit of the worst set, 0 if all are kept."""
        worst = [float(use.max()) - 1.0 for use in self.use.values()]
        return max(0.0, *worst, float(self.end_speed.max()) - REST)

    def tightest(self) -> str:
        """Limit that 99 % of the sets use most, or ``rest`` if they do not come to rest."""
        use = {name: self.of_most(part) for name, part in self.use.items()}
        name = max(use, key=lambda name: use[name])
        return "rest" if use[name] <= 1.0 and self.of_most(self.end_speed) > REST else name

    @staticmethod
    def of_most(part: Array) -> float:
        """Value that 99 % of the sets do not exceed; infinite if more than 1 % diverge."""
        return float(np.quantile(part, 0.99, method="inverted_cdf"))


REST = 0.01
"""Speed at the end, over the limit of speed, below which a drive counts as at rest."""


def command_of(drive: PlannedDrive, torque: Array) -> MotionCommand:
    """MotionCommand for a torque; in closed loop the setpoint is the motion that the identified drive makes with it."""
    if drive.loop is None:
        return MotionCommand(torque, None)
    found = nominal_reaction(replace(drive, loop=None), MotionCommand(torque, None))
    along = setpoint_along(found.position[0, :, 0], found.velocity[0, :, 0], torque, drive.known.sampling_time)
    return MotionCommand(torque, along)


def nominal_reaction(drive: PlannedDrive, command: MotionCommand) -> Reaction:
    """Reaction of the drive as identified."""
    known = drive.known.model
    values = {name: np.array([value]) for name, value in known.values.items()}
    return reaction(drive, known.structure, values, command)


def recorded_torque(drive: PlannedDrive, command: MotionCommand) -> Array:
    """Torque that the drive as identified is recorded with; in closed loop its controller changes the feed-forward."""
    return command.torque if drive.loop is None else nominal_reaction(drive, command).torque[:, 0]


def reaction(drive: PlannedDrive, structure: str, values: Mapping[str, Array], command: MotionCommand) -> Reaction:
    """Reaction of parameter sets of a structure, which begin at rest at the drive's side of the gap."""
    masses, dt = Structure.parse(structure).masses, drive.known.sampling_time
    names = [f"{kind}@{k + 1}" if k else kind for kind in ("position", "velocity") for k in range(masses)]
    system, sets = drive.system(structure, values, names), np.size(next(iter(values.values())))
    begin = InitialState(0.0, 0.0).state(
        system, 0.0, {name: np.array([share]) for name, share in drive.begin_in_gaps(system).items()}
    )
    if drive.loop is None or command.setpoint is None:
        x0 = np.broadcast_to(begin, (len(begin), sets))
        y = response(system, command.torque, dt, x0, drive.settings).y
        return Reaction(command.torque[:, None], y[:masses], y[masses:])
    closed, reference = drive.loop.around(system), drive.loop.reference_input(command.setpoint, dt)
    if not np.isfinite(reference).all():  # the setpoint's simulation diverged
        lost = np.full((masses, reference.size, sets), np.nan)
        return Reaction(lost[0], lost, lost)
    x0 = np.zeros((len(closed.states), sets))
    x0[: len(begin)] = begin
    settings = replace(drive.settings, hold="linear")
    y = response(closed, drive.loop.simulated_input(command.setpoint, dt), dt, x0, settings).y
    q, v = y[:masses], y[masses : 2 * masses]
    return Reaction(drive.loop.torque(reference, q[0], v[0], y[-1]), q, v)


def envelope(
    drive: PlannedDrive, structure: str, values: Mapping[str, Array], command: MotionCommand, limits: MachineLimits
) -> Envelope:
    """Envelope of parameter sets of a structure."""
    dt = drive.known.sampling_time
    u, q, v = reaction(drive, structure, values, command)
    slope = np.abs(np.diff(u, axis=0)).max(axis=0) / dt
    reached = {
        "torque": np.abs(u).max(axis=0),
        "rms_torque": np.sqrt(np.mean(u**2, axis=0)),
        "speed": np.abs(v[0]).max(axis=0),
        "acceleration": np.abs(np.diff(v[0], axis=0)).max(axis=0) / dt,
        "jerk": slope / drive.rigid.inertia,
        "travel": np.ptp(q[0], axis=0),
        "twist": np.abs(np.diff(q, axis=0)).max(axis=(0, 1), initial=0.0),
    }
    shape = v.shape[2:]
    use = {
        f.name: np.nan_to_num(np.broadcast_to(reached[f.name], shape) / getattr(limits, f.name), nan=np.inf)
        for f in fields(limits)
    }
    end = np.nan_to_num(np.abs(v[:, -1]).max(axis=0) / limits.speed, nan=np.inf)
    return Envelope(use, end)
