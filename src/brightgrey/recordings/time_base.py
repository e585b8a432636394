"""From the time stamps of a file to a uniform time, with a note on every repair.

The rules, the first that fits:

1. A hole is a step of `READING.hole` intervals or more. The recording is cut there, and its longest stretch is read.
2. Steps that are equal within `READING.max_jitter`, but for a few (`READING.max_repaired`), are read as equal. Single
   lost samples leave an empty point, samples that were written twice are left out.
3. Stamps that were rounded to the last digit they are written with are read as equally spaced.
4. Steps that differ by up to `READING.max_uneven` intervals: the channels are interpolated at equal steps.

Anything else is refused. Time must never run backwards, nor repeat with other values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, Indices
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.table import Table, list_rows
from brightgrey.recordings.policy import READING
from brightgrey.recordings.recording import interval

__all__ = ["Stamps", "UniformGrid", "longest_stretch", "repairs_allowed", "stretch_edges", "uniform_grid"]


@dataclass(frozen=True)
class Stamps:
    """Time stamps of a file."""

    t: Array  #: In s, finite, shape (samples,).
    #: True for every sample, from the second on, whose values all equal those of the sample before, shape (samples -
    #: 1,).
    repeated: NDArray[np.bool_]
    rows: Indices  #: Row of the file of every sample, shape (samples,).
    table: Table
    column: str  #: Name of the time's column.

    def fault(self, text: str, sample: int) -> RecordingError:
        """Return the error for a sample."""
        return self.table.fault(text, column=self.column, row=int(self.rows[sample]))


@dataclass(frozen=True)
class UniformGrid:
    """Uniform time of the samples of a file."""

    #: First time and interval in s.
    start: float
    dt: float
    index: Indices  #: Grid point of every sample. A point without a sample is a lost sample. Shape (samples,).
    notes: tuple[str, ...] = ()
    #: True if the samples lie between the points, so that channels have to be interpolated; `index` is then that of
    #: the points themselves.
    between: bool = False


def repairs_allowed(samples: int) -> int:
    """Return the number of samples, of so many, that may be interpolated or left out."""
    return max(1, int(READING.max_repaired * samples))


def stretch_edges(t: Array) -> Indices:
    """Return where the stretches without a hole begin, and the number of samples.

    Parameters
    ----------
    t : ndarray, shape (samples,)
        Time stamps in s. If they run backwards or stand still, which `uniform_grid` refuses, there is one stretch.

    Returns
    -------
    ndarray, shape (stretches + 1,)
    """
    steps = np.diff(t)
    rising = bool((steps > 0).any() and (steps >= 0).all())
    least = READING.hole * float(np.median(steps[steps > 0])) if rising else np.inf
    return np.concatenate([[0], np.flatnonzero(steps >= least) + 1, [t.size]])


def longest_stretch(t: Array, rows: Indices, table: Table, column: str) -> tuple[slice, list[str]]:
    """Return the longest part of a recording that has no hole in it, with a note on the others.

    Raises
    ------
    RecordingError
        If no part has `READING.least_stretch` of the samples; the message names the longest ones.
    """
    edges = stretch_edges(t)
    holes, steps = edges[1:-1], np.diff(t)
    if not holes.size:
        return slice(0, t.size), []
    best = int(np.argmax(np.diff(edges)))
    part = slice(int(edges[best]), int(edges[best + 1]))
    longest = np.sort(np.argsort(-np.diff(edges), kind="stable")[:3])
    windows = ", ".join(f"{t[edges[i]]:.6g}:{t[edges[i + 1] - 1]:.6g}" for i in longest)
    where = f"{holes.size} hole{'s' if holes.size > 1 else ''} in the time, the longest of {np.max(steps):.4g} s"
    if part.stop - part.start < READING.least_stretch * t.size:
        if holes.size > repairs_allowed(t.size):
            return slice(0, t.size), []  # the steps are not equal at all, which is said with the row
        raise table.fault(
            f"{where}; no stretch without one has half of the samples (cut the recording with a window:"
            f" {windows}, each a recording of its own)",
            column=column,
            row=int(rows[holes[0]]),
        )
    left_out = t.size - (part.stop - part.start)
    note = (
        f"{where}, before {list_rows(rows[holes])}: only the stretch from {t[part.start]:.6g} to"
        f" {t[part.stop - 1]:.6g} s is read, {left_out} sample{'s are' if left_out > 1 else ' is'} left out"
    )
    if np.sort(np.diff(edges))[-2] >= READING.min_samples:
        note += f"; the longest stretches are the windows {windows}"
    return part, [note]


def uniform_grid(stamps: Stamps) -> UniformGrid:
    """Put time stamps on a uniform grid, by rules 2 to 4 of this module.

    Parameters
    ----------
    stamps : Stamps
        Two at least.

    Returns
    -------
    UniformGrid

    Raises
    ------
    RecordingError
        If time runs backwards or its steps are not equal; names the row.
    """
    t = stamps.t
    steps = np.diff(t)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0)) + 1
        remedy = "turn their order round" if (steps < 0).all() else "if it was started again, cut the file there"
        where = ", in all rows" if (steps < 0).all() else ""
        raise stamps.fault(
            f"time runs backwards{where}: {t[at]:.9g} s after {t[at - 1]:.9g} s; {remedy}",
            at,
        )
    if t[-1] == t[0]:
        raise stamps.fault("time stands still", len(t) - 1)
    usual = float(np.median(steps[steps > 0]))
    counts = np.rint(steps / usual).astype(np.intp)
    twice = (steps == 0) & stamps.repeated
    other = (steps == 0) & ~stamps.repeated
    whole = np.abs(steps - counts * usual) <= READING.max_jitter * usual
    possible = (counts == 1) | (counts == 2) | twice
    few = max(int((counts > 1).sum()), int(twice.sum())) <= repairs_allowed(t.size)
    odd = np.abs(steps - usual) > READING.max_uneven * usual
    nearly = int((~whole).sum()) <= repairs_allowed(t.size) and bool((whole | ~odd).all())
    if nearly and possible.all() and few:
        return _grid_with_lost_samples(stamps, counts)
    # Few repeated stamps among equal steps are rows too many, and not a time that was rounded.
    if whole.all() and (possible | other).all() and 0 < int(other.sum()) <= repairs_allowed(t.size):
        _refuse_stamps(stamps, counts, whole, usual)
    return _grid_of_rounded_time(t) or _grid_between(t, usual) or _refuse_stamps(stamps, counts, whole, usual)


def _grid_between(t: Array, usual: float) -> UniformGrid | None:
    """Return a grid to interpolate on, or None if the steps differ too much."""
    steps = np.diff(t)
    least, largest = (1.0 - READING.max_uneven) * usual, (1.0 + READING.max_uneven) * usual
    if steps.min() < least or (steps > largest).sum() > repairs_allowed(t.size):
        return None
    dt = float(f"{(t[-1] - t[0]) / (t.size - 1):.3g}")
    points = int(np.floor((t[-1] - t[0]) / dt * (1.0 + 1e-12))) + 1
    note = f"time steps from {steps.min():.4g} to {steps.max():.4g} s: channels are interpolated every {dt:.4g} s"
    return UniformGrid(float(t[0]), dt, np.arange(points), (note,), between=True)


def _grid_with_lost_samples(stamps: Stamps, counts: Indices) -> UniformGrid:
    """Return the grid of stamps whose steps are whole multiples of an interval."""
    t = stamps.t
    index = np.concatenate([np.zeros(1, np.intp), np.cumsum(counts)])
    dt = interval(float(t[0]), float(t[-1]), int(index[-1]), slack=READING.noted_jitter)
    notes = []
    if (counts == 0).any():
        twice = stamps.rows[1:][counts == 0]
        notes.append(f"{list_rows(twice)} repeated the one before, time stamp and all: left out")
    if (counts == 2).any():
        after = stamps.rows[1:][counts == 2]
        notes.append(f"a sample is missing before {list_rows(after)}: interpolated")
    jitter = float(np.abs(np.diff(t) / dt - counts).max())
    if jitter > READING.noted_jitter:
        notes.append(f"time steps jitter by up to {100 * jitter:.2g} % of the interval: read as uniform")
    wander = float(np.abs(t - t[0] - dt * index).max()) / dt
    if wander > 0.5:
        notes.append(f"time wanders by up to {wander:.2g} intervals off a uniform one: read as uniform")
    return UniformGrid(float(t[0]), dt, index, tuple(notes))


def _grid_of_rounded_time(t: Array) -> UniformGrid | None:
    """Return the grid of a uniform time that was rounded to a coarse last digit, or None if it was not."""
    n = t.size
    k = np.arange(n)
    slope, start = (float(c) for c in np.polyfit(k, t - t[0], 1))
    deviation = float(np.abs(t - t[0] - start - slope * k).max())
    digits = (10.0**-e for e in range(10))
    last = next((r for r in digits if np.abs(t / r - np.rint(t / r)).max() < 1e-3), 0.0)
    # Rounding moves a stamp by half a digit at most. A digit of more than two intervals could hide any fault.
    if not deviation <= 0.6 * last <= 1.2 * slope:
        return None
    dt = interval(0.0, slope * (n - 1), n - 1, slack=0.25 * last / slope)
    note = f"time is rounded to {last:g} s: read as uniform with an interval of {dt:.9g} s"
    return UniformGrid(float(t[0]), dt, k.astype(np.intp), (note,))


def _refuse_stamps(stamps: Stamps, counts: Indices, whole: NDArray[np.bool_], usual: float) -> NoReturn:
    """Raise the error for stamps that fit no uniform grid."""
    t, steps = stamps.t, np.diff(stamps.t)
    if (steps == 0).any():
        at = int(np.argmax(steps == 0)) + 1
        if int((steps == 0).sum()) > repairs_allowed(t.size):
            remedy = "the time is too coarse: give the interval by --dt if it is known"
        else:
            remedy = "leave one of the rows out, or give the interval by --dt instead of the time if it is known"
        raise stamps.fault(f"time {t[at]:.9g} s is repeated with other values; {remedy}", at)
    if not whole.all():
        at = int(np.argmax(np.abs(steps - usual) > READING.max_uneven * usual)) + 1
        raise stamps.fault(
            f"time steps by {steps[at - 1]:.6g} s where {usual:.6g} s is usual; steps may differ by"
            f" {100 * READING.max_uneven:g} % at most (cut the recording with a window)",
            at,
        )
    if (counts > 2).any():
        at = int(np.argmax(counts > 2)) + 1
        raise stamps.fault(
            f"{counts[at - 1] - 1} samples in a row are missing before this one; only single ones are"
            " interpolated (cut the recording with a window)",
            at,
        )
    at = int(np.argmax(counts > 1)) + 1
    raise stamps.fault(
        f"{int((counts > 1).sum())} samples are missing, the first one before this one; at most"
        f" {repairs_allowed(t.size)} are interpolated (cut the recording with a window)",
        at,
    )
