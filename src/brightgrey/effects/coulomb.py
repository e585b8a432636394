"""Coulomb friction: constant against the direction of motion."""

from __future__ import annotations

from typing import Any

from brightgrey.effects.arithmetic import tanh
from brightgrey.effects.declaration import Dimension, Draft, Effect, Law, Parameter, Values


def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque and its slope over speed."""
    side = tanh(p[1] * z[0])
    return -p[0] * side, (-p[0] * p[1] * (1.0 - side * side),)


def gradient(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, ...]:
    """Derivatives by M_C and f_tanh."""
    side = tanh(p[1] * z[0])
    return -side, -p[0] * z[0] * (1.0 - side * side)


LAW = Law(("M_C", "f_tanh"), value, gradient, odd=True, dissipative=True)


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
        ),
    ),
    stamp=stamp,
    law=LAW,
)
