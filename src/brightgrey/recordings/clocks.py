"""Channels with clocks of their own, put onto one clock.

The rules:

1. The clock is that of the slowest output, over the time that all channels share.
2. An input that is sampled faster is replaced by what drives a model alike. These are the least-squares straight lines
   between the instants of the clock, or with zero-order hold its mean over each interval.
3. All other channels are interpolated, an input with zero-order hold by its last value.

The cost is told with each: what the new samples cannot show of the old ones, as a part of their standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError
from brightgrey.recordings.recording import Hold

__all__ = ["Channel", "onto_one_clock", "resampling_error", "straight_lines"]


@dataclass(frozen=True)
class Channel:
    """Samples of one channel on a uniform time."""

    name: str
    start: float  #: First time in s.
    dt: float
    values: Array  #: Shape (samples,), finite.

    @property
    def end(self) -> float:
        """Last time in s."""
        return self.start + self.dt * (self.values.size - 1)

    @property
    def t(self) -> Array:
        """Times in s, shape (samples,)."""
        return self.start + self.dt * np.arange(self.values.size, dtype=np.float64)


def onto_one_clock(channels: Sequence[Channel], hold: Hold, file: str) -> tuple[Array, Array, list[str]]:
    """Put channels onto the clock of the slowest output.

    Parameters
    ----------
    channels : sequence of Channel
        Input first.
    hold : {'linear', 'zoh'}
        Course of the input between its samples.
    file : str
        For the message.

    Returns
    -------
    t : ndarray, shape (samples,)
    values : ndarray, shape (channels, samples)
    notes : list of str

    Raises
    ------
    RecordingError
        If the channels have no time in common.
    """
    first = channels[0]
    if all((c.start, c.dt, c.values.size) == (first.start, first.dt, first.values.size) for c in channels):
        return first.t, np.array([channel.values for channel in channels]), []
    clock = max(channels[1:], key=lambda channel: channel.dt)
    slack = 1e-6 * clock.dt
    begin, end = max(c.start for c in channels) - slack, min(c.end for c in channels) + slack
    kept = (clock.t >= begin) & (clock.t <= end)
    if not kept.any():
        spans = ", ".join(f"'{c.name}' from {c.start:.6g} to {c.end:.6g} s" for c in channels)
        raise RecordingError(f"{file}: the channels have no time in common: {spans}")
    t = clock.t[kept]
    values, notes = np.empty((len(channels), t.size)), []
    if not kept.all():
        notes.append(f"only the time that all channels share is read, from {t[0]:.6g} to {t[-1]:.6g} s")
    for row, channel in enumerate(channels):
        values[row], way, cost = _resampled(channel, t, clock.dt, "output" if row else hold)
        if way:
            notes.append(
                f"'{channel.name}', sampled every {channel.dt:.4g} s, is {way} at the {clock.dt:.4g} s of"
                f" '{clock.name}', which costs {100 * cost:.2g} % of its standard deviation"
            )
    return t, values, notes


def _resampled(channel: Channel, t: Array, dt: float, hold: str) -> tuple[Array, str, float]:
    """Return a channel at the times `t`, in words how it came there, and its cost; no words where nothing changed."""
    old, x = channel.t, channel.values
    nearest = np.clip(np.rint((t - channel.start) / channel.dt).astype(np.intp), 0, x.size - 1)
    aligned = bool(np.abs(old[nearest] - t).max() <= 1e-3 * channel.dt)
    faster = channel.dt < 0.75 * dt
    if aligned and (not faster or hold == "output"):
        # An output is compared at its instants, and a filter would act on the measurement only.
        return x[nearest], "picked" if faster else "", 0.0
    if faster and hold == "linear":
        values = straight_lines(old, x, t)
        within = (old >= t[0]) & (old <= t[-1])
        return values, "replaced by straight lines", _relative(x[within] - np.interp(old[within], t, values), x)
    if faster and hold == "zoh":
        sums = np.concatenate([[0.0], np.cumsum(x) * channel.dt])
        integral = np.interp(np.append(t, t[-1] + dt), np.append(old, old[-1] + channel.dt), sums)
        values = np.diff(integral) / dt
        held = values[np.clip(np.searchsorted(t, old, side="right") - 1, 0, t.size - 1)]
        return values, "averaged", _relative((x - held)[(old >= t[0]) & (old < t[-1])], x)
    if hold == "zoh":
        last = np.clip(np.searchsorted(old, t + 1e-6 * dt, side="right") - 1, 0, x.size - 1)
        return x[last], "held", _relative(np.diff(x) * (channel.dt % dt > 1e-6 * dt), x)
    return np.asarray(np.interp(t, old, x)), "interpolated", resampling_error(old, x)


def resampling_error(t: Array, x: Array) -> float:
    """Root mean square error of linear interpolation halfway between samples, as a part of the standard deviation.

    Each sample is predicted from its two neighbours. The error of a straight line grows with the square of its length,
    so that over a single step it is a quarter of that.
    """
    if x.size < 3:
        return 0.0
    part = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    return 0.25 * _relative(x[1:-1] - (1.0 - part) * x[:-2] - part * x[2:], x)


def straight_lines(old: Array, x: Array, t: Array) -> Array:
    """Return the values at the times `t` whose straight lines come nearest to the samples `x` at the times `old`."""
    import scipy.linalg  # slow to import, and rarely needed

    within = (old >= t[0]) & (old <= t[-1])
    at = np.clip(np.searchsorted(t, old[within], side="right") - 1, 0, t.size - 2)
    part = (old[within] - t[at]) / (t[at + 1] - t[at])
    bands = np.zeros((2, t.size))
    right = np.zeros(t.size)
    for offset, weight in ((0, 1.0 - part), (1, part)):
        np.add.at(bands[1], at + offset, weight**2)
        np.add.at(right, at + offset, weight * x[within])
    np.add.at(bands[0], at + 1, part * (1.0 - part))
    ridge = 1e-6 * bands[1].max()  # few samples in an interval leave its ends open: they follow the samples then
    bands[1] += ridge
    right += ridge * np.interp(t, old, x)
    return np.asarray(scipy.linalg.solveh_banded(bands, right))


def _relative(error: Array, x: Array) -> float:
    """Root mean square of an error as a part of the standard deviation of `x`; 0 for a constant."""
    spread = float(np.std(x))
    return float(np.sqrt(np.mean(error**2))) / spread if spread > 0 and error.size else 0.0
