"""Recordings: time, input and motion of a drive, read and checked once, in coherent SI."""

from brightgrey.recordings.read import read_recording, read_stretches, recording_from
from brightgrey.recordings.recording import Recording, Signal
from brightgrey.recordings.units.signals import Units
from brightgrey.recordings.window import cut_window, decimate

__all__ = [
    "Recording",
    "Signal",
    "Units",
    "cut_window",
    "decimate",
    "read_recording",
    "read_stretches",
    "recording_from",
]
