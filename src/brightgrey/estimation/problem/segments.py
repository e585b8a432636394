"""Segments of a residual vector: one output of one recording each.

Residuals are stacked recording by recording, and output by output within a recording. Residuals are correlated within a
segment and independent between segments.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings import Recording

__all__ = ["Segment", "segment_lengths", "segments", "split_recordings", "split_segments"]


class Segment(NamedTuple):
    """One output of one recording."""

    rows: slice  #: Its part of the residual vector.
    recording: Recording
    output: int  #: Index of the output in the recording.


def segments(recordings: Sequence[Recording]) -> Iterator[Segment]:
    """Iterate over all segments in the order of the residual vector."""
    first = 0
    for recording in recordings:
        for output in range(len(recording.outputs)):
            yield Segment(slice(first, first + recording.samples), recording, output)
            first += recording.samples


def segment_lengths(recordings: Sequence[Recording]) -> list[int]:
    """Samples of each segment."""
    return [segment.recording.samples for segment in segments(recordings)]


def split_segments(rows: Array, lengths: Sequence[int]) -> list[Array]:
    """Split an array, shape (residuals, ...), into its segments, shapes (samples, ...)."""
    return np.split(rows, np.cumsum(lengths)[:-1])


def split_recordings(residual: Array, recordings: Sequence[Recording]) -> Iterator[tuple[Recording, Array]]:
    """Iterate over the recordings, each with its residuals, shape (outputs, samples)."""
    first = 0
    for recording in recordings:
        yield recording, residual[first : first + recording.y.size].reshape(recording.y.shape)
        first += recording.y.size
