"""Gravity: a constant torque."""

from __future__ import annotations

from typing import Any

from brightgrey.effects.declaration import Caution, Dimension, Draft, Effect, Law, Modelica, Parameter, Values


def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque; there is no port it could depend on."""
    return p[0], ()


def gradient(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, ...]:
    """Derivative by M_G."""
    return (1.0,)


LAW = Law(("M_G",), value, gradient, ports=0, affine=True)


def stamp(draft: Draft, place: int, values: Values) -> Draft:
    """Torque added to the mass at `place`."""
    return draft.with_element(f"gravity@{place}", LAW, (), draft.B[:, place - 1], values)


EFFECT = Effect(
    name="gravity",
    number=8,
    title="Constant torque (gravity or offset)",
    about="A constant torque added to a mass. An offset of the torque sensor looks just the same.",
    equation="M = M_G",
    source="paper section 2.1, 2.2",
    stage="gravity",
    where="mass",
    parameters=(
        Parameter(
            "M_G",
            Dimension(input=1, motion=0, time=0),
            "constant torque (force, in a linear axis) added to the mass",
            bounds=lambda s: (-2.0 * s.torque, 2.0 * s.torque),
            # The offset is the part of the input that only holds the load, so the load is its opposite.
            start=lambda s: -s.offset,
            scale="linear",
            size=True,
        ),
    ),
    noticeable=lambda s, values: {"M_G": 0.01 * s.torque},
    stamp=stamp,
    law=LAW,
    cautions=(
        Caution(
            "confounded",
            ("M_G",),
            lambda _: True,
            "this is constant torque: gravity, or an offset of the input",
        ),
        Caution(
            "confounded",
            ("M_G",),
            lambda c: not c.reverses and any(law.odd and not law.affine for law in c.beside),
            "the speed never reverses, so that friction of constant size looks the same",
        ),
    ),
    follows="a constant torque",
    modelica=Modelica(
        components=(("$library.Sources.Constant$Force", "$name", "${f}_constant = $M_G"),),
        equations=("connect($name.flange, mass$place.flange_b)",),
    ),
)
