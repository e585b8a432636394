"""Gravity: a constant torque."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import TORQUE, Caution, Draft, Effect, Law, Modelica, Parameter, Symbol, Values


def constant_torque(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque M_G on the mass; it depends on no port."""
    return p[0], ()


GRAVITY_LAW = Law(("M_G",), constant_torque, ports=0, affine=True)


def add_gravity(draft: Draft, place: int, values: Values) -> Draft:
    """Add the torque to the mass at `place`."""
    return draft.with_element(GRAVITY_LAW, (), draft.B[:, place - 1], values)


EFFECT = Effect(
    name="gravity",
    number=8,
    title="Constant load",
    words="a constant load",
    about="A constant torque added to a mass. An offset of the torque sensor looks just the same.",
    matters="a vertical axis, a preload, a balancer: the torque that holds the load at rest",
    confused_with="an offset of the torque signal, always; Coulomb friction, where the speed never reverses",
    equation="M = M_G",
    source="paper section 2.1, 2.2",
    stage="gravity",
    where="mass",
    parameters=(
        Parameter(
            "M_G",
            TORQUE,
            "constant torque (or force) on the mass",
            bounds=lambda s: (-2.0 * s.torque, 2.0 * s.torque),
            # The offset is the part of the input that only holds the load; the load is its opposite.
            start=lambda s: -s.offset,
            scale="linear",
            size=True,
        ),
    ),
    law=GRAVITY_LAW,
    stamp=add_gravity,
    relevant_size=lambda s, values, place: {"M_G": 0.01 * s.torque},
    residual_signature="a constant torque",
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
    symbols=(
        Symbol(
            "load",
            16.0,
            32.0,
            (((0.0, 16.0), (8.0, 16.0)), ((8.0, 0.0), (8.0, 31.0)), ((3.0, 23.0), (8.0, 32.0), (13.0, 23.0))),
        ),
    ),
    modelica=Modelica(
        components=(("$library.Sources.Constant$Force", "$name", "${f}_constant = $M_G"),),
        equations=("connect($name.flange, mass$place.flange_b)",),
    ),
)
