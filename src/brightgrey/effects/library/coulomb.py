"""Coulomb friction: constant against the direction of motion."""

from __future__ import annotations

from typing import Any

from brightgrey.effects.declaration import (
    Dimension,
    Draft,
    Effect,
    Fault,
    Parameter,
    Values,
    force_on_mass,
    friction_law,
)


def amplitude(v: Any, p: tuple[Any, ...]) -> tuple[Any, Any]:
    """Torque against the motion and its slope over speed."""
    return p[0] + 0.0 * v, 0.0 * v


def gradient(v: Any, p: tuple[Any, ...]) -> tuple[Any, ...]:
    """Derivative of the amplitude by M_C."""
    return (1.0,)


LAW = friction_law(("M_C",), amplitude, gradient)


def stamp(draft: Draft, place: int, values: Values) -> Draft:
    """Torque on the mass at `place`, from its speed (eq. 11)."""
    speed = draft.unit_row(f"v{place}")
    return draft.with_element(f"coulomb@{place}", LAW, (speed,), draft.B[:, place - 1], values)


EFFECT = Effect(
    name="coulomb",
    number=5,
    title="Coulomb friction",
    about="Friction of constant size against the motion; f_tanh, fixed upfront, smooths the reversal.",
    equation="M_F = -M_C tanh(f_tanh v)",
    source="paper eq. (2), (11)",
    stage="friction",
    where="mass",
    parameters=(
        Parameter(
            "M_C",
            Dimension(input=1, motion=0, time=0),
            "Coulomb friction torque (force, in a linear axis)",
            bounds=lambda s: (1e-4 * s.torque, 2.0 * s.torque),
            start=lambda s: max(s.friction, 1e-2 * s.torque),
            size=True,
            fault=Fault("friction"),
        ),
    ),
    noticeable=lambda s, values: {"M_C": 0.01 * s.torque},
    stamp=stamp,
    law=LAW,
    follows="the sign of speed",
    modelica=force_on_mass(),
)
