"""From the time stamps of a file to a uniform time, with every repair told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array, Indices
from brightgrey.errors import RecordingError
from brightgrey.recordings.formats.table import Table, tell_rows
from brightgrey.recordings.recording import interval

__all__ = ["JITTER", "REPAIRED", "Grid", "Stamps", "repairs_allowed", "uniform"]


# Time steps may be off by this share of the interval; they are then read as uniform.
JITTER = 0.1
# Jitter above this share of the interval is worth a note.
NOTABLE = 0.01
# No more than this share of the samples (or one) is made up or left out.
REPAIRED = 0.01


@dataclass(frozen=True)
class Stamps:
    """Time stamps as they stand in a file.

    Attributes
    ----------
    t : ndarray, shape (samples,)
        In s, finite.
    twin : ndarray of bool, shape (samples - 1,)
        Samples, from the second on, all of whose values equal those of the sample before.
    rows : ndarray of int, shape (samples,)
        Row of the file of each.
    table : Table
    column : str
        Name of the time's column.
    """

    t: Array
    twin: NDArray[np.bool_]
    rows: Indices
    table: Table
    column: str

    def fault(self, text: str, sample: int) -> RecordingError:
        """Error at a sample."""
        return self.table.fault(text, column=self.column, row=int(self.rows[sample]))


@dataclass(frozen=True)
class Grid:
    """Uniform time that the samples of a file stand on.

    Attributes
    ----------
    start, dt : float
        First time and interval in s.
    index : ndarray of int, shape (samples,)
        Point of the grid of every sample; points without a sample were lost.
    notes : tuple of str
    """

    start: float
    dt: float
    index: Indices
    notes: tuple[str, ...] = ()


def repairs_allowed(samples: int) -> int:
    """How many of so many samples may be made up or left out."""
    return max(1, int(REPAIRED * samples))


def uniform(stamps: Stamps) -> Grid:
    """Put time stamps on a uniform grid.

    Accepted, in this order: equal intervals within `JITTER`, where single samples may be lost (their points
    are left empty, for interpolation) or written twice; stamps that a uniform time gives if it is rounded to
    the last digit that they are written with.

    Parameters
    ----------
    stamps : Stamps
        Two at least.

    Returns
    -------
    Grid

    Raises
    ------
    RecordingError
        If time runs backwards or its steps are not equal; names the row.
    """
    t = stamps.t
    steps = np.diff(t)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0)) + 1
        raise stamps.fault(f"time runs backwards: {t[at]:.9g} s after {t[at - 1]:.9g} s", at)
    if t[-1] == t[0]:
        raise stamps.fault("time stands still", len(t) - 1)
    usual = float(np.median(steps[steps > 0]))
    counts = np.rint(steps / usual).astype(np.intp)
    twice = (steps == 0) & stamps.twin
    whole = np.abs(steps - counts * usual) <= JITTER * usual
    possible = (counts == 1) | (counts == 2) | twice
    few = max(int((counts > 1).sum()), int(twice.sum())) <= repairs_allowed(t.size)
    if whole.all() and possible.all() and few:
        return _counted(stamps, counts)
    return _rounded(t) or _refuse(stamps, counts, whole, usual)


def _counted(stamps: Stamps, counts: Indices) -> Grid:
    """Grid for stamps whose steps are whole multiples of an interval."""
    t = stamps.t
    index = np.concatenate([np.zeros(1, np.intp), np.cumsum(counts)])
    dt = interval(float(t[0]), float(t[-1]), int(index[-1]), slack=NOTABLE)
    notes = []
    if (counts == 0).any():
        twice = stamps.rows[1:][counts == 0]
        notes.append(f"{tell_rows(twice)} repeated the one before, time stamp and all: left out")
    if (counts == 2).any():
        after = stamps.rows[1:][counts == 2]
        notes.append(f"a sample is missing before {tell_rows(after)}: interpolated")
    jitter = float(np.abs(np.diff(t) / dt - counts).max())
    if jitter > NOTABLE:
        notes.append(f"time steps jitter by up to {100 * jitter:.2g} % of the interval: read as uniform")
    wander = float(np.abs(t - t[0] - dt * index).max()) / dt
    if wander > 0.5:
        notes.append(f"time wanders by up to {wander:.2g} intervals off a uniform one: read as uniform")
    return Grid(float(t[0]), dt, index, tuple(notes))


def _rounded(t: Array) -> Grid | None:
    """Grid for stamps that are a uniform time rounded to a coarse last digit, or None if they are not."""
    n = t.size
    k = np.arange(n)
    slope, start = (float(c) for c in np.polyfit(k, t - t[0], 1))
    deviation = float(np.abs(t - t[0] - start - slope * k).max())
    digits = (10.0**-e for e in range(10))
    last = next((r for r in digits if np.abs(t / r - np.rint(t / r)).max() < 1e-3), 0.0)
    # Rounding moves a stamp by half a digit at most; a digit of more than two intervals could hide anything.
    if not deviation <= 0.6 * last <= 1.2 * slope:
        return None
    dt = interval(0.0, slope * (n - 1), n - 1, slack=0.25 * last / slope)
    note = f"time is rounded to {last:g} s: read as uniform with an interval of {dt:.9g} s"
    return Grid(float(t[0]), dt, k.astype(np.intp), (note,))


def _refuse(stamps: Stamps, counts: Indices, whole: NDArray[np.bool_], usual: float) -> NoReturn:
    """Raise the error that fits stamps which stand on no uniform grid."""
    t, steps = stamps.t, np.diff(stamps.t)
    if (steps == 0).any():
        at = int(np.argmax(steps == 0)) + 1
        raise stamps.fault(
            f"time {t[at]:.9g} s is repeated; if the sampling interval is known, give it instead of the time",
            at,
        )
    if not whole.all():
        at = int(np.argmax(~whole)) + 1
        raise stamps.fault(
            f"time steps by {steps[at - 1]:.6g} s where {usual:.6g} s is usual; steps must be equal within"
            f" {100 * JITTER:g} % (resample the recording, or cut it with a window)",
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
