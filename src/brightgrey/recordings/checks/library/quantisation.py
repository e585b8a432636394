"""Resolution of the outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import is_constant
from brightgrey.recordings.units.amounts import rounded


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    largest_noise: float = 0.01
    """Noise that rounding may add, as a part of the output's standard deviation."""

    @property
    def least(self) -> float:
        """Standard deviation in steps with that noise, 1 / sqrt(12) of a step."""
        return float(1.0 / (np.sqrt(12.0) * self.largest_noise))


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Compare the standard deviation of every output with its resolution."""
    r = examined.recording
    for signal, values, step in zip(r.outputs, r.y, r.resolution, strict=True):
        if is_constant(values):
            continue
        steps = float(np.std(values)) / float(step)
        shown = f"{float(step) * signal.factor:.4g} {signal.unit}"
        figure = f"'{signal.name}' has steps of {shown}, {rounded(steps, 3)} in its standard deviation"
        threshold = f"{POLICY.least:.0f} steps, whose rounding is {100 * POLICY.largest_noise:g} % of noise"
        if steps < POLICY.least:
            yield mind(
                figure,
                f"'{signal.name}' moves by few steps of its resolution: record a longer travel, or the position of the"
                " encoder instead of its velocity",
                threshold,
            )
        else:
            yield passed(figure, threshold)


CHECK = Check("resolution", "Is the resolution of the outputs fine enough?", run)
