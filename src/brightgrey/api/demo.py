"""The demo: the paper's experiment on the recording that ships with the package."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from brightgrey.api.identification import Result, identify
from brightgrey.excitation import PAPER_EXPERIMENT, demo_recording
from brightgrey.recordings import read_recording

__all__ = ["demo"]

FILE = "recording.csv"


def demo(*, seed: int = 0, workers: int = 1) -> Result:
    """Identify the drive of the shipped recording; the result's files hold the recording, too.

    A simulated two-mass drive, moved forth and back for about 2 s, with noise. Until there is a search it is
    told the true structure.

    Parameters
    ----------
    seed : int
        Seed of all random draws.
    workers : int
        Threads to simulate on.

    Returns
    -------
    Result
    """
    content = demo_recording().encode()
    with TemporaryDirectory() as folder:  # so that it takes the way of every user's file
        path = Path(folder) / FILE
        path.write_bytes(content)
        recording = read_recording(
            path,
            input="torque",
            outputs=["velocity:velocity"],
            time="t",
            units={"t": "s", "torque": "N m", "velocity": "rad/s"},
        )
    result = identify(recording, PAPER_EXPERIMENT.structure, seed=seed, workers=workers)
    return replace(result, files={FILE: content})
