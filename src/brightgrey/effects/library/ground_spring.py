"""A spring between a mass and the ground: cable chain, balancer, spring-loaded stop."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import STIFFNESS, Caution, Effect, Law, Modelica, Parameter, Symbol, position_stamp


def spring_torque(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque -c_g q on the mass, and its slope over position."""
    return -p[0] * z[0], (-p[0],)


SPRING_LAW = Law(("c_g",), spring_torque, affine=True, odd=True)


EFFECT = Effect(
    name="ground_spring",
    number=13,
    title="Spring to the ground",
    words="a spring to the ground",
    about=(
        "A torque that grows with the distance from position 0: cable chain, balancer, spring. "
        "A preload is the constant torque (gravity) beside it."
    ),
    matters="torque is needed to hold different positions: cable chains, balancers, hoses",
    confused_with=(
        "gravity on an arm over a short way; a constant load, where the travel is small; a spring at another mass, "
        "where the shaft between them is stiff"
    ),
    equation="M = -c_g q",
    source="the spring of paper eq. (1) with one end at rest",
    stage="gravity",
    where="mass",
    parameters=(
        Parameter(
            "c_g",
            STIFFNESS,
            "spring constant between the mass and the ground",
            bounds=lambda s: (1e-4 * s.torque / s.travel, 20.0 * s.torque / s.travel),
            start=lambda s: 1e-2 * s.torque / s.travel,
            size=True,
        ),
    ),
    law=SPRING_LAW,
    stamp=position_stamp(SPRING_LAW),
    relevant_size=lambda s, values, place: {"c_g": 0.01 * s.torque / s.travel},
    residual_signature="the position",
    cautions=(
        Caution(
            "confounded",
            ("c_g",),
            lambda _: True,
            "this is a torque in proportion to the position: a spring, or gravity on an arm over a short way",
        ),
    ),
    symbols=(
        Symbol(
            "ground",
            40.0,
            16.0,
            (
                (
                    (0.0, 8.0),
                    (6.0, 8.0),
                    (8.5, 1.0),
                    (13.5, 15.0),
                    (18.5, 1.0),
                    (23.5, 15.0),
                    (28.5, 1.0),
                    (31.5, 8.0),
                    (40.0, 8.0),
                ),
            ),
        ),
    ),
    modelica=Modelica(
        components=(
            ("$library.Components.Spring", "$name", "c = $c_g, ${q}_rel0 = 0"),
            ("$library.Components.Fixed", "${name}_fixed", ""),
        ),
        equations=(
            "connect(${name}_fixed.flange, $name.flange_a)",
            "connect($name.flange_b, mass$place.flange_b)",
        ),
    ),
)
