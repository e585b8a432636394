"""Recordings and task of an identification that was written into a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from brightgrey.api.to_si import identification_task
from brightgrey.errors import RecordingError
from brightgrey.estimation import settings_for
from brightgrey.model.run_record import RecordingPart, RunRecord
from brightgrey.recordings import Recording
from brightgrey.recordings.read import read_again
from brightgrey.recordings.recording import Source
from brightgrey.search import IdentificationTask

__all__ = ["recording_of_run", "task_of_run"]


def recording_of_run(part: RecordingPart, folder: Path, base: Path | None = None) -> Recording:
    """Read a recording of a run, from where it was or from the folder of the run.

    Parameters
    ----------
    part : RecordingPart
    folder : Path
        Of the run.
    base : Path, optional
        Folder that the path of the recording is relative to; the current one by default.

    Raises
    ------
    RecordingError
        If it is not there, or its content is another one.
    """
    if part.path is None or part.sha256 is None:
        raise RecordingError(f"recording '{part.name}' of '{folder}' was an array in memory; give it with the call")
    places = [(base or Path()) / part.path, folder / Path(part.path).name]
    place = next((p for p in places if p.is_file()), None)
    if place is None:
        raise RecordingError(
            f"recording '{part.path}' of the run '{folder}' is not there; put it back, or copy it into '{folder}'"
        )
    return read_again(Source(part.path, part.sha256, part.options), place)


def task_of_run(record: RunRecord, recordings: Sequence[Recording]) -> IdentificationTask:
    """Task that a run has solved, on its recordings."""
    task = identification_task(recordings, None, {}, {}, None)
    if record.f_tanh is not None:
        settings = settings_for(recordings, task.scales, record.f_tanh)
        task = replace(task, settings=settings, friction_width=None)
    task = replace(task, bounds=dict(record.bounds), fixed=dict(record.fixed), per_recording=record.per_recording)
    return task.with_friction_of(*(fitted.values for fitted in record.fits))
