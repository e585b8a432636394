"""Velocities that are differences of an encoder's counts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.policy import READING
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    next: float = -0.69
    """Correlation of neighbouring second differences: -2/3 for white noise, -3/4 for its differences."""
    second: float = 0.22
    """The same of those after: 1/6 and 3/10. Second differences are free of the motion."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Correlate the second differences of every velocity that moves in visible steps."""
    r = examined.recording
    for row, signal in enumerate(r.outputs):
        y, step = r.y[row], float(r.resolution[row])
        if signal.kind != "velocity" or is_constant(y) or np.ptp(y) >= READING.coarse_levels * step:
            continue
        noise = np.diff(y, 2)
        power = max(float(noise @ noise), 1e-300)
        one, two = (float(noise[k:] @ noise[:-k]) / power for k in (1, 2))
        figure = f"'{signal.name}' moves in steps of {step * signal.factor:.4g} {signal.unit}, its noise has the"
        figure += f" correlations {one:.2f} and {two:.2f}"
        threshold = f"correlations {POLICY.next:g} and {POLICY.second:g}"
        if one < POLICY.next and two > POLICY.second:
            yield mind(
                figure,
                f"'{signal.name}' was computed from the differences of an encoder: say"
                f" {signal.name}:velocity-differenced",
                threshold,
                output=[f"{signal.name}:{replace(signal, kind='velocity-differenced').sensor}"],
            )
        else:
            yield passed(figure, threshold)


CHECK = Check("differenced velocity", "Was a velocity computed from the differences of an encoder?", run)
