"""Random drives in plausible ranges, for benchmarks and tests.

Takes names of parameters, not structures: excitation stands below the effects.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from brightgrey.arrays import Array
from brightgrey.excitation.experiment import PAPER_EXPERIMENT, Experiment

__all__ = ["modes", "random_values"]


INERTIA = (0.7, 1.4)  # total, of the experiment's
INERTIA_RATIO = 100.0
RESONANCE = (5.0, 200.0)  # Hz, all of them
DAMPING = (0.01, 0.3)  # damping ratio of every resonance
FRICTION = (0.01, 0.5)  # of the peak torque, each kind
FRICTION_IN_ALL = 0.6  # what would leave too little torque to move with is scaled down to this
GRAVITY = (0.01, 0.2)  # of the peak torque, either sign
STRIBECK_SPEED = (0.02, 0.3)  # of the peak speed
SMALL_GAP = (1e-4, 1e-2)  # alpha in rad
LARGE_GAP = (0.005, 0.2)  # 2 alpha as part of the way
CURRENT_LOOP = (2e-4, 2e-2)  # s
DEAD_TIME = (1e-4, 2e-2)  # s
_TRIES = 100_000


def random_values(
    names: Iterable[str], rng: np.random.Generator, experiment: Experiment = PAPER_EXPERIMENT
) -> dict[str, float]:
    """Draw a value for every parameter named, sized to the torque and speed of `experiment`.

    All draws are uniform in the logarithm, within the ranges at the top of this file. Every resonance of the
    ladder lies in ``RESONANCE`` with a damping ratio in ``DAMPING``: draws that break this are thrown away. A
    gap is small or large with even odds.

    Parameters
    ----------
    names : iterable of str
        Parameters of a structure of the paper's grammar (``Structure.parameters``).
    rng : numpy.random.Generator
    experiment : Experiment
        Gives the size of torque, speed, way and inertia.

    Returns
    -------
    dict of str to float
        SI, in the order of `names`.

    Raises
    ------
    KeyError
        For a parameter that is not of the paper's function set.
    """
    names = list(names)
    torque = float(np.max(np.abs(experiment.torque())))
    masses = sum(name in ("J1", "J2", "J3", "J4") for name in names)
    drawn = _ladder(masses, experiment.inertia, rng)
    friction = {name: _log(rng, *FRICTION) for name in ("M_C", "f_v", "M_S") if name in names}
    scale = torque * min(1.0, FRICTION_IN_ALL / max(sum(friction.values()), 1e-9))
    drawn |= {name: share * scale for name, share in friction.items()}
    if "f_v" in drawn:
        drawn["f_v"] /= experiment.speed
    if "omega_S" in names:
        drawn["omega_S"] = _log(rng, *STRIBECK_SPEED) * experiment.speed
    if "M_G" in names:
        drawn["M_G"] = float(rng.choice([-1.0, 1.0])) * _log(rng, *GRAVITY) * torque
    if "alpha" in names:
        large = 0.5 * _log(rng, *LARGE_GAP) * experiment.distance
        drawn["alpha"] = large if rng.random() < 0.5 else _log(rng, *SMALL_GAP)
    if "T_1" in names:
        drawn["T_1"] = _log(rng, *CURRENT_LOOP)
    if "T_d" in names:
        drawn["T_d"] = _log(rng, *DEAD_TIME)
    return {name: drawn[name] for name in names}


def modes(J: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Resonances of a ladder in Hz and their damping ratios, both shape (masses - 1,); NaN if overdamped.

    `J` are moments of inertia, shape (masses,), `c` and `d` spring and damper constants, shape (masses - 1,).
    """
    n = len(J)
    between = np.eye(n)[:-1] - np.eye(n)[1:]  # twists of the shafts
    A = np.zeros((2 * n - 1, 2 * n - 1))  # states: twists, speeds
    A[: n - 1, n - 1 :] = between
    A[n - 1 :, : n - 1] = -between.T * c / J[:, None]
    A[n - 1 :, n - 1 :] = -(between.T * d) @ between / J[:, None]
    poles = np.linalg.eigvals(A)
    swinging = poles[poles.imag > 0.0]
    swinging = swinging[np.argsort(np.abs(swinging))]
    frequency, ratio = np.full((2, n - 1), np.nan)
    frequency[: len(swinging)] = np.abs(swinging) / (2.0 * np.pi)
    ratio[: len(swinging)] = -swinging.real / np.abs(swinging)
    return frequency, ratio


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw uniformly in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _ladder(masses: int, inertia: float, rng: np.random.Generator) -> dict[str, float]:
    """Inertias, springs and dampers whose resonances are all in range."""
    for _ in range(_TRIES):
        J = np.array([_log(rng, 1.0, INERTIA_RATIO) for _ in range(masses)])
        J *= inertia * _log(rng, *INERTIA) / np.sum(J)
        near = np.cumsum(J)[:-1]
        lightness = 1.0 / near + 1.0 / (np.sum(J) - near)
        turning = np.array([2.0 * np.pi * _log(rng, *RESONANCE) for _ in near])
        c = turning**2 / lightness
        d = 2.0 * np.array([_log(rng, *DAMPING) for _ in near]) * c / turning
        frequency, ratio = modes(J, c, d)
        if np.all((frequency >= RESONANCE[0]) & (frequency <= RESONANCE[1])) and np.all(
            (ratio >= DAMPING[0]) & (ratio <= DAMPING[1])
        ):
            break
    else:
        raise RuntimeError("no ladder found within the ranges")
    drawn = {f"J{i + 1}": float(J[i]) for i in range(masses)}
    drawn |= {f"c{k + 1}": float(c[k]) for k in range(masses - 1)}
    return drawn | {f"d{k + 1}": float(d[k]) for k in range(masses - 1)}
