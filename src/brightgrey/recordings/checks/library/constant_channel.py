"""Channels that never change."""

from __future__ import annotations

from collections.abc import Iterator

from brightgrey.recordings.checks.check import Check, CheckResult, mind, passed, stop
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import is_constant


def run(examined: Examined) -> Iterator[CheckResult]:
    """Look at every channel."""
    r = examined.recording
    found = False
    for signal, values in zip((r.input, *r.outputs), (r.u, *r.y), strict=True):
        if not is_constant(values):
            continue
        found = True
        figure = f"'{signal.name}' is {values[0] * signal.factor:.6g} {signal.unit} throughout"
        if signal.kind == "input":
            yield mind(figure, f"input '{signal.name}' never changes: little can be identified from it")
        else:
            yield stop(figure, f"output '{signal.name}' never changes: name another column by --output")
    if not found:
        yield passed("every channel changes")


CHECK = Check("constant channel", "Does every channel change?", run)
