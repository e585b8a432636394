"""Outputs that are setpoints and no measurements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    points: tuple[int, ...] = (400, 200, 100)
    """Points of a recording that are looked at: planned parts are short or long."""
    rows: int = 8
    order: int = 4
    """A window of ROWS equations tells if its points follow a linear recursion of this order without an error."""
    rounding: float = 1.05
    """Error of the recursion in steps of the resolution. By simulation 95 % of the windows with nothing but rounding
    are below it, and 7 % of those with noise of one step."""
    curved: float = 30.0
    """Curvature of a window in steps of the resolution, from which it tells anything."""
    most: float = 0.5
    """Part of the curved windows that have to be without an error."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Test if short parts of each output are polynomials or sine waves but for rounding, as setpoints are."""
    r = examined.recording
    for row, signal in enumerate(r.outputs):
        if is_constant(r.y[row]):
            continue
        shares = [_exact_windows(r.y[row], float(r.resolution[row]), points) for points in POLICY.points]
        if not (known := [share for share in shares if share is not None]):
            continue
        share = max(known)
        figure = f"{100 * share:.0f} % of the parts of '{signal.name}' follow a formula exactly"
        threshold = f"{100 * POLICY.most:.0f} %"
        if share > POLICY.most:
            yield mind(
                figure,
                f"'{signal.name}' looks like a setpoint and no measurement: it has no noise, and follows polynomials or"
                " sine waves. Name the actual value by --output",
                threshold,
            )
        else:
            yield passed(figure, threshold)


def _exact_windows(y: Array, step: float, count: int) -> float | None:
    """Return the part of the curved windows whose points obey a linear recursion; None if hardly any is curved."""
    points = y[:: max(1, y.size // count)]
    length = POLICY.rows + POLICY.order
    if points.size < 3 * length:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(points, length)[:: length // 2]
    curvature = np.std(np.diff(windows, 2, axis=1), axis=1)
    windows = windows[curvature > POLICY.curved * step]
    if len(windows) < 5:
        return None
    hankel = np.lib.stride_tricks.sliding_window_view(windows, POLICY.order + 1, axis=1)
    error = np.linalg.svd(hankel - windows.mean(axis=1)[:, None, None], compute_uv=False)[:, -1]
    return float(np.mean(error < POLICY.rounding * step))


CHECK = Check("setpoint", "Are the outputs measured values and no setpoints?", run)
