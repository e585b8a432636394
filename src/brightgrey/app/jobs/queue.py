"""Queue of commands: one long one at a time, so that a core is left, and one short one beside it."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from brightgrey.app.jobs.arguments import free_cores
from brightgrey.app.jobs.child import interrupt_process, is_process_of, start_process
from brightgrey.app.workspace.folder import Workspace
from brightgrey.model.files import write_file

__all__ = ["JobQueue", "QueuedCommand"]

JobState = Literal["queued", "running", "ended"]
LONG = ("identify", "selftest", "plan")


@dataclass(frozen=True)
class QueuedCommand:
    """A command that waits, runs or has ended.

    Attributes
    ----------
    project, run : str
    arguments : tuple of str
        As they are shown; the number of workers is added to those that take it.
    state : {'queued', 'running', 'ended'}
    code : int or None
        Exit code; None before the end, and of a command that another server has started.
    output : str
        End of what the command has printed, after its end.
    """

    project: str
    run: str
    arguments: tuple[str, ...]
    state: JobState = "queued"
    code: int | None = None
    output: str = ""

    @property
    def kind(self) -> str:
        """Command."""
        return self.arguments[0]

    @property
    def key(self) -> tuple[str, str, str]:
        """Project, run, and the command with its target."""
        target = self.arguments[self.arguments.index("--to") + 1] if "--to" in self.arguments else ""
        return (self.project, self.run, f"{self.kind}-{target}" if target else self.kind)


@dataclass
class JobQueue:
    """Commands of all projects."""

    workspace: Workspace
    jobs: dict[tuple[str, str, str], QueuedCommand] = field(default_factory=dict)  #: The latest of each key.
    last_words: int = 20_000  #: Characters of a log that are kept.
    _children: dict[tuple[str, str, str], subprocess.Popen[bytes]] = field(default_factory=dict)
    _adopted: dict[tuple[str, str, str], int] = field(default_factory=dict)

    def add(self, job: QueuedCommand) -> None:
        """Put a command at the end of the queue, unless it waits or runs already."""
        known = self.jobs.get(job.key)
        if known is None or known.state == "ended":
            self.jobs.pop(job.key, None)
            self.jobs[job.key] = job

    def of(self, project: str, run: str, kind: str) -> QueuedCommand | None:
        """The latest command of a kind for a run, also of an earlier server."""
        key = (project, run, kind)
        if key not in self.jobs:
            note = _read_note(self.workspace.path(project) / "jobs" / f"{run}-{kind}.json")
            if "code" not in note:
                return None
            self.jobs[key] = QueuedCommand(
                project, run, tuple(note["arguments"]), "ended", note["code"], note["output"]
            )
        return self.jobs[key]

    def interrupt(self, key: tuple[str, str, str]) -> None:
        """Take a command from the queue, or end it as Ctrl-C does."""
        job = self.jobs.get(key)
        if job is not None and job.state == "queued":
            del self.jobs[key]
            return
        pid = self._children[key].pid if key in self._children else self._adopted.get(key)
        if pid is not None:
            interrupt_process(pid)

    def adopt(self, job: QueuedCommand) -> bool:
        """Take over a command that an earlier server has started and that still runs; False if it does not."""
        pid = _read_note(self._note(job)).get("pid")
        if pid is None or not is_process_of(int(pid), job.run):
            return False
        self.jobs[job.key] = replace(job, state="running")
        self._adopted[job.key] = pid
        return True

    def tick(self) -> bool:
        """Note which commands have ended and start the next; True if anything has changed."""
        changed = False
        for key, child in list(self._children.items()):
            if child.poll() is not None:
                del self._children[key]
                self._end(key, child.returncode)
                changed = True
        for key, pid in list(self._adopted.items()):
            if not is_process_of(pid, self.jobs[key].run):
                del self._adopted[key]
                self._end(key, None)
                changed = True
        for long in (True, False):
            lane = [job for job in self.jobs.values() if (job.kind in LONG) is long]
            waiting = [job for job in lane if job.state == "queued"]
            if waiting and not any(job.state == "running" for job in lane):
                self._start(waiting[0])
                changed = True
        return changed

    def pause_all(self) -> None:
        """End all commands as Ctrl-C does; the next server goes on with the searches."""
        for key in [*self._children, *self._adopted]:
            self.interrupt(key)

    def _start(self, job: QueuedCommand) -> None:
        folder = self.workspace.path(job.project)
        if job.kind == "identify":
            self._forget_what_followed(job)
        workers = ("--workers", str(free_cores())) if job.kind in LONG else ()
        child = start_process((*job.arguments, *workers, *_SILENT.get(job.kind, ())), folder, self._log(job))
        self._children[job.key] = child
        self.jobs[job.key] = replace(job, state="running")
        write_file(self._note(job), json.dumps({"pid": child.pid, "arguments": list(job.arguments)}).encode())

    def _end(self, key: tuple[str, str, str], code: int | None) -> None:
        job = self.jobs[key]
        try:
            output = self._log(job).read_text(encoding="utf-8", errors="replace")[-self.last_words :]
        except OSError:
            output = ""
        ended = replace(job, state="ended", code=code, output=output.strip())
        self.jobs[key] = ended
        if self._note(job).parent.is_dir():  # the project may have been deleted meanwhile
            note = {"arguments": list(ended.arguments), "code": code, "output": ended.output}
            write_file(self._note(job), json.dumps(note).encode())

    def _forget_what_followed(self, job: QueuedCommand) -> None:
        """Forget exports, plan and self-test of a run whose model changes."""
        for key in [k for k in self.jobs if k[:2] == job.key[:2] and k != job.key and self.jobs[k].state == "ended"]:
            del self.jobs[key]
        for note in self._note(job).parent.glob(f"{job.run}-*.json"):
            if note != self._note(job):
                note.unlink()

    def _log(self, job: QueuedCommand) -> Path:
        return self.workspace.path(job.project) / "jobs" / f"{job.run}-{job.key[2]}.log"

    def _note(self, job: QueuedCommand) -> Path:
        return self._log(job).with_suffix(".json")


def _read_note(path: Path) -> dict[str, Any]:
    """Content of a note beside a log; empty if there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


_SILENT: Mapping[str, Any] = {"identify": ("--quiet",), "export": ("--json",), "plan": ("--json",)}
"""Options that make a command print only what the app reads."""
