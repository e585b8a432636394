"""Samples that repeat the one before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.recordings.checks.check import Check, CheckResult, mind, note, passed
from brightgrey.recordings.checks.examined import Examined, noise_of
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    matters: float = 0.02
    """Part of the samples that may repeat the one before without harm."""
    regular: float = 0.9
    """Part of the steps of one length from which a channel is held at a fixed rate."""
    clear: float = 5.0
    least: int = 50
    """Moving samples without which nothing is said."""
    moves: float = 1.5
    """Steps of the resolution per sample from which a channel moves."""
    beside: int = 5
    """Samples on either side over which a slope is taken."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Count repeated samples of every channel beyond those that its resolution explains."""
    r = examined.recording
    for signal, values, size in zip((r.input, *r.outputs), (r.u, *r.y), examined.steps, strict=True):
        if is_constant(values):
            continue
        steps = _moving_steps(values, size, planned=signal.kind == "input")
        if steps.size < POLICY.least:
            continue
        repeated = steps == 0.0
        share, expected = float(repeated.mean()), _by_rounding(steps, size)
        figure = f"{100 * share:.1f} % of '{signal.name}' repeat the sample before, {100 * expected:.1f} % expected"
        spread = float(np.sqrt(max(expected * (1.0 - expected), 1.0 / repeated.size) / repeated.size))
        threshold = f"{100 * POLICY.matters:.0f} % and {POLICY.clear:g} standard deviations more"
        is_input, every = signal.kind == "input", _regular(repeated)
        # An input may be planned in steps; only a regular rhythm is that of a slower clock.
        if share - expected < max(POLICY.matters, POLICY.clear * spread):
            yield passed(figure, threshold)
        elif is_input and not every:
            yield passed(f"'{signal.name}' is planned in steps", threshold)
        elif every and is_input:
            yield note(
                figure,
                f"'{signal.name}' changes at every {every}th sample only: if it is held between, say --hold zoh",
                threshold,
            )
        elif every:
            yield mind(
                figure,
                f"'{signal.name}' is sampled at every {every}th row only: keep these by --decimate {every}",
                threshold,
                decimate=every,
            )
        else:
            yield mind(
                figure,
                f"'{signal.name}' was not always ready when it was recorded: each repeated sample is a step late, so"
                " that the time of its changes is uncertain by one sample. Record it by the clock of the drive",
                threshold,
            )


def _regular(repeated: NDArray[np.bool_]) -> int:
    """Return N if a channel changes at every Nth sample, else 0."""
    steps = np.diff(np.flatnonzero(~repeated))
    if steps.size < 10:
        return 0
    usual = int(np.median(steps))
    return usual if usual > 1 and float(np.mean(steps == usual)) > POLICY.regular else 0


def _moving_steps(values: Array, size: float, *, planned: bool) -> Array:
    """Differences of neighbours where a channel moves, by noise or by its slope; by noise, all of a `planned` one."""
    steps = np.diff(values)
    if noise_of(values[np.append(True, steps != 0.0)]) > size:  # repeated samples have none
        return np.asarray(steps if planned else _not_at_rest(steps, size))
    padded = np.pad(values, (POLICY.beside - 1, POLICY.beside), mode="edge")
    slope = (padded[2 * POLICY.beside - 1 :] - padded[: 1 - 2 * POLICY.beside])[: steps.size] / (2 * POLICY.beside - 1)
    return np.asarray(steps[np.abs(slope) > POLICY.moves * size])


def _not_at_rest(steps: Array, size: float) -> Array:
    """Leave out where a drive rests: changes are rare there, or as small as the resolution."""
    at = np.flatnonzero(steps)
    since = np.diff(at, prepend=-1)  # samples from the change before
    sizes = np.pad(np.abs(steps[at]), POLICY.beside, mode="edge")
    around = np.convolve(sizes, np.ones(2 * POLICY.beside + 1) / (2 * POLICY.beside + 1), "valid")
    moves = (around > POLICY.moves * size) & (since <= 2 * POLICY.beside * np.median(since))
    return np.asarray(steps[: at[-1] + 1][np.repeat(moves, since)])


def _by_rounding(steps: Array, size: float) -> float:
    """Part of the steps that rounding makes zero: where the smooth distribution of the other steps would be at zero."""
    counts = np.rint(np.abs(steps) / size)
    one, two = (0.5 * float(np.mean(counts == k)) for k in (1, 2))
    return float(np.clip((4.0 * one - two) / 3.0, 0.0, 1.0))


CHECK = Check("repeated samples", "Does every sample of a moving channel hold a new value?", run)
