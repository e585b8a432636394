"""Cores that the simulations of a process share.

A search makes as many calls at once as it has workers, and each simulates on a core of its own. Often there are fewer
calls than workers. A simulation of several batches then takes the cores that are idle, too. Its result does not depend
on them, because no batch depends on another one.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from itertools import takewhile

__all__ = ["on_idle_cores", "shared_cores"]


class _Cores:
    """Cores of this process that simulations may take, and those that they have taken."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._offered: list[int] = []
        self._taken = 0
        self._thread = threading.local()

    @contextmanager
    def offered(self, count: int) -> Iterator[None]:
        """Offer so many cores in this context; of several contexts, the one that offers most counts."""
        with self._lock:
            self._offered.append(count)
        try:
            yield
        finally:
            with self._lock:
                self._offered.remove(count)

    @contextmanager
    def taken(self, most: int) -> Iterator[int]:
        """Take a core, unless the thread has one, and up to `most` more of those that are idle; yields how many."""
        own = 0 if getattr(self._thread, "has_core", False) else 1
        with self._lock:
            idle = max(self._offered, default=1) - self._taken - own
            more = max(min(idle, most), 0)
            self._taken += own + more
        try:
            yield more
        finally:
            with self._lock:
                self._taken -= own + more

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let this thread have a core that has been taken."""
        before = getattr(self._thread, "has_core", False)
        self._thread.has_core = True
        try:
            yield
        finally:
            self._thread.has_core = before


_CORES = _Cores()


def shared_cores(count: int) -> AbstractContextManager[None]:
    """Context in which all simulations of this process share `count` cores; outside, each has one of its own."""
    return _CORES.offered(count)


def on_idle_cores(part: Callable[[Iterator[int]], None], numbers: Iterable[int], most: int) -> None:
    """Call `part` here, and at the same time on up to `most` idle cores, with numbers that the calls take in turn.

    After an error no more numbers are taken.
    """
    waiting, failed = iter(numbers), threading.Event()

    def run() -> None:
        with _CORES.held():
            try:
                part(takewhile(lambda number: not failed.is_set(), waiting))
            except BaseException:
                failed.set()
                raise

    with _CORES.taken(most) as more:
        futures = [_helpers().submit(run) for _ in range(more)]
        try:
            run()
        finally:
            begun = [future for future in futures if not future.cancel()]  # nothing is left for the others
            wait(begun)  # what an interrupted caller gives up must not be written to any more
        for future in begun:
            future.result()


@cache
def _helpers() -> Executor:
    """Threads that wait for parts of simulations: to start one costs as much as a short simulation."""
    return ThreadPoolExecutor(thread_name_prefix="simulation")
