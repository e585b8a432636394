"""Coulomb friction: constant against the direction of motion."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import (
    TORQUE,
    Effect,
    Fault,
    Parameter,
    force_on_mass,
    friction_law,
    friction_stamp,
    friction_symbol,
)


def coulomb_torque(v: Any, p: tuple[Any, ...]) -> tuple[Any, Any]:
    """Torque against the motion, M_C at any speed, and its slope over speed."""
    return p[0] + 0.0 * v, 0.0 * v


COULOMB_LAW = friction_law(("M_C",), coulomb_torque)

EFFECT = Effect(
    name="coulomb",
    number=5,
    title="Coulomb friction",
    words="Coulomb friction",
    about="Friction of constant size against the motion. It reverses within a speed of 1/f_tanh.",
    matters="the motion is slow, reverses, or has to stop exactly: the drive sticks, and position control hunts",
    confused_with="a constant load, where the speed never reverses; Stribeck friction of a large omega_S",
    equation="M_F = -M_C tanh(f_tanh v)",
    source="paper eq. (2), (11)",
    stage="friction",
    where="mass",
    parameters=(
        Parameter(
            "M_C",
            TORQUE,
            "Coulomb friction torque (or force)",
            bounds=lambda s: (1e-4 * s.torque, 2.0 * s.torque),
            start=lambda s: max(s.friction, 1e-2 * s.torque),
            size=True,
            fault=Fault("friction"),
        ),
    ),
    law=COULOMB_LAW,
    stamp=friction_stamp(COULOMB_LAW),
    relevant_size=lambda s, values, place: {"M_C": 0.01 * s.torque},
    residual_signature="the sign of speed",
    symbols=(friction_symbol((-1.0, -0.8), (0.0, -0.8), (0.0, 0.8), (1.0, 0.8)),),
    modelica=force_on_mass(),
)
