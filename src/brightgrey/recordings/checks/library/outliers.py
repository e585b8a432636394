"""Single samples far from their neighbours, and jumps of a position or of a smooth input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from brightgrey.arrays import Array
from brightgrey.numerics.distributions import norm
from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined, noise_of
from brightgrey.recordings.sample_values import is_constant, noise_of_differences
from brightgrey.recordings.units.signals import KINDS


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    far: float = 8.0
    """Standard deviations of the noise, and steps of the resolution, at which a sample is an outlier."""
    chance: float = 1e-3
    """Probability that noise alone makes a jump anywhere in the recording."""
    spans: tuple[int, ...] = (4, 8, 16)
    """Samples on either side of a jump that a parabola is fitted to, the shortest first."""
    rare: int = 1
    """Number of jumps of an input up to which it is smooth everywhere else."""
    near: int = 101
    """Samples around one that tell its noise."""
    soft: float = 3.0
    """The same for neighbours that agree with each other. A jump is so many times the steps around it, as a sample that
    is repeated makes one step, and their usual change."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Find samples that differ from their neighbours, which agree with each other, and jumps that stay."""
    r = examined.recording
    yield from _say_input(examined)
    for signal, values, step in zip(r.outputs, r.y, examined.steps[1:], strict=True):
        if is_constant(values):
            continue
        size = np.maximum(_local_noise(values), max(noise_of(values), 0.5 * step))
        single = _single(values, size)
        jumps = _jumps(values, single, step) if KINDS[signal.kind] == 0 else np.empty(0)
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


def _say_input(examined: Examined) -> Iterator[CheckResult]:
    """Say if the input jumps at one instant, and is smooth everywhere else."""
    r = examined.recording
    if is_constant(r.u):
        return
    jumps = _jumps(r.u, np.empty(0), examined.steps[0]).astype(int)
    figure = f"'{r.input.name}' jumps {len(jumps)} times"
    threshold = f"up to {POLICY.rare} jump, with a change before and after"
    if 0 < len(jumps) <= POLICY.rare and _stand_out(r.u, jumps):
        yield mind(
            figure,
            f"'{r.input.name}' jumps at {r.t[int(jumps[0])]:.6g} s, and is smooth everywhere else: samples may be lost"
            " there without a gap in the time. Unless this jump was planned, use the time before or after it by"
            " --window",
            threshold,
        )
    else:
        yield passed(figure, threshold)


def _stand_out(u: Array, jumps: NDArray[np.int64]) -> bool:
    """True if jumps are much larger than what the input does elsewhere, and it changes before and after each."""
    span = min(POLICY.spans)
    rests = [k for k in jumps if not (np.ptp(u[max(k - span, 0) : k + 1]) and np.ptp(u[k + 1 : k + 2 + span]))]
    bends = np.abs(np.diff(u, 2))[span:-span]
    elsewhere = np.abs(np.subtract.outer(np.arange(bends.size) + span, jumps)).min(axis=1) > span
    clear = np.abs(np.diff(u))[jumps].min() > bends[elsewhere].max(initial=0.0)
    return bool(clear and not rests)


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


def _jumps(x: Array, single: Array, step: float) -> Array:
    """Last samples before jumps of a position or an input: parabolas through the samples on either side do not meet.

    An impact changes the speed at once, but never the position. The difference of the two parabolas in the middle is
    compared with its usual size: the largest of so many Gaussian numbers (Bonferroni) is no chance. A jump is as large
    between its two samples, and between the shortest parabolas, as between longer ones; a motion that is none grows
    with the third power of their length. It is more than one `step` of the resolution. `single` are outliers, which
    jump back.
    """
    steps = np.diff(x)
    near = np.abs(np.median(np.lib.stride_tricks.sliding_window_view(np.pad(steps, 2, mode="edge"), 5), axis=1))
    bend = POLICY.soft * float(np.abs(np.diff(steps)).mean())  # an acceleration that begins at once is no jump
    limit = norm.isf(POLICY.chance / (2.0 * x.size * len(POLICY.spans)))
    found, shortest = np.zeros(x.size), np.zeros(x.size)
    for span in (span for span in POLICY.spans if 2 * span < x.size):
        # Weights of the samples at 0.5, 1.5, ... in the value at 0 of the parabola that fits them best.
        weights = np.linalg.pinv(np.vander(np.arange(span) + 0.5, 3, increasing=True))[0]
        after, before = np.convolve(x, weights[::-1], "valid"), np.convolve(x, weights, "valid")
        middle = slice(span - 1, x.size - span)
        gap = after[span:] - before[:-span]
        if span == POLICY.spans[0]:
            shortest[middle] = gap
        usual = median_filter(np.abs(gap), size=max(POLICY.near, 8 * span), mode="nearest")
        usual = np.maximum(usual, float(np.median(np.abs(gap)))) / norm.isf(0.25)
        stays = shortest[middle] * np.sign(gap) > 0.5 * np.abs(gap)
        stays &= steps[middle] * np.sign(gap) > np.maximum(0.5 * np.abs(gap), 1.5 * step)
        clear = stays & (np.abs(gap) > np.maximum(limit * usual, bend + POLICY.soft * near[middle]))
        found[middle] = np.maximum(found[middle], np.where(clear, np.abs(gap) / np.maximum(usual, 1e-300), 0.0))
    for at in single.astype(int):
        found[max(at - max(POLICY.spans), 0) : at + max(POLICY.spans)] = 0.0
    highest = maximum_filter1d(found, 2 * min(POLICY.spans) - 1)
    return np.asarray(np.flatnonzero((found > 0.0) & (found == highest)))


CHECK = Check("outliers", "Are there single samples or jumps that no drive makes?", run)
