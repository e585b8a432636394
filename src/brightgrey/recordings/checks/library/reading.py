"""Repairs and assumptions of the reader: holes, steps of the clock, units; a step that no drive is recorded with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from brightgrey.recordings.checks.check import Check, CheckResult, mind, note, passed, stop
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.columns import MODELS_EXPECT, NAME_SAYS


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    shortest: float = 1e-6
    """Sampling interval in s below which a time is in another unit, such as days."""
    longest: float = 0.5
    """Sampling interval in s from which a time is in another unit, such as ms: a motion between two standstills would
    have a few samples."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Say what the reader noted, and whether the step can be one in s."""
    r = examined.recording
    if not POLICY.shortest <= r.dt < POLICY.longest:
        likely = "ms" if r.dt >= POLICY.longest else "day"
        yield stop(
            f"a sample every {r.dt:.4g} s",
            f"a sample every {r.dt:.4g} s is no recording of a drive: say the unit of the time (--unit"
            f" 'time={likely}'), or give the interval in s (--dt 0.001)",
            f"{POLICY.shortest:g} to {POLICY.longest:g} s",
        )
    for text in r.notes:
        doubtful = NAME_SAYS in text or MODELS_EXPECT in text
        yield mind("", text) if doubtful else note("", text)
    if not r.notes:
        yield passed(f"{r.samples} samples every {1e3 * r.dt:.6g} ms, nothing repaired")


CHECK = Check("file", "Was anything repaired or assumed when the file was read, and is its step possible?", run)
