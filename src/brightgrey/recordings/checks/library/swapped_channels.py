"""Input and velocity that were swapped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array, log_ratio
from brightgrey.numerics.distributions import chi2
from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined, noise_of
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    blocks: int = 450
    """Means over blocks of samples that are predicted, about."""
    past: int = 12
    """Past blocks of both channels from which the next one is predicted."""
    level: float = 1e-3
    """Probability by chance that the past of the velocity helps to predict the input."""
    ratio: float = 2.0
    """Likelihood ratio (its logarithm) of this direction over that of the other one."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Ask which of input and velocity drives the other one.

    What is new in a torque shows in the velocity later, and never the other way round (Granger 1969,
    doi:10.2307/1912791). A controller answers to the velocity, too; but the velocity then lags behind the torque, as an
    inertia makes it.
    """
    r = examined.recording
    if not examined.moves or r.outputs[0].kind not in ("velocity", "velocity-differenced"):
        return
    size = max(1, r.samples // POLICY.blocks)
    u, v = (x[: x.size // size * size].reshape(-1, size).mean(axis=1) for x in (r.u, r.y[0]))
    if is_constant(u) or is_constant(v) or u.size < 6 * POLICY.past:
        return
    sound, swapped = _helps(u, v), _helps(v, u)
    leads = _leads(examined)
    figure = (
        f"the input's past helps to predict the velocity with a likelihood ratio of {sound:.0f}, the velocity's past"
        f" the input with {swapped:.0f}; the velocity {'leads' if leads > 0 else 'lags'}"
    )
    threshold = f"p < {POLICY.level:g}, {POLICY.ratio:g} times the other one, and the velocity leads"
    clear = swapped > float(chi2.isf(POLICY.level, POLICY.past)) and swapped > POLICY.ratio * sound
    if clear and leads > 0.0:
        yield mind(
            figure,
            f"'{r.input.name}' looks like the motion and '{r.outputs[0].name}' like the torque, since the first follows"
            " the second: swap --input and --output, unless the drive works against a spring or a pendulum",
            threshold,
        )
    else:
        yield passed(figure, threshold)


def _helps(cause: Array, effect: Array) -> float:
    """Twice the logarithm of the likelihood ratio with which the past of one signal predicts the other one."""
    x, y = ((s - s.mean()) / np.std(s) for s in (cause, effect))
    own, other = (np.lib.stride_tricks.sliding_window_view(s, POLICY.past)[:-1] for s in (y, x))
    alone = np.column_stack([own, np.ones(len(own))])
    without, both = (_rest_of_squares(terms, y[POLICY.past :]) for terms in (alone, np.column_stack([alone, other])))
    return len(own) * float(log_ratio(without, both))


def _rest_of_squares(terms: Array, y: Array) -> float:
    """Sum of squares that a regression leaves; that of rounding at least."""
    residual = y - terms @ np.linalg.lstsq(terms, y, rcond=1e-10)[0]
    return max(float(residual @ residual), 1e-20 * y.size)


def _leads(examined: Examined) -> float:
    """Correlation of the velocity with the slope of the input, both smoothed: positive if the velocity leads."""
    r = examined.recording
    sides = (r.u, noise_of(r.u)), (r.y[0], examined.noise[0])
    clean = (w for w in examined.widths if all(examined.is_clean(x, noise, w) for x, noise in sides))
    width = next(clean, examined.widths[-1])
    v, slope = examined.smooth(r.y[0], width), examined.smooth(r.u, width, 1)
    together = (v - v.mean()) * (slope - slope.mean()) / max(float(np.std(v) * np.std(slope)), 1e-300)
    return float(together.mean())


CHECK = Check("swapped channels", "Is the input the torque, and the output the motion?", run)
