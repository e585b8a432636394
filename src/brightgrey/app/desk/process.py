"""Process that does what takes more than a moment: it reads files, checks recordings, draws and designs."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import ParamSpec, TypeVar

from brightgrey.errors import RecordingError

__all__ = ["Desk"]

P = ParamSpec("P")
T = TypeVar("T")
_LARGE = 50 << 20  # bytes of a file after which the process is replaced, so that its memory is given back


class Desk:
    """One process that does one thing after the other."""

    def __init__(self) -> None:
        self._pool = self._new_pool()

    @staticmethod
    def _new_pool() -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, mp_context=context, initializer=_prepare)

    async def call(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a function of a module, with plain data, in the process.

        Raises
        ------
        BrightgreyError
            As the function; RecordingError if the process was ended by what it read.
        """
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._pool, _Call(function, args, kwargs))
        except BrokenProcessPool:
            self._pool = self._new_pool()
            raise RecordingError("the file has ended the process that read it: it is damaged or too large") from None

    def warm_up(self, function: Callable[[], None]) -> None:
        """Let the process load what it will need, while nobody waits."""
        self._pool.submit(function)

    def recycle(self, size: int) -> None:
        """Replace the process after it has read a file of so many bytes, if that is large."""
        if size > _LARGE:
            self._pool.shutdown(wait=False)
            self._pool = self._new_pool()

    def close(self) -> None:
        """End the process."""
        self._pool.shutdown(wait=False, cancel_futures=True)


class _Call:
    """Call that can be sent to another process."""

    def __init__(self, function: Callable[..., object], args: object, kwargs: object) -> None:
        self.content = function, args, kwargs

    def __call__(self) -> object:
        function, args, kwargs = self.content
        return function(*args, **kwargs)  # type: ignore[misc]


def _prepare() -> None:
    """Leave Ctrl-C to the server, and end with it even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()
