"""Dead time between the command and its effect."""

from __future__ import annotations

from dataclasses import replace

from brightgrey.effects import TIME, Draft, Effect, Modelica, Parameter, SearchHints, Values, block


def shift_input(draft: Draft, place: int, values: Values) -> Draft:
    """Shift the input (eq. 6): u(t - T_d), and u = u[0] before the recording begins."""
    return replace(draft, dead_time=draft.dead_time + values["T_d"])


EFFECT = Effect(
    name="delay",
    number=11,
    title="Dead time",
    words="dead time",
    about=(
        "Bus cycles and filters between command and torque. Half a sample of it may come from how the data was taken."
    ),
    matters="the loop is fast: dead time limits every controller",
    confused_with=(
        "the lag of current control; a signal that is held from sample to sample, or a differenced speed, by half "
        "a sample"
    ),
    equation="G(s) = exp(-T_d s)",
    source="paper eq. (6)",
    stage="delay",
    where="drive",
    parameters=(
        Parameter(
            "T_d",
            TIME,
            "dead time of the input",
            bounds=lambda s: (0.0, 0.1 * s.duration),
            start=lambda s: s.interval,
            scale="linear",
            lag=True,
            size=True,
        ),
    ),
    stamp=shift_input,
    # At a tenth of the sampling rate this lags by 7 degrees.
    relevant_size=lambda s, values, place: {"T_d": 0.2 * s.interval},
    # From a tenth of a sample to fifty samples.
    search=SearchHints(sample=lambda s, share: 0.1 * s.interval * 500.0**share),
    symbols=(block((0.0, 0.0), (0.55, 0.0), (0.55, 1.0), (1.0, 1.0)),),
    modelica=Modelica(block=("Modelica.Blocks.Nonlinear.FixedDelay", "delayTime = $T_d")),
)
