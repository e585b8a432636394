"""Shorter recordings from a recording: a window of time, every n-th sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.recordings.recording import Hold, Recording, check_samples

__all__ = ["Window", "check_decimate", "check_window", "cut_window", "decimate", "inside"]

# Start and end in s of the recording's time; None leaves a side open.
Window = tuple[float | None, float | None]
# Share of an interval by which a sample may lie outside of a window: stamps are rounded.
SLACK = 0.01


def check_window(limits: Window | None) -> tuple[float, float]:
    """Start and end in s, infinite where open.

    Raises
    ------
    SettingsError
        If the start is not before the end.
    """
    low, high = limits or (None, None)
    start, end = -np.inf if low is None else float(low), np.inf if high is None else float(high)
    if not start < end:
        raise SettingsError(f"window {start:g}:{end:g} does not start before it ends")
    return start, end


def check_decimate(every: int) -> int:
    """Return `every` if it is a whole number from 1.

    Raises
    ------
    SettingsError
        If it is not.
    """
    if isinstance(every, bool) or every != int(every) or every < 1:
        raise SettingsError(f"decimate {every} is not a whole number from 1")
    return int(every)


def inside(t: Array, limits: Window | None) -> NDArray[np.bool_]:
    """Which of the times `t` (s, shape (samples,)) lie in a window, both ends included."""
    start, end = check_window(limits)
    steps = np.diff(t)
    slack = SLACK * float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    within: NDArray[np.bool_] = (t >= start - slack) & (t <= end + slack)
    return within


def cut_window(recording: Recording, start: float | None = None, end: float | None = None) -> Recording:
    """Part of a recording from `start` to `end` (s of its own time, both included; None leaves a side open).

    Raises
    ------
    RecordingError
        If too few samples are left.
    SettingsError
        If the start is not before the end.
    """
    part = inside(recording.t, (start, end))
    first, last = float(recording.t[0]), float(recording.t[-1])
    check_samples(recording.name, int(part.sum()), f"; the recording goes from {first:.6g} to {last:.6g} s")
    return replace(recording, t=recording.t[part], u=recording.u[part], y=recording.y[:, part])


def decimate(recording: Recording, every: int) -> Recording:
    """Keep every n-th sample.

    Outputs are picked, not filtered: a model is compared with them at those very instants, and a filter would
    act on the measurement only. A velocity made by differencing is averaged over the n differences up to the
    kept instant, which is the difference over the new interval: it goes on lagging half a (new) sample. The
    input must go on driving the model as it did between the kept instants: for zero-order hold it is averaged
    from one kept instant to the next; for linear interpolation it becomes the broken line nearest to the
    recorded one in least squares, which keeps its integral. (Against picking, simulated velocities of a
    damped mass and a two-mass drive come out 3 to 1000 times closer to those of the full recording, against a
    moving average 1.2 to 1000 times.)

    Parameters
    ----------
    recording : Recording
    every : int
        n; 1 returns the recording itself.

    Returns
    -------
    Recording
        With the samples 0, n, 2 n, ...; the rest at the end is dropped.

    Raises
    ------
    RecordingError
        If too few samples are left.
    SettingsError
        If n is not a whole number from 1.
    """
    n = check_decimate(every)
    if n == 1:
        return recording
    kept = (recording.samples - 1) // n + 1
    check_samples(recording.name, kept, f" after keeping one in {n}")
    y = recording.y[:, ::n].copy()
    resolution = recording.resolution.copy()
    for row, signal in enumerate(recording.outputs):
        if signal.kind == "velocity-differenced":
            sums = np.cumsum(recording.y[row])
            y[row, 1:] = np.diff(sums[::n]) / n
            resolution[row] /= n
    note = f"one sample in {n} is kept, the input averaged in between"
    return replace(
        recording,
        t=recording.t[::n],
        u=coarse_input(recording.u, n, recording.hold),
        y=y,
        resolution=resolution,
        notes=(*recording.notes, note),
    )


def coarse_input(u: Array, n: int, hold: Hold) -> Array:
    """Input at the samples 0, n, 2 n, ... that drives a model most like `u` does.

    Parameters
    ----------
    u : ndarray, shape (samples,)
    n : int
        Two or more.
    hold : {'linear', 'zoh'}
        How `u` and the result are to be read between their samples.

    Returns
    -------
    ndarray, shape ((samples - 1) // n + 1,)
    """
    if hold == "zoh":
        starts = np.arange(0, u.size, n)
        return np.asarray(np.add.reduceat(u, starts) / np.diff(np.append(starts, u.size)), dtype=np.float64)
    import scipy.linalg  # as slow to load as everything else here together

    kept = (u.size - 1) // n + 1
    u = u[: (kept - 1) * n + 1]
    # Normal equations of the projection onto hat functions of half width n: both sides are integrals of
    # products of broken lines, on the fine grid for the right-hand side.
    fine = np.empty_like(u)
    fine[1:-1] = (u[:-2] + 4 * u[1:-1] + u[2:]) / 6
    fine[0], fine[-1] = (2 * u[0] + u[1]) / 6, (2 * u[-1] + u[-2]) / 6
    hat = 1 - np.abs(np.arange(1 - n, n)) / n
    right = np.convolve(np.pad(fine, n - 1), hat, "valid")[::n]
    bands = np.empty((2, kept))
    bands[0] = n / 6
    bands[1] = 4 * n / 6
    bands[1, [0, -1]] = 2 * n / 6
    return np.asarray(scipy.linalg.solveh_banded(bands, right), dtype=np.float64)
