"""Load that depends on the position: gravity on an arm or an eccentric load, cogging."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import (
    ANGLE,
    PER_POSITION,
    TORQUE,
    Caution,
    Effect,
    Law,
    LimitingCase,
    Parameter,
    Scales,
    SearchHints,
    Symbol,
    force_on_mass,
    position_stamp,
)
from brightgrey.effects.arithmetic import cos, sin


def pendulum_torque(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque -G sin(k q + phi_0) on the mass, and its slope over position."""
    G, k, phi_0 = p
    angle = k * z[0] + phi_0
    return -G * sin(angle), (-G * k * cos(angle),)


PENDULUM_LAW = Law(("G", "k", "phi_0"), pendulum_torque)


def sample_pendulums(scales: Scales, share: Array) -> Array:
    """Draw plausible pendulums: from a twentieth of a turn to five turns over the travel, in any pose."""
    G = scales.torque * 1e-2 * 200.0 ** share[0]
    k = 0.1 * np.pi / scales.travel * 100.0 ** share[1]
    return np.stack([G, k, np.pi * (2.0 * share[2] - 1.0)])


def largest_wave_number(scales: Scales) -> float:
    """Four samples per period at the largest speed, and at most 500 periods over the travel; never below ten periods.

    An eccentric load that turns on and on has many periods over its travel, and so has the cogging of a linear motor.
    """
    sampled = 0.5 * np.pi / (scales.speed * scales.interval)
    return float(np.clip(sampled, 20.0 * np.pi / scales.travel, 1000.0 * np.pi / scales.travel))


EFFECT = Effect(
    name="pendulum",
    number=14,
    title="Position-dependent load",
    words="a position-dependent load",
    about=(
        "Gravity on an arm or an eccentric load, or another load that is a sine of the position, like the cogging of "
        "a motor or the ripple of a screw. The factor k turns the position into the angle of the arm in rad. Where the "
        "position is that angle, k is 1 in rad, 0.01745 in degrees and 6.283 in turns. The load repeats every 2 π / k. "
        "On a short way it is a constant torque and a spring."
    ),
    in_linear_axis=(
        "A linear axis has no arm whose gravity this could be. The term stands for a force that varies along the "
        "axis. Look at its guide, cables, belt or magnets. Do not use it beyond the positions of the recording."
    ),
    matters=(
        "an arm or an eccentric load turns by more than a small angle: the torque at rest depends on the pose; or a "
        "torque repeats with the position, up to 500 times over the travel"
    ),
    confused_with=(
        "a constant load with a spring to the ground, over less than a quarter of a turn; the same load at another "
        "mass, where the shaft between them is stiff; other axes that move along"
    ),
    equation="M = -G sin(k q + phi_0)",
    source="Wiebe et al. 2022, doi:10.21105/joss.03884 (torque-limited simple pendulum)",
    stage="gravity",
    where="mass",
    limiting_cases=(
        LimitingCase("gravity", lambda p: {"M_G": -p["G"] * math.sin(p["phi_0"])}, contained=True),
        LimitingCase("ground_spring", lambda p: {"c_g": p["G"] * p["k"] * math.cos(p["phi_0"])}),
    ),
    parameters=(
        Parameter(
            "G",
            TORQUE,
            "largest torque (or force); of an arm, mass times lever times 9.81 m/s²",
            bounds=lambda s: (1e-4 * s.torque, 20.0 * s.torque),
            start=lambda s: 0.1 * s.torque,
            size=True,
        ),
        Parameter(
            "k",
            PER_POSITION,
            "angle of the arm over the position",
            bounds=lambda s: (1e-2 * np.pi / s.travel, largest_wave_number(s)),
            start=lambda s: np.pi / s.travel,
        ),
        Parameter(
            "phi_0",
            ANGLE,
            "angle of the arm from hanging down, at position 0, in rad",
            bounds=lambda s: (-2.0 * np.pi, 2.0 * np.pi),
            start=lambda s: 0.0,
            scale="linear",
            period=2.0 * np.pi,
        ),
    ),
    law=PENDULUM_LAW,
    stamp=position_stamp(PENDULUM_LAW),
    relevant_size=lambda s, values, place: {"G": 0.02 * s.torque, "k": np.pi / s.travel, "phi_0": 0.0},
    residual_signature="the sine of the position",
    cautions=(
        Caution(
            "confounded",
            ("G", "k", "phi_0"),
            lambda c: c.values["k"] * c.scales.travel < 0.5 * np.pi,
            "over less than a quarter of a turn this is like a constant torque and a spring to the ground",
        ),
    ),
    search=SearchHints(sample=sample_pendulums, wave=("k", "phi_0")),
    symbols=(
        Symbol(
            "load",
            34.0,
            34.0,
            (((2.0, 2.0), (16.0, 2.0)), ((9.0, 2.0), (24.0, 22.0)), ((9.0, 6.0), (9.0, 28.0))),
            circles=((27.0, 26.0, 6.0),),
        ),
    ),
    modelica=force_on_mass("position"),
)
