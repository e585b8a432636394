"""What all pages of the app share: the workspace, the queue, the desk, and what they have found out."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from brightgrey.app.desk.process import Desk
from brightgrey.app.jobs.arguments import identify_arguments
from brightgrey.app.jobs.queue import JobQueue, QueuedCommand
from brightgrey.app.workspace.folder import Workspace, toml_name
from brightgrey.app.workspace.progress import StageState, current_run, stage_states
from brightgrey.app.workspace.project import (
    CheckDecision,
    ProjectDocument,
    RunEntry,
    digest_of_recordings,
    digest_of_search,
)
from brightgrey.errors import BrightgreyError

__all__ = ["AppServices"]

log = logging.getLogger(__name__)


@dataclass
class AppServices:
    """State of the server; the disk holds all that matters."""

    workspace: Workspace
    queue: JobQueue
    desk: Desk
    statuses: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)  #: Of runs, by project and name.
    inspections: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)  #: By project and file.
    checkups: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)  #: By project and digest.
    look_every: float = 0.5  #: Time in s between two looks at what runs.
    ticks: int = 0  #: Grows whenever something that runs has changed.

    def states(self, document: ProjectDocument) -> dict[str, StageState]:
        """State of every stage of a project."""
        known = {r.name: self.statuses.get((document.name, r.name), {}) for r in document.runs}
        with_results = frozenset(
            name for name, status in known.items() if status.get("has_results") and not self.is_busy(document, name)
        )
        return stage_states(document, {n: s.get("state", "missing") for n, s in known.items()}, with_results)

    def is_busy(self, document: ProjectDocument, run: str) -> bool:
        """True if an identification waits or runs."""
        job = self.queue.of(document.name, run, "identify")
        return job is not None and job.state != "ended"

    def tomls(self, document: ProjectDocument, use: str | None = None) -> list[str]:
        """Paths of the recording.toml of all recordings that are used, or of those with one use."""
        folder = self.workspace.path(document.name) / "recordings"
        wanted = [r for r in document.recordings if (r.use == use if use else r.use != "unused")]
        return [str(folder / toml_name(r)) for r in wanted]

    async def inspect(self, project: str, file: str) -> dict[str, Any]:
        """Content of a recording; RecordingError if it is none."""
        key = (project, file)
        if key not in self.inspections:
            path = self.workspace.path(project) / "recordings" / file
            self.inspections[key] = await self.desk.call("inspect_file", str(path))
            self.desk.recycle(path.stat().st_size)
        return self.inspections[key]

    async def check(self, document: ProjectDocument) -> dict[str, Any]:
        """Results of the checks of a project's recordings, noted in its document."""
        digest = digest_of_recordings(document)
        key = (document.name, digest)
        if key not in self.checkups:
            labels = {r.file: r.label for r in document.recordings}
            self.checkups[key] = await self.desk.call("check_files", self.tomls(document), labels)
        found = self.checkups[key]

        def note(current: ProjectDocument) -> ProjectDocument:
            if digest_of_recordings(current) != digest or current.check.digest == digest:
                return current
            decision = CheckDecision(digest=digest, grade=found["grade"])
            return current.model_copy(update={"check": decision})

        self.workspace.change(document.name, note)
        return found

    def begin_search(self, name: str) -> str:
        """Start the search for what is chosen now, or go on with it; returns the name of its run."""
        document = self.workspace.load(name)
        run = current_run(document)
        if run is None:
            number = 1 + max((int(r.name.split("-")[1]) for r in document.runs), default=0)
            new = f"run-{number}"
            run = RunEntry(name=new, digest=digest_of_search(document), arguments=identify_arguments(document, new))
            entry = run
            self.workspace.change(name, lambda d: d.model_copy(update={"runs": (*d.runs, entry)}))
        self.workspace.change(name, lambda d: d.with_run(run.name, wanted="running"))
        self.queue.add(QueuedCommand(name, run.name, run.arguments))
        self.ticks += 1
        return run.name

    def stop_search(self, name: str, run: str) -> None:
        """End a search as Ctrl-C does: it keeps the best so far, and can go on."""
        self.workspace.change(name, lambda d: d.with_run(run, wanted="paused"))
        self.queue.interrupt((name, run, "identify"))
        self.ticks += 1

    async def look(self, project: str, runs: Iterable[str]) -> None:
        """Read the state of runs."""
        names = list(runs)
        folders = [str(self.workspace.path(project) / "runs" / name) for name in names]
        for name, status in zip(names, await self.desk.call("run_status", folders), strict=True):
            if self.statuses.get((project, name)) != status:
                self.statuses[project, name] = status
                self.ticks += 1

    async def recover(self) -> None:
        """Find the searches of an earlier server: watch those that still run, go on with those that were ended."""
        for name in self.workspace.names():
            try:
                document = self.workspace.load(name)
            except BrightgreyError as error:
                log.warning("%s", error)
                continue
            if not document.runs:
                continue
            await self.look(name, [r.name for r in document.runs])
            for run in document.runs:
                state = self.statuses[name, run.name]["state"]
                job = QueuedCommand(name, run.name, run.arguments)
                if run.wanted == "running" and state != "finished" and not self.queue.adopt(job):
                    self.queue.add(job)

    async def watch(self) -> None:
        """Start what waits and look at what runs, until the server ends."""
        try:
            await self.recover()
        except Exception:
            log.exception("the runs of an earlier server cannot be read")
        while True:
            with contextlib.suppress(BrightgreyError):
                await self._tick()
            await asyncio.sleep(self.look_every)

    async def _tick(self) -> None:
        before = {key: job.state for key, job in self.queue.jobs.items()}
        if self.queue.tick():
            self.ticks += 1
        for key, job in list(self.queue.jobs.items()):
            if job.kind == "identify" and (job.state == "running" or before.get(key) != job.state):
                await self.look(job.project, [job.run])
