"""Input and velocity that were swapped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined, noise_of


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    leads: float = 0.15
    """Correlation of the velocity with the slope of the input from which the velocity leads."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Ask if the velocity leads the input, and is rougher: an inertia makes it lag, and smooth."""
    r = examined.recording
    if not examined.moves or r.outputs[0].kind not in ("velocity", "velocity-differenced"):
        return
    sides = (r.u, noise_of(r.u)), (r.y[0], examined.noise[0])
    clean = (w for w in examined.widths if all(examined.is_clean(x, noise, w) for x, noise in sides))
    width = next(clean, examined.widths[-1])
    u, v = (examined.smooth(x, width) for x, _ in sides)
    slope_u, slope_v = (examined.smooth(x, width, 1) for x, _ in sides)
    together = (v - v.mean()) * (slope_u - slope_u.mean()) / max(float(np.std(v) * np.std(slope_u)), 1e-300)
    leads = float(together.mean())
    rougher = _roughness(slope_v, v) / max(_roughness(slope_u, u), 1e-300)
    figure = f"the velocity {'leads' if leads > 0 else 'lags'} with a correlation of {abs(leads):.2f}"
    threshold = f"it leads by {POLICY.leads:g}, and is rougher than the input"
    if leads > POLICY.leads and rougher > 1.0:
        yield mind(
            figure,
            f"'{r.input.name}' looks like the motion and '{r.outputs[0].name}' like the torque: swap --input and"
            " --output, unless the drive works against a spring or a pendulum",
            threshold,
        )
    else:
        yield passed(figure, threshold)


def _roughness(slope: Array, x: Array) -> float:
    return float(np.var(slope) / max(float(np.var(x)), 1e-300))


CHECK = Check("swapped channels", "Is the input the torque, and the output the motion?", run)
