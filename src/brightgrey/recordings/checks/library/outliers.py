"""Single samples far from their neighbours, and jumps of a position."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined, noise_of
from brightgrey.recordings.sample_values import is_constant, noise_of_differences, resolution
from brightgrey.recordings.units.signals import KINDS


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    far: float = 8.0
    """Standard deviations of the noise, and steps of the resolution, at which a sample is an outlier."""
    leap: float = 12.0
    """The same for a jump; steps of coloured noise are larger than those of white noise."""
    near: int = 101
    """Samples around one that tell its noise."""
    soft: float = 3.0
    """The same for neighbours that agree with each other."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Find samples that differ from their neighbours, which agree with each other, and jumps that stay."""
    r = examined.recording
    for signal, values in zip(r.outputs, r.y, strict=True):
        if is_constant(values):
            continue
        size = np.maximum(_local_noise(values), max(noise_of(values), 0.5 * resolution(values)))
        single, jumps = _single(values, size), _jumps(values, size) if KINDS[signal.kind] == 0 else np.empty(0)
        figure = f"{single.size} single samples of '{signal.name}' are far off"
        threshold = f"{POLICY.far:g} standard deviations of the noise"
        if jumps.size:
            leap = float(np.abs(values[jumps.astype(int) + 1] - values[jumps.astype(int)]).max()) * signal.factor
            yield mind(
                f"'{signal.name}' jumps {jumps.size} times by up to {leap:.5g} {signal.unit}",
                f"'{signal.name}' jumps at {r.t[int(jumps[0])]:.6g} s: a counter that wraps around, or samples that are"
                " lost without a gap in the time. Unwrap it, or use the time between two jumps by --window",
                threshold,
            )
        elif single.size:
            yield mind(
                figure,
                f"'{signal.name}' has outliers, the first at {r.t[int(single[0])]:.6g} s: leave that time out by"
                " --window, or empty these cells (single empty ones are interpolated)",
                threshold,
            )
        else:
            yield passed(figure, threshold)


def _local_noise(x: Array) -> Array:
    """Noise around each sample, shape (samples,): it may be larger in motion than at rest."""
    third = median_filter(np.abs(np.diff(x, 3)), size=POLICY.near, mode="nearest")
    return np.asarray(np.pad(noise_of_differences(third, 3), (1, 2), mode="edge"))


def _single(x: Array, size: Array) -> Array:
    """Samples off the line through two neighbours on each side that agree."""
    a, b, c, d, e = (x[k : x.size - 4 + k] for k in range(5))
    here = np.abs(c - 0.5 * (b + d))
    around = np.maximum.reduce([np.abs(b - 2.0 / 3.0 * a - 1.0 / 3.0 * d), np.abs(d - 2.0 / 3.0 * e - 1.0 / 3.0 * b)])
    found = (
        (here > POLICY.far * size[2:-2]) & (here > POLICY.far / POLICY.soft * around) & (c != b) & (c != d)
    )  # a repeated sample is none
    return np.asarray(np.flatnonzero(found) + 2)


def _jumps(x: Array, size: Array) -> Array:
    """Steps that are far larger than those before and after."""
    steps = np.diff(x)
    near = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(steps, 2, mode="edge"), 5), axis=1)
    far = np.abs(steps - near) > POLICY.leap * size[1:] + POLICY.soft * np.abs(near)
    back = np.sign(steps[1:]) * np.sign(steps[:-1]) < 0  # an outlier comes back
    twice = far[1:] & far[:-1] & back
    far[1:] &= ~twice
    far[:-1] &= ~twice
    return np.asarray(np.flatnonzero(far))


CHECK = Check("outliers", "Are there single samples or jumps that no drive makes?", run)
