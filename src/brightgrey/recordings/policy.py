"""Limits of reading a recording: what is accepted, what is repaired, and what is noted."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["READING", "ReadingPolicy"]


@dataclass(frozen=True)
class ReadingPolicy:
    """Limits that decide how a recording is read."""

    min_samples: int = 20
    """Smallest number of samples. With fewer samples even one mass with friction looks like noise."""
    max_jitter: float = 0.1
    """Largest deviation of a time step, as a part of the interval, that is read as uniform."""
    noted_jitter: float = 0.01
    """Deviation of a time step, as a part of the interval, from which a note is written."""
    max_repaired: float = 0.01
    """Largest part of the samples (but at least one sample) that may be interpolated or left out."""
    window_slack: float = 0.01
    """Part of an interval by which a sample may lie outside of a window, because time stamps are rounded."""
    coarse_levels: int = 500
    """A velocity with fewer levels than this between its extremes looks like encoder counts per interval."""
    sampled_lines: int = 200
    """Lines of a text file that are looked at to find delimiter, decimal mark and the columns of numbers."""
    max_matrix_columns: int = 64
    """A matrix with more columns than this, and more rows, is not read as a table."""
    listed_columns: int = 30
    """Column names that one error message lists."""


READING = ReadingPolicy()
"""The limits that every reader uses."""
