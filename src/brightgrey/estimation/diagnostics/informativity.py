"""Informativity of recordings, before any fit: excitation, response and saturation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.diagnostics.options import INFORMATIVITY_DEFAULTS, InformativityOptions
from brightgrey.numerics.distributions import f as f_distribution
from brightgrey.numerics.distributions import norm
from brightgrey.recordings import Recording

__all__ = ["recording_findings", "uninformative_reason"]


def recording_findings(
    recordings: Sequence[Recording], options: InformativityOptions = INFORMATIVITY_DEFAULTS
) -> tuple[Finding, ...]:
    """Findings on recordings that show nothing or too little.

    The first has the kind ``not identifiable`` if no recording shows anything: a fit is useless then.
    """
    reasons = [(r.name, uninformative_reason(r, options)) for r in recordings]
    listed = "; ".join(f"{name}: {reason}" for name, reason in reasons if reason)
    found = []
    if listed and all(reason for _, reason in reasons):
        found.append(Finding("not identifiable", f"nothing can be identified from this: {listed}"))
    elif listed:
        found.append(Finding("uninformative", f"nothing can be identified from {listed}"))
    for r, (_, reason) in zip(recordings, reasons, strict=True):
        for signal, y, step in zip(r.outputs, r.y, r.resolution, strict=True):
            share = 0.0 if reason else _saturated_share(y, float(step), options)
            if share > options.partly_saturated:
                text = f"in {r.name}, {signal.name} is cut off at its limits in {100.0 * share:.0f} % of the samples"
                found.append(Finding("saturated", text))
    return tuple(found)


def uninformative_reason(recording: Recording, options: InformativityOptions = INFORMATIVITY_DEFAULTS) -> str | None:
    """Reason, in words, why nothing can be identified from a recording; None if something may be."""
    u = recording.u
    small = np.std(u) <= options.constant_input * abs(np.mean(u))
    if np.ptp(u) == 0.0 or (small and _is_white_input(u, options.white_input_level)):
        return f"{recording.input.name} never changes"
    reasons = [_useless_output(recording, out, options) for out in range(len(recording.outputs))]
    if not all(reasons):
        return None
    return " and ".join(f"{s.name} {reason}" for s, reason in zip(recording.outputs, reasons, strict=True))


def _useless_output(recording: Recording, out: int, options: InformativityOptions) -> str | None:
    y, step = recording.y[out], float(recording.resolution[out])
    if np.ptp(y) <= 2.0 * step:
        return "moves by no more than its resolution"
    if _saturated_share(y, step, options) > options.mostly_saturated:
        return "is saturated"
    if not _responds(y, recording.u, options):
        return "does not follow the input"
    return None


def _is_white_input(x: Array, level: float) -> bool:
    """Test if neighbours differ as much as distant samples (von Neumann 1941, doi:10.1214/aoms/1177731677)."""
    about = x - x.mean()
    ratio = float(np.sum(np.diff(x) ** 2) / np.sum(about**2))
    return ratio > 2.0 + float(norm.ppf(level)) * 2.0 / float(np.sqrt(len(x)))


def _responds(y: Array, u: Array, options: InformativityOptions) -> bool:
    """Test if the input helps to predict `y` from its own past, at any of several time scales (Granger 1969).

    The F test compares autoregressions with and without past inputs (doi:10.2307/1912791), on means over blocks: noise
    hides a response within few samples. The past of `y` accounts for slow noise. A range larger than that of a random
    walk with the same increments is motion, too, even if the input hardly changes.
    """
    if len(y) < options.blocks_per_past * options.past:
        return True  # too few samples to deny it
    for block in options.blocks:
        blocks = len(y) // block
        past = options.past if blocks >= options.blocks_per_past * options.past else options.short_past
        if blocks < options.blocks_per_past * past:
            break
        if _block_means_respond(y, u, block, past, options):
            return True
    return False


def _block_means_respond(y: Array, u: Array, block: int, past: int, options: InformativityOptions) -> bool:
    """Granger's test on the means over blocks of `block` samples."""
    m = len(y) // block
    mean_y, mean_u = (x[: m * block].reshape(m, block).mean(axis=1) for x in (y - y.mean(), u - u.mean()))
    rows, lags = np.arange(past, m)[:, None], np.arange(1, past + 1)
    without = np.hstack([np.ones((m - past, 1)), mean_y[rows - lags]])
    with_input = np.hstack([without, mean_u[rows - np.append(0, lags)]])
    target = mean_y[past:]
    rss, rss_with_input = (
        float(np.sum((target - X @ np.linalg.lstsq(X, target)[0]) ** 2)) for X in (without, with_input)
    )
    if np.sqrt(rss / len(target)) < options.smooth_motion * float(np.ptp(mean_y)) / np.sqrt(m):
        return True
    if not (rss > options.rounding_power * float(target @ target) and rss_with_input > 0.0):
        return False
    degrees = len(target) - with_input.shape[1]
    statistic = (rss - rss_with_input) / rss_with_input * degrees / (past + 1)
    return bool(f_distribution.sf(statistic, past + 1, degrees) < options.response_level)


def _saturated_share(y: Array, step: float, options: InformativityOptions) -> float:
    """Part of the samples in runs of equal extreme values that begin or end steeply.

    A motion that settles approaches its last value slowly; one that is cut off stops at once.
    """
    count = 0
    steep = max(options.stop_resolution * step, options.stop_change * float(np.sqrt(np.mean(np.diff(y) ** 2))))
    for limit in (y.max(), y.min()):
        at_limit = np.concatenate([[False], y == limit, [False]])
        edges = np.flatnonzero(np.diff(at_limit.astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            before = abs(y[begin - 1] - y[begin - 2]) if begin > 1 else 0.0
            after = abs(y[end + 1] - y[end]) if end + 1 < len(y) else 0.0
            if end - begin >= options.stop_samples and max(before, after) >= steep and limit != 0.0:
                count += end - begin
    return count / len(y)
