"""The demo: the paper's experiment on the recording that ships with the package."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from brightgrey.api.identification import identify
from brightgrey.api.result import Result
from brightgrey.excitation import demo_recording
from brightgrey.recordings import read_recording
from brightgrey.search.genetic import Progress
from brightgrey.search.progress import SearchProgress

__all__ = ["demo"]

FILE = "recording.csv"


def demo(
    *, seed: int = 0, workers: int = 1, progress: Callable[[SearchProgress | Progress], None] | None = None
) -> Result:
    """Identify the drive of the shipped recording; the result's files hold the recording, too.

    A simulated two-mass drive, moved forth and back for about 2 s, with noise. All structures are tried on it.

    Parameters
    ----------
    seed : int
        Seed of all random draws.
    workers : int
        Threads to simulate on.
    progress : callable, optional
        Called after every structure.

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
    if recording.source is not None:  # beside the results, not in the folder that is gone
        recording = replace(recording, source=replace(recording.source, path=FILE))
    result = identify(recording, seed=seed, workers=workers, progress=progress)
    return replace(result, files={**result.files, FILE: content})
