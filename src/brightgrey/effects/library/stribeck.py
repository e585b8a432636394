"""Stribeck friction: more friction near standstill, fading as the lubricant film builds up."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import (
    SPEED,
    TORQUE,
    Caution,
    Effect,
    Fault,
    Parameter,
    force_on_mass,
    friction_law,
    friction_stamp,
    friction_symbol,
)
from brightgrey.effects.arithmetic import exp, magnitude, sign


def stribeck_torque(v: Any, p: tuple[Any, ...]) -> tuple[Any, Any]:
    """Torque against the motion, M_S exp(-|v|/omega_S), and its slope over speed.

    |v| makes the law odd: without it, (2) grows without limit for v < 0.
    """
    M_S, omega_S = p
    rate = 1.0 / omega_S
    a = M_S * exp(-magnitude(v) * rate)
    return a, -a * sign(v) * rate


STRIBECK_LAW = friction_law(("M_S", "omega_S"), stribeck_torque)

EFFECT = Effect(
    name="stribeck",
    number=7,
    title="Stribeck friction",
    words="Stribeck friction",
    about=(
        "Friction in excess of Coulomb's that fades with speed. Above max|v|/3 its speed omega_S makes it "
        "Coulomb plus negative viscous friction, below about 5/f_tanh it is invisible."
    ),
    matters="motion is slow: friction that falls with speed makes stick-slip, which no slow controller ends",
    confused_with=(
        "Coulomb friction with less viscous friction, where omega_S is large; a wide reversal of friction, where "
        "it is small"
    ),
    equation="M_F = -M_S tanh(f_tanh v) exp(-|v|/omega_S)",
    source="paper eq. (2), (11), with |v|",
    stage="friction",
    where="mass",
    parameters=(
        Parameter(
            "M_S",
            TORQUE,
            "Stribeck friction torque (or force) at standstill in excess of Coulomb's",
            bounds=lambda s: (1e-4 * s.torque, 2.0 * s.torque),
            start=lambda s: 0.3 * max(s.friction, 3e-2 * s.torque),
            size=True,
            fault=Fault("friction"),
        ),
        Parameter(
            "omega_S",
            SPEED,
            "speed at which Stribeck friction has faded to 1/e",
            bounds=lambda s: (1e-3 * s.speed, s.speed),
            start=lambda s: 0.1 * s.speed,
        ),
    ),
    law=STRIBECK_LAW,
    stamp=friction_stamp(STRIBECK_LAW),
    relevant_size=lambda s, values, place: {"M_S": 0.01 * s.torque, "omega_S": 0.05 * s.speed},
    residual_signature="the sign of speed near standstill",
    cautions=(
        Caution(
            "confounded",
            ("omega_S",),
            lambda c: c.values["omega_S"] > c.scales.speed / 3.0,
            "above a third of the largest speed this is like Coulomb friction with less viscous friction",
        ),
        Caution(
            "not observable",
            ("M_S", "omega_S"),
            lambda c: c.values["omega_S"] < 5.0 / c.f_tanh,
            "below 5/f_tanh the rise of friction towards standstill is lost in the smoothed sign of speed",
        ),
        Caution(
            "confounded",
            ("M_S",),
            lambda c: all(law.affine for law in c.beside),
            "without Coulomb friction beside it, Stribeck friction fits nearly as well as Coulomb friction would",
        ),
    ),
    symbols=(
        friction_symbol(
            (-1.0, -0.4),
            (-0.7, -0.43),
            (-0.45, -0.52),
            (-0.2, -0.72),
            (0.0, -1.0),
            (0.0, 1.0),
            (0.2, 0.72),
            (0.45, 0.52),
            (0.7, 0.43),
            (1.0, 0.4),
        ),
    ),
    modelica=force_on_mass(),
)
