"""Recordings: time, input and motion of a drive, read and checked once, in coherent SI."""

from brightgrey.recordings.cut import decimate, window
from brightgrey.recordings.read import read_recording, recording_from
from brightgrey.recordings.recording import Recording, Signal
from brightgrey.recordings.units import Units

__all__ = ["Recording", "Signal", "Units", "decimate", "read_recording", "recording_from", "window"]
