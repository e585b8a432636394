"""Velocities that are differences of an encoder's counts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.policy import READING
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    orders: tuple[int, ...] = (2, 3)
    """Orders of the differences: a slow motion is nothing in the lower one, a fast one in the higher one only."""
    next: float = 0.28
    second: float = 0.4
    """Where the limits of the correlations of neighbours, and of those after, stand between the values of white noise
    and of its differences."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Correlate the higher differences of every velocity that moves in visible steps: they are free of the motion."""
    r = examined.recording
    for row, signal in enumerate(r.outputs):
        y, step = r.y[row], float(r.resolution[row])
        if signal.kind != "velocity" or is_constant(y) or np.ptp(y) >= READING.coarse_levels * step:
            continue
        (one, two), limits = max(
            ((_noise_correlations(y, order), _limits(order)) for order in POLICY.orders),
            key=lambda pair: min(pair[1][0] - pair[0][0], pair[0][1] - pair[1][1]),
        )
        figure = f"'{signal.name}' moves in steps of {step * signal.factor:.4g} {signal.unit}, its noise has the"
        figure += f" correlations {one:.2f} and {two:.2f}"
        threshold = f"correlations {limits[0]:.2f} and {limits[1]:.2f}"
        if one < limits[0] and two > limits[1]:
            yield mind(
                figure,
                f"'{signal.name}' was computed from the differences of an encoder: say"
                f" {signal.name}:velocity-differenced",
                threshold,
                output=[f"{signal.name}:{replace(signal, kind='velocity-differenced').sensor}"],
            )
        else:
            yield passed(figure, threshold)


def _noise_correlations(y: Array, order: int) -> tuple[float, float]:
    """Correlations of neighbouring differences, and of those after."""
    noise = np.diff(y, order)
    power = max(float(noise @ noise), 1e-300)
    return float(noise[1:] @ noise[:-1]) / power, float(noise[2:] @ noise[:-2]) / power


def _limits(order: int) -> tuple[float, float]:
    """Limits between differences of white noise and the next higher ones, which the noise of an encoder becomes."""
    white, differenced = (
        np.array([-n / (n + 1.0), n * (n - 1.0) / ((n + 1.0) * (n + 2.0))]) for n in (order, order + 1)
    )
    one, two = (white + np.array([POLICY.next, POLICY.second]) * (differenced - white)).tolist()
    return one, two


CHECK = Check("differenced velocity", "Was a velocity computed from the differences of an encoder?", run)
