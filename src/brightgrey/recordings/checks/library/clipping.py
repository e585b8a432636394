"""Channels that stay at their largest or smallest value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, mind, note, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import difference_noise, is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    far: float = 30.0
    """Steps of the resolution that a slope beside a top has to make within it."""
    beside: int = 3
    """Samples over which that slope is taken."""
    least: int = 5
    """Neighbouring samples at a limit that make a flat top."""
    matters: float = 0.0025
    """Part of the samples at a limit from which it is said."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Find flat tops: several neighbouring samples at exactly the extreme value, reached with a slope."""
    r = examined.recording
    for signal, values, step in zip((r.input, *r.outputs), (r.u, *r.y), examined.steps, strict=True):
        if is_constant(values):
            continue
        share, limit = _at_limit(values, step)
        if limit == 0.0 and signal.kind.startswith("velocity"):  # it stands still
            share = 0.0
        figure = f"{100 * share:.1f} % of '{signal.name}' are at a limit"
        threshold = f"{100 * POLICY.matters:g} %"
        if share < POLICY.matters:
            yield passed(figure, threshold)
            continue
        shown = f"{limit * signal.factor:.5g} {signal.unit}"
        if signal.kind == "input":
            yield note(
                figure,
                f"'{signal.name}' stays at {shown}: if the drive limits it after it is recorded, record it behind the"
                " limit",
                threshold,
            )
        else:
            yield mind(
                figure,
                f"'{signal.name}' stays at {shown} while the drive moves on: its range is too small, or an end stop"
                " was hit. Leave that part out by --window",
                threshold,
            )


def _at_limit(values: Array, step: float) -> tuple[float, float]:
    """Return the part of the samples in flat tops, and their value.

    Noise of more than one `step` of the resolution makes no flat tops. Without it a top is one of a limit if it begins
    or ends with a corner: a slope that would go on far beyond it.
    """
    best = 0.0, 0.0
    noisy = float(difference_noise(values, 3)) > step
    for limit in (float(values.max()), float(values.min())):
        at = np.flatnonzero(np.diff(np.pad((values == limit).astype(int), 1)))
        tops = [(int(a), int(b)) for a, b in zip(at[::2], at[1::2], strict=True) if b - a >= POLICY.least]
        sharp = [(a, b) for a, b in tops if noisy or _corner(values, a, b) > POLICY.far * step]
        best = max(best, (sum(b - a for a, b in sharp) / values.size, limit))
    return best


def _corner(values: Array, start: int, end: int) -> float:
    """Change that the steeper slope beside a top would make within it."""
    inner_outer = ((start, start - POLICY.beside), (end - 1, end - 1 + POLICY.beside))
    slopes = [abs(values[i] - values[o]) / POLICY.beside for i, o in inner_outer if 0 <= o < values.size]
    return float(max(slopes, default=0.0) * min(end - start, 10))


CHECK = Check("limits", "Does a channel stay at its largest or smallest value?", run)
