"""Envelope of a motion: the limits it keeps for all draws of the parameters, and the setpoint that it follows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import Structure
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.limits import MachineLimits
from brightgrey.simulation import response

__all__ = ["Envelope", "envelope", "motion_of"]


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
        """Limit that is used most."""
        return max(self.use, key=lambda name: float(self.use[name].max()))


REST = 0.01
"""Speed at the end, over the limit of speed, below which a drive counts as at rest."""


def motion_of(drive: PlannedDrive, structure: str, values: Mapping[str, Array], torque: Array) -> Array:
    """Positions and velocities of all masses, shape (2 masses, samples, K); not-a-number where diverged."""
    masses = Structure.parse(structure).masses
    names = [f"{kind}@{k + 1}" if k else kind for kind in ("position", "velocity") for k in range(masses)]
    system = drive.system(structure, values, names)
    x0 = np.zeros((len(system.states), np.size(next(iter(values.values())))))
    return response(system, torque, drive.known.sampling_time, x0, drive.settings, threads=drive.threads).y


def envelope(
    drive: PlannedDrive, structure: str, values: Mapping[str, Array], torque: Array, limits: MachineLimits
) -> Envelope:
    """Envelope of parameter sets of a structure."""
    dt = drive.known.sampling_time
    y = motion_of(drive, structure, values, torque)
    masses = len(y) // 2
    q, v = y[:masses], y[masses:]
    sets = y.shape[2]
    slope = float(np.abs(np.diff(torque, prepend=0.0)).max()) / dt
    reached = {
        "torque": np.full(sets, np.abs(torque).max()),
        "rms_torque": np.full(sets, np.sqrt(np.mean(torque**2))),
        "speed": np.abs(v[0]).max(axis=0),
        "acceleration": np.abs(np.diff(v[0], axis=0)).max(axis=0) / dt,
        "jerk": np.full(sets, slope / drive.rigid.inertia),
        "travel": np.ptp(q[0], axis=0),
        "twist": np.abs(np.diff(q, axis=0)).max(axis=(0, 1), initial=0.0),
    }
    use = {f.name: np.nan_to_num(reached[f.name] / getattr(limits, f.name), nan=np.inf) for f in fields(limits)}
    end = np.nan_to_num(np.abs(v[:, -1]).max(axis=0) / limits.speed, nan=np.inf)
    return Envelope(use, end)
