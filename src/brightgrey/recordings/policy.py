"""Limits of reading a recording: what is accepted, what is repaired, and what is noted."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["INSPECTION", "READING", "InspectionPolicy", "ReadingPolicy"]


@dataclass(frozen=True)
class ReadingPolicy:
    """Limits that decide how a recording is read."""

    min_samples: int = 20
    """Smallest number of samples. With fewer samples even one mass with friction looks like noise."""
    max_jitter: float = 0.1
    """Largest deviation of a time step, as a part of the interval, that is read as uniform."""
    noted_jitter: float = 0.01
    """Deviation of a time step, as a part of the interval, from which a note is written."""
    max_uneven: float = 0.5
    """Largest deviation of a time step, as a part of the interval, from which channels are interpolated evenly."""
    hole: float = 2.5
    """Smallest time step, in intervals, that is a hole: the recording is cut there."""
    least_stretch: float = 0.5
    """Smallest part of the samples that the longest stretch between two holes must have."""
    least_part: float = 0.02
    """Smallest part of the samples that a stretch between two holes must have to be read as a recording of its own; a
    shorter one tells little more than its own initial state."""
    absurd: float = 1e30
    """Size of a number, in the unit of its column and in SI, that no sensor measures. The inverse bounds the largest
    value of a channel from below, and both bound the sampling interval in s."""
    negative_speed: float = 0.1
    """Part of its largest value by which the noise of a speed without sign may make it negative."""
    max_repaired: float = 0.01
    """Largest part of the samples (but at least one sample) that may be interpolated or left out."""
    window_slack: float = 0.01
    """Part of an interval by which a sample may lie outside of a window, because time stamps are rounded."""
    merged: float = 1.0 / 3.0
    """Part of the rows without a value from which a channel has its own clock, in a list that was merged by time."""
    many_samples: int = 50_000
    """Number of samples from which decimation is suggested."""
    enough_samples: int = 20_000
    """Number of samples that a suggested decimation leaves at most."""
    coarse_levels: int = 500
    """A velocity with fewer levels than this between its extremes looks like encoder counts per interval."""
    sampled_lines: int = 200
    """Lines of a text file that are looked at to find delimiter, decimal mark and the columns of numbers."""
    head_lines: int = 2000
    """Lines of a text file within which the numbers must begin."""
    preamble_lines: int = 100
    """Lines of a text file among which the names of the columns are looked for."""
    footer_lines: int = 10
    """Lines of remarks below the numbers of a text file that are left out."""
    lines_per_block: int = 1 << 16
    """Lines of a text file that are strings at one time."""
    least_expansion: int = 1 << 26
    """Bytes that any compressed file may expand to."""
    max_expansion: int = 50
    """Bytes that a compressed file may expand to, for each of its own."""
    max_matrix_columns: int = 64
    """A matrix with more columns than this, and more rows, is not read as a table."""
    listed_columns: int = 30
    """Column names that one error message lists."""
    first_bytes: int = 1 << 16
    """Bytes of a file by which its format is recognised."""
    bytes_per_block: int = 1 << 20
    """Bytes of a text file that are decoded at one time."""
    longest_number: int = 400
    """Characters of a field from which it is no number: 1e308 with all its digits and some decimals is shorter."""
    longest_header: int = 1000
    """Characters of a column's header from which no unit is looked for in it."""
    longest_statement: int = 200
    """Characters of a line from which it states no sampling interval."""
    longest_remark: int = 300
    """Characters of a remark or an error of a library for a file format that are shown."""
    most_remarks: int = 3
    """Remarks of such a library that are shown."""
    many_levels: int = 10
    """Levels of a channel of whole numbers that show a factor beyond chance."""


READING = ReadingPolicy()
"""The limits that every reader uses."""


@dataclass(frozen=True)
class InspectionPolicy:
    """Numbers by which channels of an unknown file are compared and proposed."""

    drawn: int = 720
    """Points of a course that are kept for drawing."""
    most_columns: int = 500
    """Columns of a file that are profiled; a file with more is no recording of a drive."""
    points: int = 2000
    """Points that a channel is averaged to before channels are compared."""
    compared: int = 60
    """Channels that are compared with each other."""
    derivative: float = 0.95
    """Correlation from which one channel is the derivative of another."""
    same: float = 0.98
    """Correlation from which two channels are setpoint and actual value of one quantity."""
    delayed: float = 0.7
    """Correlation of the difference of two channels with their slope from which one is the other, delayed."""
    smoother: float = 0.5
    """Noise of a setpoint, as a part of that of the actual value."""
    tried: int = 40
    """Inputs, and outputs, whose pairs are compared."""
    nearly: float = 0.9
    """Part of the best explanation from which a pair of channels is as good."""
    left_alike: float = 2.0
    """Ratio of what like sensors leave unexplained up to which the first is the output."""


INSPECTION = InspectionPolicy()
"""The numbers that every inspection uses."""
