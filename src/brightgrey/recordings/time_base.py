"""From the time stamps of a file to a uniform time, with a note on every repair."""

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

__all__ = ["Stamps", "UniformGrid", "repairs_allowed", "uniform_grid"]


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


def repairs_allowed(samples: int) -> int:
    """Return the number of samples, of so many, that may be interpolated or left out."""
    return max(1, int(READING.max_repaired * samples))


def uniform_grid(stamps: Stamps) -> UniformGrid:
    """Put time stamps on a uniform grid.

    Two kinds of stamps are accepted. The first are equal intervals within `READING.max_jitter`, where single samples
    may be lost or written twice. Lost samples leave an empty point for interpolation. The second are stamps of a
    uniform time that was rounded to the last digit they are written with.

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
        raise stamps.fault(f"time runs backwards: {t[at]:.9g} s after {t[at - 1]:.9g} s", at)
    if t[-1] == t[0]:
        raise stamps.fault("time stands still", len(t) - 1)
    usual = float(np.median(steps[steps > 0]))
    counts = np.rint(steps / usual).astype(np.intp)
    twice = (steps == 0) & stamps.repeated
    whole = np.abs(steps - counts * usual) <= READING.max_jitter * usual
    possible = (counts == 1) | (counts == 2) | twice
    few = max(int((counts > 1).sum()), int(twice.sum())) <= repairs_allowed(t.size)
    if whole.all() and possible.all() and few:
        return _grid_with_lost_samples(stamps, counts)
    return _grid_of_rounded_time(t) or _refuse_stamps(stamps, counts, whole, usual)


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
        raise stamps.fault(
            f"time {t[at]:.9g} s is repeated; if the sampling interval is known, give it instead of the time",
            at,
        )
    if not whole.all():
        at = int(np.argmax(~whole)) + 1
        raise stamps.fault(
            f"time steps by {steps[at - 1]:.6g} s where {usual:.6g} s is usual; steps must be equal within"
            f" {100 * READING.max_jitter:g} % (resample the recording, or cut it with a window)",
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
