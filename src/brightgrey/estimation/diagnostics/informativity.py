"""What can be said of recordings before any fit: whether there is anything in them to identify."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.numerics.distributions import f as f_distribution
from brightgrey.numerics.distributions import norm
from brightgrey.recordings import Recording

__all__ = ["recording_findings", "why_uninformative"]

_STEADY = 0.02  # scatter of an input, relative to its mean, that still counts as constant if it is white
_BLOCKS = (1, 4, 16, 32, 64)  # samples that are taken together, to find what follows the input
_PAST, _SHORT_PAST = 8, 4  # blocks that tell the next one; where there are few
_FEWEST = 8  # times as many blocks make a test
_SMOOTH = 0.2  # times its range over the root of its steps; a random walk has 0.3 to 1
_NOTHING = 1e-24  # of the power: what rounding leaves
_SURE = 1e-3  # chance of taking noise for what follows the input; a fit then finds out
_CERTAIN = 1e-5  # ... of taking white noise on an input for excitation
_FLAT = 5  # equal samples at the largest value that make a stop
_STEEP = 3.0  # steps of the resolution per sample: what a signal may not stop from at once
_USUAL = 0.3  # of the usual change per sample, likewise
_MOSTLY, _SOME = 0.5, 0.02  # of the samples, saturated


def recording_findings(recordings: Sequence[Recording]) -> tuple[Finding, ...]:
    """Findings on recordings that show nothing or too little.

    The first has the kind ``not identifiable`` if no recording shows anything: there is no use in a fit then.
    """
    reasons = [(r.name, why_uninformative(r)) for r in recordings]
    told = "; ".join(f"{name}: {reason}" for name, reason in reasons if reason)
    found = []
    if told and all(reason for _, reason in reasons):
        found.append(Finding("not identifiable", f"nothing can be identified from this: {told}"))
    elif told:
        found.append(Finding("uninformative", f"nothing can be identified from {told}"))
    for r, (_, reason) in zip(recordings, reasons, strict=True):
        for signal, y, step in zip(r.outputs, r.y, r.resolution, strict=True):
            share = 0.0 if reason else _saturated(y, float(step))
            if share > _SOME:
                found.append(
                    Finding(
                        "saturated", f"{r.name}: {signal.name} stops dead at its limits in {share:.0%} of the samples"
                    )
                )
    return tuple(found)


def why_uninformative(recording: Recording) -> str | None:
    """Why nothing can be identified from a recording, in words; None if something may be."""
    u = recording.u
    if np.ptp(u) == 0.0 or (np.std(u) <= _STEADY * abs(np.mean(u)) and _white(u)):
        return f"{recording.input.name} never changes"
    reasons = [_silent(recording, out) for out in range(len(recording.outputs))]
    if not all(reasons):
        return None
    return " and ".join(f"{s.name} {reason}" for s, reason in zip(recording.outputs, reasons, strict=True))


def _silent(recording: Recording, out: int) -> str | None:
    y, step = recording.y[out], float(recording.resolution[out])
    if np.ptp(y) <= 2.0 * step:
        return "moves by no more than its resolution"
    if _saturated(y, step) > _MOSTLY:
        return "is saturated"
    if not _follows(y, recording.u):
        return "does not follow the input"
    return None


def _white(x: Array) -> bool:
    """Whether neighbours differ as much as strangers do (von Neumann 1941, doi:10.1214/aoms/1177731677)."""
    about = x - x.mean()
    ratio = float(np.sum(np.diff(x) ** 2) / np.sum(about**2))
    return ratio > 2.0 + float(norm.ppf(_CERTAIN)) * 2.0 / float(np.sqrt(len(x)))


def _follows(y: Array, u: Array) -> bool:
    """Whether the input helps to tell `y` from its own past, at any of several time scales (Granger 1969).

    The F test of an autoregression with against one without past inputs (doi:10.2307/1912791), on means over blocks:
    noise hides what follows within few samples. Its own past takes account of noise that is slow. What goes further
    than a random walk of its own irregularities is motion, too, even if the input hardly changes.
    """
    if len(y) < _FEWEST * _PAST:
        return True  # too few samples to deny it
    for block in _BLOCKS:
        m = len(y) // block
        past_blocks = _PAST if m >= _FEWEST * _PAST else _SHORT_PAST
        if m < _FEWEST * past_blocks:
            break
        lags = np.arange(1, past_blocks + 1)
        mean_y, mean_u = (x[: m * block].reshape(m, block).mean(axis=1) for x in (y - y.mean(), u - u.mean()))
        rows = np.arange(past_blocks, m)[:, None]
        past = np.hstack([np.ones((m - past_blocks, 1)), mean_y[rows - lags]])
        both = np.hstack([past, mean_u[rows - np.append(0, lags)]])
        target = mean_y[past_blocks:]
        alone, helped = (float(np.sum((target - X @ np.linalg.lstsq(X, target)[0]) ** 2)) for X in (past, both))
        if np.sqrt(alone / len(target)) < _SMOOTH * float(np.ptp(mean_y)) / np.sqrt(m):
            return True
        free = len(target) - both.shape[1]
        if alone > _NOTHING * float(target @ target) and helped > 0.0:
            gain = (alone - helped) / helped * free / (past_blocks + 1)
            if f_distribution.sf(gain, past_blocks + 1, free) < _SURE:
                return True
    return False


def _saturated(y: Array, step: float) -> float:
    """Share of samples in runs of equal values at the largest or smallest one that begin or end steeply.

    A motion that settles comes to its last value slowly; one that is cut off stops dead.
    """
    share = 0
    steep = max(_STEEP * step, _USUAL * float(np.sqrt(np.mean(np.diff(y) ** 2))))
    for limit in (y.max(), y.min()):
        at = np.concatenate([[False], y == limit, [False]])
        edges = np.flatnonzero(np.diff(at.astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            before = abs(y[begin - 1] - y[begin - 2]) if begin > 1 else 0.0
            after = abs(y[end + 1] - y[end]) if end + 1 < len(y) else 0.0
            if end - begin >= _FLAT and max(before, after) >= steep and limit != 0.0:
                share += end - begin
    return share / len(y)
