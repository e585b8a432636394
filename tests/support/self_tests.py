"""A small identification with a search, for the self-test of its result."""

import functools

from brightgrey import identify, read_recording
from support.small_runs import recording_csv

EFFECTS = ("one_mass", "coulomb", "viscous", "gravity")
LEFT_OUT = ("two_mass", "three_mass", "four_mass", "stribeck", "backlash", "current_control", "delay")
SEARCH = {"grammar": "paper", "require": ("one_mass",), "exclude": LEFT_OUT}


def read_small(path):
    """Recording of :func:`support.small_runs.recording_csv`."""
    return read_recording(path, input="torque", outputs=["velocity:velocity"])


@functools.cache
def small_result(folder, **values):
    """Result of a search among four effects, on a recording that `folder` receives."""
    path = folder / "drive.csv"
    path.write_text(recording_csv(**values))
    return identify(read_small(path), **SEARCH)
