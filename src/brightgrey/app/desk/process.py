"""Process that does what takes more than a moment: it reads files, checks recordings, draws and designs."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from brightgrey.app.security.memory import bound_memory, memory_allowed, memory_sentence
from brightgrey.errors import RecordingError

__all__ = ["TASKS", "Desk"]

#: Tasks by name, with the module of each: the server itself loads none of what they need.
TASKS = {
    **dict.fromkeys(("apply_remedy", "check_files", "inspect_file", "recording_course"), "recordings"),
    **dict.fromkeys(("check_drive", "drive_picture", "effect_choices"), "drives"),
    **dict.fromkeys(("gains", "live_fit", "result_parts", "run_status"), "results"),
    **dict.fromkeys(("beside_course", "beside_tables", "result_course", "run_structures"), "structures"),
}


@dataclass(frozen=True)
class _DeskPolicy:
    """Limits of the desk."""

    large: int = 50 << 20  #: Bytes of a file after which the process is replaced, so that its memory is given back.


DESK = _DeskPolicy()


class Desk:
    """One process that does one thing after the other."""

    def __init__(self, memory: int | None = None) -> None:
        self.memory = memory  #: Bytes that the process may take; a part of what is free by default.
        self._pool = self._new_pool()
        self._is_warm = False

    def _new_pool(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        most = memory_allowed() if self.memory is None else self.memory
        return ProcessPoolExecutor(1, mp_context=context, initializer=_prepare, initargs=(most,))

    async def call(self, task: str, *args: Any) -> Any:
        """Do one of the tasks, with plain data, in the process.

        Raises
        ------
        BrightgreyError
            As the task; RecordingError if what it read does not fit into the memory, or has ended the process.
        """
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._pool, _do, task, args)
        except BrokenProcessPool:
            self._pool = self._new_pool()
            raise RecordingError("the file has ended the process that read it: it is damaged or too large") from None

    def warm_up(self) -> None:
        """Let the process load what it will need, while nobody waits; once."""
        if not self._is_warm:
            self._is_warm = True
            self._pool.submit(_load_tasks)

    def recycle(self, size: int) -> None:
        """Replace the process after it has read a file of so many bytes, if that is large."""
        if size > DESK.large:
            self._pool.shutdown(wait=False)
            self._pool = self._new_pool()

    def close(self) -> None:
        """End the process, whatever it does."""
        for child in multiprocessing.active_children():
            child.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)


def _do(task: str, args: tuple[Any, ...]) -> Any:
    try:
        return getattr(import_module(f"brightgrey.app.desk.{TASKS[task]}"), task)(*args)
    except MemoryError:
        raise RecordingError(memory_sentence()) from None


def _load_tasks() -> None:
    for module in sorted(set(TASKS.values())):
        import_module(f"brightgrey.app.desk.{module}")


def _prepare(most: int | None) -> None:
    """Bound the memory, leave Ctrl-C to the server, and end with it even if it is killed."""
    bound_memory(0, most)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()
