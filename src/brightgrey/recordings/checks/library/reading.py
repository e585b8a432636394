"""Repairs and assumptions of the reader: holes, steps of the clock, units."""

from __future__ import annotations

from collections.abc import Iterator

from brightgrey.recordings.checks.check import Check, CheckResult, note, passed
from brightgrey.recordings.checks.examined import Examined


def run(examined: Examined) -> Iterator[CheckResult]:
    """Say what the reader noted."""
    r = examined.recording
    for text in r.notes:
        yield note("", text)
    if not r.notes:
        yield passed(f"{r.samples} samples every {1e3 * r.dt:.6g} ms, nothing repaired")


CHECK = Check("file", "Was anything repaired or assumed when the file was read?", run)
