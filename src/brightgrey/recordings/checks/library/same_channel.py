"""Input and output that are one channel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.recordings.checks.check import Check, CheckResult, passed, stop
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    same: float = 1e-6
    """Difference of two channels, as a part of their variance, that rounding explains."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Correlate every pair of channels."""
    r = examined.recording
    signals, channels = (r.input, *r.outputs), (r.u, *r.y)
    moving = [k for k, values in enumerate(channels) if not is_constant(values)]
    found = False
    for n, i in enumerate(moving):
        for j in moving[n + 1 :]:
            unexplained = 1.0 - float(np.corrcoef(channels[i], channels[j])[0, 1]) ** 2
            if unexplained < POLICY.same:
                found = True
                yield stop(
                    f"'{signals[i].name}' and '{signals[j].name}' differ by a factor only",
                    f"'{signals[i].name}' and '{signals[j].name}' are one channel: name another one",
                    f"{POLICY.same:g} of the variance",
                )
    if not found and len(moving) > 1:
        yield passed("no two channels are equal")


CHECK = Check("same channel", "Are input and outputs different channels?", run)
