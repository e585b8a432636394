"""A command of brightgrey in a process of its own, at lower priority, that the app can end as Ctrl-C does."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from brightgrey.app.security.memory import bound_memory, memory_allowed

__all__ = ["interrupt_process", "is_process_of", "start_process"]

_WINDOWS = sys.platform == "win32"


@dataclass(frozen=True)
class _ProcessPolicy:
    """Circumstances of a command's process."""

    niceness: int = 10  #: Of a command's process, where the system has such a thing.


PROCESSES = _ProcessPolicy()


def start_process(arguments: Sequence[str], folder: Path, log: Path) -> subprocess.Popen[bytes]:
    """Start ``brightgrey ARGUMENTS`` in `folder`; its output goes to `log`.

    The process outlives the app: a search goes on where the server is killed.
    """
    command = [sys.executable, "-P", "-m", "brightgrey", *arguments]
    with log.open("wb") as output:
        if sys.platform == "win32":
            flags = subprocess.BELOW_NORMAL_PRIORITY_CLASS | subprocess.CREATE_NEW_PROCESS_GROUP
            return subprocess.Popen(
                command, cwd=folder, stdin=subprocess.DEVNULL, stdout=output, stderr=output, creationflags=flags
            )
        child = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True
        )
    with contextlib.suppress(OSError):  # it may be over already
        os.setpriority(os.PRIO_PROCESS, child.pid, PROCESSES.niceness)
    bound_memory(child.pid, memory_allowed())
    return child


def interrupt_process(pid: int) -> None:
    """End a command as Ctrl-C does: a search keeps what it has, and the same command goes on with it."""
    with contextlib.suppress(ProcessLookupError):
        if sys.platform == "win32":
            os.kill(pid, signal.CTRL_BREAK_EVENT)  # a group of its own does not take CTRL_C_EVENT
        else:
            os.kill(pid, signal.SIGINT)


def is_process_of(pid: int, run: str) -> bool:
    """True if the process is alive and is the command of that run, not another one that has its number now.

    Where the command line of a process cannot be read, as on Windows, it is taken to be the one that was noted.
    """
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except FileNotFoundError:
        return _WINDOWS
    except OSError:
        return True
    return b"brightgrey" in words and any(word.decode(errors="replace").endswith(f"/{run}") for word in words)
