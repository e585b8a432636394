"""Backlash: a gap in series with a shaft's spring and damper (physical backlash model)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from brightgrey.effects import (
    POSITION,
    Draft,
    Effect,
    Fault,
    Law,
    Limits,
    Modelica,
    Parameter,
    Scales,
    SearchHints,
    State,
    Symbol,
    Values,
)
from brightgrey.effects.arithmetic import negative_part, positive_part


def gap_rate(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Rate f_lambda of the position in the gap (eq. 5), and its slopes over free rate and position.

    The free rate z[0] holds between the limits; at a limit its outward part is cut. A gap of width zero (alpha = 0)
    leaves no rate at all.
    """
    rate, position = z
    width = 2.0 * p[0]
    inward = np.where(position >= 0.0, negative_part(rate), rate)
    inward = np.where(position <= -width, positive_part(inward), inward)
    free = np.where(inward == rate, 1.0, 0.0)
    closed = width <= 0.0
    return np.where(closed, 0.0, inward), (np.where(closed, 0.0, free), np.zeros_like(free))


GAP_LAW = Law(("alpha",), gap_rate, ports=2)


def relevant_gap(scales: Scales, values: Values, place: int) -> dict[str, float]:
    """Gap as wide as a tenth of its shaft's twist under full torque, or 2e-5 of the travel.

    Robots and gantries repeat positions to that; on three turns it is 1.3 minutes of arc, the gap of a precision gear.
    """
    return {"alpha": min(0.05 * scales.torque / values[f"c{place}"], 1e-5 * scales.travel)}


def insert_gap(draft: Draft, place: int, values: Values) -> Draft:
    """Put a gap into the shaft between mass `place` and the next, by the five steps of the paper's section 2.2.

    Spring and damper are read from the matrix as built so far (A_red of eq. 13), so that the shaft keeps its constants.
    Entries (4, 2) and (5, 1) hold the spring, (4, 5) and (5, 4) the damper.
    """
    i, j = place, place + 1
    name = f"lambda{place}"
    draft = draft.with_state(State(name, POSITION, "zero"))  # step 1
    q_i, q_j, gap, v_i, v_j = (draft.index(s) for s in (f"q{i}", f"q{j}", name, f"v{i}", f"v{j}"))  # step 2
    A = draft.A.copy()
    A[v_i, gap] += A[v_i, q_j]  # step 3
    A[v_j, gap] -= A[v_j, q_i]
    G = np.zeros((len(draft.states), *draft.batch))  # step 4, eq. (15)
    G[gap] = 1.0
    G[v_i] = A[v_i, v_j]
    G[v_j] = -A[v_j, v_i]
    stiffness_over_damping = A[v_i, q_j] / A[v_i, v_j]
    rate = draft.unit_row(f"v{i}") - draft.unit_row(f"v{j}")
    twist = draft.unit_row(f"q{i}") - draft.unit_row(f"q{j}") - draft.unit_row(name)
    limits = Limits(gap, lower=-2.0 * values["alpha"], upper=0.0 * values["alpha"])
    draft = replace(draft, A=A)
    # Step 5, the new output rows, needs no code: acceleration outputs are rows of x' (see kit.assembly).
    return draft.with_element(
        GAP_LAW,
        (rate + stiffness_over_damping * twist, draft.unit_row(name)),
        G,
        values,
        limits,
    )


# The standard library's ElastoBacklash limits the shaft's torque instead of following its twist in the gap.
DRAWING = """model Gap "Spring and damper in series with a gap"
  extends $library.Interfaces.PartialCompliantWithRelativeStates;
  parameter Real c "Spring constant";
  parameter Real d "Damper constant";
  parameter Real alpha "Half the gap";
  Real lambda(start = 0, fixed = true) "Position in the gap, from -2 alpha to 0";
  Real rate "Of lambda, where it is free";
equation
  rate = -${v}_rel - c / d * (${q}_rel + lambda);
  der(lambda) = if alpha <= 0 then 0
    elseif lambda >= 0 and rate > 0 then 0
    elseif lambda <= -2 * alpha and rate < 0 then 0
    else rate;
  $f = c * (${q}_rel + lambda) + d * (${v}_rel + der(lambda));
end Gap;
"""

EFFECT = Effect(
    name="backlash",
    number=9,
    title="Backlash",
    words="backlash",
    about=(
        "A gap of width 2 alpha in a shaft (gearbox, coupling, rack). The position in the gap, lambda, is 0 when "
        "the shaft can push forward, -2 alpha when it can push backward."
    ),
    matters="the drive reverses under load, or is to hold a position: the load then moves freely within the gap",
    confused_with=(
        "a soft shaft or a hardening spring, where the gap is never crossed; friction at the load, where it "
        "sticks in the gap"
    ),
    equation="M_B = c tau + d tau', tau = q_i - q_j - lambda, lambda' = f_lambda kept in [-2 alpha, 0]",
    source=(
        "paper eq. (3)-(5), (12)-(15); Nordin, Galic, Gutman 1997, "
        "doi:10.1002/(SICI)1099-1115(199702)11:1<49::AID-ACS394>3.0.CO;2-X"
    ),
    stage="backlash",
    where="shaft",
    parameters=(
        Parameter(
            "alpha",
            POSITION,
            "half the gap",
            bounds=lambda s: (1e-6 * s.travel, 0.5 * s.travel),
            start=lambda s: 1e-3 * s.travel,
            size=True,
            half=True,
            fault=Fault("backlash"),
        ),
    ),
    law=GAP_LAW,
    stamp=insert_gap,
    relevant_size=relevant_gap,
    # Gaps of any size are plausible: the scale is logarithmic over four decades.
    search=SearchHints(sample=lambda s, share: 1e-5 * s.travel * 1e4**share),
    symbols=(
        Symbol(  # a tongue that moves between the lips of a fork
            "series",
            36.0,
            24.0,
            (
                ((0.0, 12.0), (7.0, 12.0)),
                ((27.0, 8.0), (27.0, 3.0), (7.0, 3.0), (7.0, 21.0), (27.0, 21.0), (27.0, 16.0)),
                ((17.0, 7.0), (17.0, 17.0)),
                ((17.0, 12.0), (36.0, 12.0)),
            ),
        ),
    ),
    modelica=Modelica(
        instead=("shaft$place", "Gap", "alpha = $alpha, lambda(start = start_lambda$place)"),
        model=DRAWING,
    ),
)
