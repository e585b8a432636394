"""State of each stage, as a pure function of the document and of what its runs have come to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from brightgrey.app.workspace.project import ProjectDocument, RunEntry, digest_of_recordings, digest_of_search

__all__ = ["STAGES", "StageState", "current_run", "next_stage", "stage_states"]

STAGES = ("drive", "recording", "check", "search", "results", "handover")
"""In their order."""

StoredRunState = Literal["finished", "running", "unfinished", "missing"]
Progress = Literal["blocked", "open", "done", "stale"]


@dataclass(frozen=True)
class StageState:
    """State of a stage.

    Attributes
    ----------
    progress : {'blocked', 'open', 'done', 'stale'}
        A stage is stale if something before it has changed since it was done.
    reason : str
        What is to be done first, or what has changed; empty if nothing is.
    """

    progress: Progress
    reason: str = ""

    @property
    def reachable(self) -> bool:
        """True if the stage may be opened."""
        return self.progress != "blocked"


def current_run(document: ProjectDocument) -> RunEntry | None:
    """The latest run of what is chosen now; None if there is none."""
    digest = digest_of_search(document)
    return next((r for r in reversed(document.runs) if r.digest == digest), None)


def stage_states(
    document: ProjectDocument, run_states: Mapping[str, StoredRunState], with_results: frozenset[str]
) -> dict[str, StageState]:
    """State of every stage.

    Parameters
    ----------
    document : ProjectDocument
    run_states : mapping of str to str
        State of each run by its name.
    with_results : frozenset of str
        Runs that have results: finished ones, and those that were stopped with the best so far.
    """
    drive = StageState("done" if document.drive.confirmed else "open")
    recording = _recording(document, drive)
    check = _check(document, recording)
    search = _search(document, check, run_states, with_results)
    if search.progress == "done":
        results = StageState("done")
    elif with_results:
        results = StageState("stale", "These results are of an earlier choice: start the search again.")
    else:
        results = StageState("blocked", "Let a search come to a result first.")
    return dict(zip(STAGES, (drive, recording, check, search, results, results), strict=True))


def next_stage(states: Mapping[str, StageState]) -> str:
    """The first stage that is not done."""
    return next((name for name in STAGES if states[name].progress != "done"), STAGES[-1])


def _recording(document: ProjectDocument, drive: StageState) -> StageState:
    if drive.progress != "done":
        return StageState("blocked", "Say first what is known of the drive.")
    if not document.of_use("train"):
        return StageState("open", "At least one recording has to be used for the fit.")
    for recording in document.recordings:
        if recording.use != "unused" and not (recording.options.get("input") and recording.options.get("output")):
            return StageState("open", f"Say for {recording.label} which channel is the input and which an output.")
    return StageState("done")


def _check(document: ProjectDocument, recording: StageState) -> StageState:
    if recording.progress != "done":
        return StageState("blocked", recording.reason or "Add a recording first.")
    made = document.check
    if not made.digest:
        return StageState("open")
    if made.digest != digest_of_recordings(document):
        return StageState("stale", "A recording or its options have changed: it is checked again.")
    if made.grade == "stop" and not made.override:
        return StageState("open", "A check says stop: apply its remedy, or say that you go on all the same.")
    return StageState("done")


def _search(
    document: ProjectDocument,
    check: StageState,
    run_states: Mapping[str, StoredRunState],
    with_results: frozenset[str],
) -> StageState:
    if check.progress != "done":
        return StageState("blocked", check.reason or "Check the recordings first.")
    run = current_run(document)
    if run is None:
        return StageState("stale" if document.runs else "open", _CHANGED if document.runs else "")
    if run_states.get(run.name) == "finished" or (run.wanted == "paused" and run.name in with_results):
        return StageState("done")
    return StageState("open")


_CHANGED = "Something before this stage has changed since the last search."
