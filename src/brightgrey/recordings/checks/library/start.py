"""State before the first sample."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.recordings.checks.check import Check, CheckResult, note, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.units.signals import KINDS


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    still: float = 0.02
    """Part of the largest speed that is no motion."""
    clear: float = 5.0
    """Standard errors that this has to be."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Compare the first speed with the largest one."""
    if not examined.moves or (motion := examined.motion()) is None:
        return
    largest = float(np.abs(motion.velocity).max())
    first = _speed_at_start(examined, POLICY.still * largest / POLICY.clear) / largest if largest else 0.0
    figure = f"the first speed is {100 * first:.1f} % of the largest one"
    threshold = f"{100 * POLICY.still:g} %"
    if first > POLICY.still:
        yield note(
            figure,
            "the drive moves when the recording begins: its state there is estimated, too. A recording that begins at"
            " rest is better",
            threshold,
        )
    else:
        yield passed(figure, threshold)


def _speed_at_start(examined: Examined, error: float) -> float:
    """First speed, from as few samples as an error in SI allows; 0 if all of them are not enough."""
    r, noise = examined.recording, examined.noise[0]
    order = KINDS[r.outputs[0].kind]
    samples = 4
    while samples < r.samples // 4:
        y = r.y[0][:samples]
        if order == 1 and noise / np.sqrt(samples) < error:
            return abs(float(y.mean()))
        if order == 0 and noise * np.sqrt(12.0) / (samples**1.5 * examined.dt) < error:
            return abs(float(np.polyfit(r.t[:samples] - r.t[0], y, 1)[0]))
        samples += samples // 2
    return 0.0


CHECK = Check("start", "Does the recording begin at rest?", run)
