"""Input and outputs that are one channel, at one time or recorded twice at different times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, passed, stop
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    same: float = 1e-6
    """Difference of two channels, as a part of their variance, that rounding explains."""
    rounds: int = 5
    """Steps to the delay between two channels: their slopes are taken as straight."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Correlate every pair of channels, and pairs of outputs of one kind at the best delay, too."""
    r = examined.recording
    signals, channels = (r.input, *r.outputs), (r.u, *r.y)
    moving = [k for k, values in enumerate(channels) if not is_constant(values)]
    found = False
    for n, i in enumerate(moving):
        for j in moving[n + 1 :]:
            both = f"'{signals[i].name}' and '{signals[j].name}'"
            delay = 0.0
            if not _are_one(channels[i], channels[j]) and i and signals[i].kind == signals[j].kind:
                delay = _delay_between(channels[i], channels[j])
            if not _are_one(*_without_delay(channels[i], channels[j], delay)):
                continue
            found = True
            yield _stop_at_pair(both, abs(delay) * r.dt)
    if not found and len(moving) > 1:
        yield passed("no two channels are equal")


def _stop_at_pair(both: str, delay: float) -> CheckResult:
    """Refuse two channels that say the same, the second so many seconds apart from the first."""
    threshold = f"{POLICY.same:g} of the variance"
    if not delay:
        return stop(f"{both} differ by a factor only", f"{both} are one channel: name another one", threshold)
    apart = f"{1e3 * delay:.3g} ms"
    return stop(
        f"{both} differ by a factor and {apart} only",
        f"{both} say the same, {apart} apart: the second shows no elasticity or gap of its own, so name only one",
        threshold,
    )


def _are_one(x: Array, y: Array) -> bool:
    """True if two channels differ by a factor and a constant only."""
    return 1.0 - float(np.corrcoef(x, y)[0, 1]) ** 2 < POLICY.same


def _delay_between(x: Array, y: Array) -> float:
    """Delay of `y` against `x` in samples, at most a hundredth of the recording; by Gauss-Newton steps."""
    most, delay = x.size / 100.0, 0.0
    for _ in range(POLICY.rounds):
        early, late = _without_delay(x, y, delay)
        terms = np.column_stack([late, np.gradient(late), np.ones(late.size)])
        a, b, _constant = np.linalg.lstsq(terms, early, rcond=None)[0].tolist()
        delay = float(np.clip(delay + b / (a or 1e-300), -most, most))
    return delay


def _without_delay(x: Array, y: Array, delay: float) -> tuple[Array, Array]:
    """Both channels, the second of them earlier by a delay in samples, where both are known."""
    if not delay:
        return x, y
    at = np.arange(x.size) + delay
    known = (at >= 0.0) & (at <= x.size - 1.0)
    return x[known], np.interp(at[known], np.arange(x.size), y)


CHECK = Check("same channel", "Are input and outputs different channels, and not one at two times?", run)
