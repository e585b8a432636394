"""Viscous friction, proportional to speed."""

from __future__ import annotations

from typing import Any

from brightgrey.effects.declaration import Dimension, Draft, Effect, Fault, Law, Modelica, Parameter, Values


def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque and its slope over speed."""
    return -p[0] * z[0], (-p[0],)


def gradient(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, ...]:
    """Derivative by f_v."""
    return (-z[0],)


LAW = Law(("f_v",), value, gradient, affine=True, odd=True, dissipative=True)


def stamp(draft: Draft, place: int, values: Values) -> Draft:
    """Torque on the mass at `place`, from its speed (eq. 11)."""
    speed = draft.unit_row(f"v{place}")
    return draft.with_element(f"viscous@{place}", LAW, (speed,), draft.B[:, place - 1], values)


EFFECT = Effect(
    name="viscous",
    number=6,
    title="Viscous friction",
    about="Friction that grows with speed: lubricant, eddy currents, back-EMF of a voltage-driven motor.",
    equation="M_F = -f_v v",
    source="paper eq. (2), (11)",
    stage="friction",
    where="mass",
    parameters=(
        Parameter(
            "f_v",
            Dimension(input=1, motion=-1, time=1),
            "viscous friction coefficient",
            bounds=lambda s: (1e-5 * s.torque / s.speed, 5.0 * s.torque / s.speed),
            start=lambda s: max(s.viscous, 1e-3 * s.torque / s.speed),
            size=True,
            fault=Fault("friction"),
        ),
    ),
    noticeable=lambda s, values: {"f_v": 0.01 * s.torque / s.speed},
    stamp=stamp,
    law=LAW,
    follows="speed",
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
