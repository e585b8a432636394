"""Inspection of a file: what is in it, what each channel might be, and the command that would identify it."""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.arguments import checked_arguments
from brightgrey.arrays import Array
from brightgrey.errors import BrightgreyError
from brightgrey.notebook_html import sparkline, table
from brightgrey.recordings import read_recording
from brightgrey.recordings.file import open_table
from brightgrey.recordings.formats.table import Column, Table
from brightgrey.recordings.inspection.meaning import Meaning, meaning_of
from brightgrey.recordings.inspection.profile import ChannelProfile, profile_channels
from brightgrey.recordings.inspection.relations import find_derivatives, find_setpoints, is_count
from brightgrey.recordings.inspection.suggestion import (
    ReadChannels,
    Suggestion,
    TimeChoice,
    find_time,
    suggest,
    usual_step,
)
from brightgrey.recordings.policy import READING

__all__ = ["Inspection", "inspect"]


@dataclass(frozen=True)
class Inspection:
    """Content of a file, by :func:`inspect`.

    Attributes
    ----------
    path : str
    format : str
        Name of the format.
    samples : int
        Rows of the file.
    channels : tuple of ChannelProfile
        Name, unit, step in s (``dt``), range, missing and held samples of each channel.
    meanings : tuple of Meaning
        What each channel might be, with the reason.
    command : str
        Command line that identifies the file; empty if `problem` says why there is none.
    options : mapping
        The same as arguments of :func:`read_recording`.
    why : tuple of str
        Reasons for the choice of input and output.
    questions : tuple of str
        What the file does not say, each with the option that says it.
    notes : tuple of str
        Findings and repairs of the reader, with the channels of the command.
    problem : str
        Reason why there is no command.
    """

    path: str
    format: str
    samples: int
    channels: tuple[ChannelProfile, ...] = field(repr=False)
    meanings: tuple[Meaning, ...] = field(repr=False)
    command: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    why: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    problem: str = ""

    def rows(self) -> list[tuple[str, ...]]:
        """Return a row of texts for each channel: name, unit, step, range, holes, meaning and reason."""
        return [_row(channel, meaning) for channel, meaning in zip(self.channels, self.meanings, strict=True)]

    def _repr_html_(self) -> str:
        header = ("Channel", "Unit", "Every", "Range", "Missing", "Might be", "Reason", "Over time")
        drawn = [sparkline(c.course) if np.isfinite(c.course).any() else "" for c in self.channels]
        rows = [(*row, line) for row, line in zip(self.rows(), drawn, strict=True)]
        said = "".join(f"<li>{html.escape(text)}</li>" for text in (*self.why, *self.questions, *self.notes))
        end = f"<pre>{html.escape(self.command)}</pre>" if self.command else f"<p>{html.escape(self.problem)}</p>"
        title = f"<b>{html.escape(Path(self.path).name)}</b>: {html.escape(self.format)}, {self.samples} samples"
        return f"<div><p>{title}</p>{table(header, rows)}<ul>{said}</ul>{end}</div>"


HEADER = ("channel", "unit", "every", "range", "missing", "might be", "reason")
"""Of `Inspection.rows`."""


@checked_arguments
def inspect(path: str | Path) -> Inspection:
    """Look into a file: its channels, what each might be, and the command that would identify the drive.

    Names, units and the numbers themselves are looked at. One channel may be the derivative of another, a smoother one
    its setpoint, and a motion explains the torque that drives it. All of it is a guess that gives its reason.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Inspection
        A notebook shows it as a table.

    Raises
    ------
    RecordingError
        If there is no such file, or it cannot be read.
    """
    opened, title = open_table(path)
    profiles, values = profile_channels(opened)
    time = find_time(opened, values)
    channels = _with_meanings(opened, profiles, values, time)
    inspection = Inspection(
        str(path),
        title,
        int(opened.rows.size),
        tuple(channels.profiles.values()),
        tuple(channels.meanings.values()),
        notes=opened.notes,
    )
    suggested = suggest(channels, time)
    del opened, profiles, values, channels  # the file is read again below: a large one has no room twice
    if isinstance(suggested, str):
        return replace(inspection, problem=suggested)
    return _tried(inspection, suggested)


def _tried(inspection: Inspection, suggested: Suggestion) -> Inspection:
    """Return the inspection with the command, if the file can be read with its options."""
    inspection = replace(inspection, options=suggested.options, why=suggested.why, questions=suggested.questions)
    try:
        recording = read_recording(inspection.path, **suggested.options)
    except BrightgreyError as error:
        return replace(inspection, problem=str(error))
    return replace(inspection, command=suggested.command(inspection.path), notes=recording.notes)


def _with_meanings(
    opened: Table, profiles: list[ChannelProfile], values: Mapping[int, Array], time: TimeChoice
) -> ReadChannels:
    """Return the channels with what unit, name and numbers say about them."""
    names = {p.column: p.name for p in profiles}
    meanings = {p.column: _meaning(opened.columns[p.column]) for p in profiles}
    if not any(meaning.quantity for meaning in meanings.values()):
        whole = meaning_of(Path(opened.name).stem, None)
        said = replace(whole, reason="the name of the file says so" if whole.quantity else "")
        meanings = dict.fromkeys(meanings, said)
    times = {c.clock for c in opened.columns if c.clock is not None} | {time.column}
    counters = [p.column for p in profiles if p.column in values and is_count(values[p.column])]
    for i in meanings.keys() & times:
        meanings[i] = Meaning("time", reason="its name or its even steps")
    for i in counters:
        meanings.setdefault(i, Meaning())
        if meanings[i].quantity != "time":
            meanings[i] = Meaning("count", reason="it rises by one from row to row")
    steps = {p.column: _own_step(opened, p.column, values, time) for p in profiles}
    profiles = [replace(p, dt=steps[p.column]) for p in profiles]
    known = ("time", "count")
    changing = {
        p.column: values[p.column] for p in profiles if not p.constant and meanings[p.column].quantity not in known
    }
    compared = {i: x for i, x in changing.items() if opened.columns[i].clock is None}
    find_derivatives(compared, meanings, names, time.dt)
    find_setpoints(changing, meanings, names)
    return ReadChannels(opened, {p.column: p for p in profiles}, values, meanings)


def _meaning(column: Column) -> Meaning:
    """Return what a column's unit and name say, or else its label."""
    said = meaning_of(column.name, column.unit)
    if said.quantity or column.header == column.name:
        return said
    labelled = meaning_of(column.header, column.unit)
    return replace(labelled, reason=labelled.reason.replace("its name", "its label"))


def _own_step(opened: Table, column: int, values: Mapping[int, Array], time: TimeChoice) -> float | None:
    """Return the usual step of a channel in s, None if the file holds no time."""
    if column == time.column or "dt" in time.options:
        return None
    clock = opened.columns[column].clock
    present = np.isfinite(values[column]) if column in values and values[column].size else np.ones(1, bool)
    if clock is None and time.column is not None and present.mean() < 1.0 - READING.merged:
        return usual_step(opened, time.column, {time.column: values[time.column][present]})
    if clock is None:
        return time.dt
    return usual_step(opened, clock, values) if clock in values else None


def _row(channel: ChannelProfile, meaning: Meaning) -> tuple[str, ...]:
    """Return the texts of one channel."""
    if channel.text:
        fault = channel.text.partition(": ")[2] if channel.begins_with_number else ""
        return (channel.name, channel.unit or "", "", "text", "", "", fault)
    step = f"{1e3 * channel.dt:.4g} ms" if channel.dt else ""
    span = f"{channel.low:.4g} .. {channel.high:.4g}" if channel.samples else "empty"
    holes = f"{channel.missing}" if channel.missing else ""
    if channel.held > 0.1 and not channel.constant:
        holes = ", ".join(part for part in (holes, f"{100 * channel.held:.0f} % held") if part)
    words = "never changes" if channel.constant else meaning.words()
    return (channel.name, channel.unit or "", step, span, holes, words, meaning.reason)
