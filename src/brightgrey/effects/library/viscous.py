"""Viscous friction, proportional to speed."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import DAMPING, Effect, Fault, Law, Modelica, Parameter, friction_stamp, friction_symbol


def viscous_torque(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque -f_v v on the mass, and its slope over speed."""
    return -p[0] * z[0], (-p[0],)


VISCOUS_LAW = Law(("f_v",), viscous_torque, affine=True, odd=True, dissipative=True)

EFFECT = Effect(
    name="viscous",
    number=6,
    title="Viscous friction",
    words="viscous friction",
    about="Friction that grows with speed: lubricant, eddy currents, back-EMF of a voltage-driven motor.",
    matters="motion is fast: it takes a large part of the torque, and it damps",
    confused_with=(
        "back-EMF of a motor that is driven by voltage; Stribeck friction of a large omega_S with the opposite sign"
    ),
    equation="M_F = -f_v v",
    source="paper eq. (2), (11)",
    stage="friction",
    where="mass",
    parameters=(
        Parameter(
            "f_v",
            DAMPING,
            "viscous friction coefficient",
            bounds=lambda s: (1e-5 * s.torque / s.speed, 5.0 * s.torque / s.speed),
            start=lambda s: max(s.viscous, 1e-3 * s.torque / s.speed),
            size=True,
            fault=Fault("friction"),
        ),
    ),
    law=VISCOUS_LAW,
    stamp=friction_stamp(VISCOUS_LAW),
    relevant_size=lambda s, values, place: {"f_v": 0.01 * s.torque / s.speed},
    residual_signature="speed",
    symbols=(friction_symbol((-1.0, -0.9), (1.0, 0.9)),),
    modelica=Modelica(
        components=(
            ("$library.Components.Damper", "$name", "d = $f_v"),
            ("$library.Components.Fixed", "${name}_fixed", ""),
        ),
        equations=(
            "connect($name.flange_a, mass$place.flange_b)",
            "connect($name.flange_b, ${name}_fixed.flange)",
        ),
    ),
)
