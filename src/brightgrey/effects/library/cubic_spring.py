"""A shaft that becomes stiffer with its twist: couplings with elastomers, belts, harmonic drives."""

from __future__ import annotations

from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Dimension, Draft, Effect, Law, Modelica, Parameter, Scales, SearchHints, Symbol, Values

HARDENING = Dimension(input=1, motion=-3, time=0)


def cubic_torque(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Torque -c_cubic phi^3 on the mass before the shaft, and its slope over the twist."""
    steep = -p[0] * z[0] * z[0]
    return steep * z[0], (3.0 * steep,)


CUBIC_LAW = Law(("c_cubic",), cubic_torque, odd=True)


def add_cubic_spring(draft: Draft, place: int, values: Values) -> Draft:
    """Add the torque to the masses on both sides of the shaft at `place`; it reads the twist of the shaft."""
    twist = draft.unit_row(f"q{place}") - draft.unit_row(f"q{place + 1}")
    return draft.with_element(CUBIC_LAW, (twist,), draft.B[:, place - 1] - draft.B[:, place], values)


def gentlest(scales: Scales) -> float:
    """Least c_cubic: a shaft that twists by the whole travel carries a thousandth of the torque by it."""
    return 1e-3 * scales.torque / scales.travel**3


def steepest(scales: Scales) -> float:
    """Largest c_cubic: under full torque, the inertia swings on it at Nyquist's frequency."""
    stiffness = scales.inertia * (np.pi / scales.interval) ** 2
    return max(float((stiffness / 3.0) ** 3 / scales.torque**2), 1e6 * gentlest(scales))


def sample_cubic_springs(scales: Scales, share: Array) -> Array:
    """Draw shafts that carry the full torque at a twist between 1e-4 of the travel and the whole of it."""
    twist = 1e-4 * scales.travel * 1e4**share
    return np.clip(scales.torque / twist**3, gentlest(scales), steepest(scales))


def relevant_hardening(scales: Scales, values: Values, place: int) -> dict[str, float]:
    """Hardening by which the stiffness of the shaft grows by a tenth from no torque to the full one."""
    return {"c_cubic": values[f"c{place}"] ** 3 / (30.0 * scales.torque**2)}


# The standard library's springs are linear.
HARDENING_SHAFT = """model HardeningShaft "Spring that becomes stiffer with its twist, and damper"
  extends $library.Interfaces.PartialCompliantWithRelativeStates;
  parameter Real c "Spring constant at small twist";
  parameter Real d "Damper constant";
  parameter Real hardening "Torque over the third power of the twist";
equation
  $f = (c + hardening * ${q}_rel * ${q}_rel) * ${q}_rel + d * ${v}_rel;
end HardeningShaft;
"""

EFFECT = Effect(
    name="cubic_spring",
    number=15,
    title="Hardening spring",
    words="a hardening spring",
    about=(
        "A shaft that becomes stiffer with its twist: elastomer coupling, belt, harmonic drive. It adds to the spring "
        "constant of the shaft. A shaft with a gap has none."
    ),
    matters=(
        "torque changes by much: the resonance rises with its amplitude, so that one filter does not fit all loads"
    ),
    confused_with="backlash, which is soft at small torque too; a linear shaft, where the twist stays small",
    equation="M = c phi + c_cubic phi^3, phi = q_i - q_j",
    source="Duffing's spring; Kovacic, Brennan 2011, doi:10.1002/9780470977859",
    stage="gravity",
    where="shaft",
    parameters=(
        Parameter(
            "c_cubic",
            HARDENING,
            "torque over the third power of the twist",
            bounds=lambda s: (gentlest(s), steepest(s)),
            start=lambda s: 1e3 * s.torque / s.travel**3,
            size=True,
        ),
    ),
    law=CUBIC_LAW,
    stamp=add_cubic_spring,
    excludes=("backlash",),
    relevant_size=relevant_hardening,
    search=SearchHints(sample=sample_cubic_springs),
    symbols=(
        Symbol(  # torque over twist in a box
            "series",
            36.0,
            28.0,
            (
                ((0.0, 14.0), (4.0, 14.0)),
                ((4.0, 0.0), (32.0, 0.0), (32.0, 28.0), (4.0, 28.0), (4.0, 0.0)),
                tuple((18.0 + 11.0 * x, 14.0 - 11.0 * (0.2 * x + 0.8 * x**3)) for x in np.linspace(-1.0, 1.0, 9)),
                ((32.0, 14.0), (36.0, 14.0)),
            ),
        ),
    ),
    modelica=Modelica(instead=("shaft$place", "HardeningShaft", "hardening = $c_cubic"), model=HARDENING_SHAFT),
)
