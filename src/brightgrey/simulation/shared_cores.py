"""Cores that the simulations of a process share.

A search makes as many calls at once as it has workers, and each simulates on a core of its own. Often there are fewer
calls than workers. A simulation of several batches then takes the cores that are idle, too. Its result does not depend
on them, because no batch depends on another one.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from functools import cache

__all__ = ["on_idle_cores", "shared_cores"]


class _Cores:
    """Cores of this process that simulations may take, and those that they have taken."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._offered: list[int] = []
        self._taken = 0

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
        """Take a core, and up to `most` more of those that are idle; yields how many more."""
        with self._lock:
            idle = max(self._offered, default=1) - self._taken - 1
            more = max(min(idle, most), 0)
            self._taken += 1 + more
        try:
            yield more
        finally:
            with self._lock:
                self._taken -= 1 + more


_CORES = _Cores()


def shared_cores(count: int) -> AbstractContextManager[None]:
    """Context in which all simulations of this process share `count` cores; outside, each has one of its own."""
    return _CORES.offered(count)


def on_idle_cores(part: Callable[[], None], most: int) -> None:
    """Call `part` here, and at the same time on up to `most` idle cores; its calls share out the work themselves."""
    with _CORES.taken(most) as more:
        futures = [_helpers().submit(part) for _ in range(more)]
        try:
            part()
        finally:
            wait(futures)  # what an interrupted caller gives up must not be written to any more
        for future in futures:
            future.result()


@cache
def _helpers() -> Executor:
    """Threads that wait for parts of simulations: to start one costs as much as a short simulation."""
    return ThreadPoolExecutor(thread_name_prefix="simulation")
