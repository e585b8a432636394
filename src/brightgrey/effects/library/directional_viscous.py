"""Viscous friction that differs between the two directions of motion."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import (
    DAMPING,
    Caution,
    Effect,
    Law,
    Parameter,
    force_on_mass,
    friction_stamp,
    friction_symbol,
)
from brightgrey.effects.arithmetic import magnitude, sign


def directional_torque(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque -f_d |v| on the mass, and its slope over speed."""
    return -p[0] * magnitude(z[0]), (-p[0] * sign(z[0]),)


DIRECTIONAL_LAW = Law(("f_d",), directional_torque)

EFFECT = Effect(
    name="directional_viscous",
    number=12,
    title="Direction-dependent viscous friction",
    words="direction-dependent viscous friction",
    about=(
        "Viscous friction of f_v + f_d forward and f_v - f_d backward, as nuts and guides under preload have it. "
        "Below f_v it takes energy in both directions."
    ),
    matters="one feed-forward is to serve both directions: a screw, a pump, a loaded guide",
    confused_with=(
        "a constant load, where the drive moves in one direction only; a sensor whose gain depends on the direction"
    ),
    equation="M_F = -f_d |v|",
    source="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7",
    stage="friction",
    where="mass",
    requires=("viscous",),
    parameters=(
        Parameter(
            "f_d",
            DAMPING,
            "half the difference of viscous friction forward and backward",
            bounds=lambda s: (-2.0 * s.torque / s.speed, 2.0 * s.torque / s.speed),
            start=lambda s: 0.0,
            scale="linear",
            size=True,
        ),
    ),
    law=DIRECTIONAL_LAW,
    stamp=friction_stamp(DIRECTIONAL_LAW),
    relevant_size=lambda s, values, place: {"f_d": 0.01 * s.torque / s.speed},
    residual_signature="the magnitude of speed",
    cautions=(
        Caution(
            "confounded",
            ("f_d",),
            lambda c: abs(c.values["f_d"]) > c.values["f_v"],
            "it exceeds f_v, so that friction would drive the motion in one direction: it stands for another torque",
        ),
    ),
    symbols=(friction_symbol((-1.0, -0.4), (0.0, 0.0), (1.0, 1.0)),),
    modelica=force_on_mass(),
)
