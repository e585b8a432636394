"""Random drives in plausible ranges, for benchmarks and tests.

The functions take names of parameters and not structures, because this room lies below the effects.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.excitation.experiment import PAPER_EXPERIMENT, Experiment

__all__ = ["DRIVE_RANGES", "DriveRanges", "modes", "random_values"]


@dataclass(frozen=True)
class DriveRanges:
    """Ranges of random drives. Draws are uniform in the logarithm."""

    total_inertia: tuple[float, float] = (0.7, 1.4)
    """Sum of all moments of inertia, in parts of the experiment's."""
    inertia_ratio: float = 100.0
    """Largest ratio of two moments of inertia."""
    resonance: tuple[float, float] = (5.0, 200.0)
    """Every resonance in Hz."""
    damping_ratio: tuple[float, float] = (0.01, 0.3)
    """Damping ratio of every resonance."""
    friction: tuple[float, float] = (0.01, 0.5)
    """Torque of each kind of friction, in parts of the peak torque."""
    max_total_friction: float = 0.6
    """Sum of all friction torques, in parts of the peak torque; larger sums are scaled down to it."""
    gravity: tuple[float, float] = (0.01, 0.2)
    """Size of the constant torque, in parts of the peak torque; both signs are equally likely."""
    stribeck_speed: tuple[float, float] = (0.02, 0.3)
    """Stribeck speed, in parts of the peak speed."""
    small_gap: tuple[float, float] = (1e-4, 1e-2)
    """Half of a small gap, ``alpha``, in rad."""
    large_gap: tuple[float, float] = (0.005, 0.2)
    """A large gap, 2 ``alpha``, in parts of the distance of the motion."""
    current_loop: tuple[float, float] = (2e-4, 2e-2)
    """Time constant of the current control in s."""
    dead_time: tuple[float, float] = (1e-4, 2e-2)
    """Dead time in s."""
    asymmetry: tuple[float, float] = (0.1, 0.9)
    """Difference of viscous friction between the directions, in parts of their sum."""
    ground_spring: tuple[float, float] = (0.02, 0.5)
    """Torque of a spring to the ground over the distance of the motion, in parts of the peak torque."""
    pendulum: tuple[float, float] = (0.02, 0.5)
    """Largest torque of gravity on an arm, in parts of the peak torque."""
    hardening: tuple[float, float] = (0.1, 10.0)
    """Torque by the third power of the twist over that by the twist, where the latter is the peak torque."""
    turns: tuple[float, float] = (0.25, 3.0)
    """Turns of that arm over the distance of the motion."""
    max_tries: int = 100_000
    """Draws of a chain of masses until all resonances and damping ratios are within their ranges."""


DRIVE_RANGES = DriveRanges()


def random_values(
    names: Iterable[str],
    rng: np.random.Generator,
    experiment: Experiment = PAPER_EXPERIMENT,
    ranges: DriveRanges = DRIVE_RANGES,
) -> dict[str, float]:
    """Draw a value for every named parameter, sized to the torque and speed of `experiment`.

    All draws are uniform in the logarithm. A chain of masses with a resonance or a damping ratio out of range is
    drawn again. A gap is small or large with even odds.

    Parameters
    ----------
    names : iterable of str
        Parameters of a structure (``Structure.parameters``), at any place: ``M_C@2``.
    rng : numpy.random.Generator
    experiment : Experiment
        Sets the size of torque, speed, distance and inertia.
    ranges : DriveRanges

    Returns
    -------
    dict of str to float
        SI, in the order of `names`.

    Raises
    ------
    KeyError
        For a parameter that is not of the function set.
    """
    names = list(names)
    torque = float(np.max(np.abs(experiment.torque())))
    masses = sum(name in ("J1", "J2", "J3", "J4") for name in names)
    drawn = _mass_chain(masses, experiment.inertia, rng, ranges)

    def those(*symbols: str) -> list[str]:
        return [name for symbol in symbols for name in names if name.partition("@")[0] == symbol]

    friction = {name: _log_uniform(rng, ranges.friction) for name in those("M_C", "f_v", "M_S")}
    scale = torque * min(1.0, ranges.max_total_friction / max(sum(friction.values()), 1e-9))
    drawn |= {name: share * scale for name, share in friction.items()}
    for name in those("f_v"):
        drawn[name] /= experiment.speed
    for name in those("omega_S"):
        drawn[name] = _log_uniform(rng, ranges.stribeck_speed) * experiment.speed
    for name in those("M_G"):
        drawn[name] = float(rng.choice([-1.0, 1.0])) * _log_uniform(rng, ranges.gravity) * torque
    for name in those("alpha"):
        large = 0.5 * _log_uniform(rng, ranges.large_gap) * experiment.distance
        drawn[name] = large if rng.random() < 0.5 else _log_uniform(rng, ranges.small_gap)
    if "T_1" in names:
        drawn["T_1"] = _log_uniform(rng, ranges.current_loop)
    if "T_d" in names:
        drawn["T_d"] = _log_uniform(rng, ranges.dead_time)
    for name in those("f_d"):  # friction takes energy both ways
        drawn[name] = drawn[f"f_v{name[3:]}"] * float(rng.choice([-1.0, 1.0])) * _log_uniform(rng, ranges.asymmetry)
    for name in those("c_cubic"):
        drawn[name] = _log_uniform(rng, ranges.hardening) * drawn[f"c{name.partition('@')[2] or 1}"] ** 3 / torque**2
    for name in those("c_g"):
        drawn[name] = _log_uniform(rng, ranges.ground_spring) * torque / experiment.distance
    for name in those("G"):
        drawn[name] = _log_uniform(rng, ranges.pendulum) * torque
    for name in those("k"):
        drawn[name] = _log_uniform(rng, ranges.turns) * 2.0 * np.pi / experiment.distance
    for name in those("phi_0"):
        drawn[name] = rng.uniform(-np.pi, np.pi)
    return {name: float(drawn[name]) for name in names}


def modes(J: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Return the resonances of a chain of masses in Hz and their damping ratios, NaN if overdamped.

    `J` are moments of inertia, shape (masses,); `c` and `d` are spring and damper constants. Those and the results
    have the shape (masses - 1,).
    """
    n = len(J)
    between = np.eye(n)[:-1] - np.eye(n)[1:]  # twists of the shafts
    A = np.zeros((2 * n - 1, 2 * n - 1))  # states: twists, speeds
    A[: n - 1, n - 1 :] = between
    A[n - 1 :, : n - 1] = -between.T * c / J[:, None]
    A[n - 1 :, n - 1 :] = -(between.T * d) @ between / J[:, None]
    poles = np.linalg.eigvals(A)
    oscillatory = poles[poles.imag > 0.0]
    oscillatory = oscillatory[np.argsort(np.abs(oscillatory))]
    frequency, ratio = np.full((2, n - 1), np.nan)
    frequency[: len(oscillatory)] = np.abs(oscillatory) / (2.0 * np.pi)
    ratio[: len(oscillatory)] = -oscillatory.real / np.abs(oscillatory)
    return frequency, ratio


def _log_uniform(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """Draw uniformly in the logarithm."""
    return float(np.exp(rng.uniform(*np.log(limits))))


def _mass_chain(masses: int, inertia: float, rng: np.random.Generator, ranges: DriveRanges) -> dict[str, float]:
    """Draw inertias, springs and dampers until all resonances and damping ratios are in range."""
    low, high = np.array([ranges.resonance, ranges.damping_ratio]).T
    for _ in range(ranges.max_tries):
        J = np.array([_log_uniform(rng, (1.0, ranges.inertia_ratio)) for _ in range(masses)])
        J *= inertia * _log_uniform(rng, ranges.total_inertia) / np.sum(J)
        near = np.cumsum(J)[:-1]
        lightness = 1.0 / near + 1.0 / (np.sum(J) - near)
        omega = np.array([2.0 * np.pi * _log_uniform(rng, ranges.resonance) for _ in near])
        c = omega**2 / lightness
        d = 2.0 * np.array([_log_uniform(rng, ranges.damping_ratio) for _ in near]) * c / omega
        found = np.array(modes(J, c, d)).T
        if np.all((found >= low) & (found <= high)):
            break
    else:
        raise RuntimeError(f"no chain of masses within the ranges was found in {ranges.max_tries} draws")
    drawn = {f"J{i + 1}": float(J[i]) for i in range(masses)}
    drawn |= {f"c{k + 1}": float(c[k]) for k in range(masses - 1)}
    return drawn | {f"d{k + 1}": float(d[k]) for k in range(masses - 1)}
