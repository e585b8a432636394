"""Current control: the torque follows its command with a first-order lag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.effects import TIME, TORQUE, Draft, Effect, Modelica, Parameter, SearchHints, State, Values, block


def prepend_lag(draft: Draft, place: int, values: Values) -> Draft:
    """Connect the lag in series from the left (eq. 16): the system's previous input becomes the state T."""
    n = len(draft.states)
    B = draft.B[:, 0]
    draft = draft.with_state(State("T", TORQUE, "input"))
    A = draft.A.copy()
    A[:n, n] = B
    A[n, n] = -1.0 / values["T_1"]
    B_L = np.zeros((n + 1, 1, *draft.batch))
    B_L[n, 0] = 1.0 / values["T_1"]
    return replace(draft, A=A, B=B_L)


EFFECT = Effect(
    name="current_control",
    number=10,
    title="Current control loop",
    words="a current control loop",
    about=(
        "First-order lag between commanded and real torque. "
        "Below one sampling interval it cannot be told from sampling."
    ),
    matters="the speed loop is to be faster than about a tenth of 1/T_1",
    confused_with="dead time: near the sampling interval only the sum of both shows; the lag of a sensor's filter",
    equation="T_1 T' + T = u",
    source="paper eq. (16)",
    stage="current control",
    where="drive",
    parameters=(
        Parameter(
            "T_1",
            TIME,
            "time constant of the current control loop",
            bounds=lambda s: (0.05 * s.interval, 0.1 * s.duration),
            start=lambda s: 2.0 * s.interval,
            lag=True,
            size=True,
        ),
    ),
    stamp=prepend_lag,
    # At a tenth of the sampling rate this lags by 7 degrees.
    relevant_size=lambda s, values, place: {"T_1": 0.2 * s.interval},
    # From a fifth of a sample to fifty samples.
    search=SearchHints(sample=lambda s, share: 0.2 * s.interval * 250.0**share),
    symbols=(block((0.0, 0.0), (0.15, 0.0), (0.25, 0.35), (0.35, 0.58), (0.5, 0.78), (0.7, 0.92), (1.0, 1.0)),),
    modelica=Modelica(
        block=(
            "Modelica.Blocks.Continuous.FirstOrder",
            "T = $T_1, initType = Modelica.Blocks.Types.Init.InitialOutput, y_start = start_T",
        )
    ),
)
