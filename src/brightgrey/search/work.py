"""How a search hands out its work: pure functions of arguments that can be sent anywhere, results in order.

Any :class:`concurrent.futures.Executor` does: threads, processes, a cluster, or one that remembers what has been done.
What is submitted is a function of a module (or a frozen object that can be called) with all that its result depends on,
so that it does not matter where and how often it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

__all__ = ["Stopped", "in_order", "pool"]

T = TypeVar("T")


class Stopped(Exception):  # noqa: N818 - no error: the user or a budget has ended a search before its time
    """Raised instead of a result by an executor that has been told to stop."""


def in_order(executor: Executor, function: Callable[..., T], calls: Iterable[tuple[Any, ...]]) -> Iterator[T]:
    """Results of ``function(*call)`` for all calls, in their order; what waits is cancelled if the caller leaves."""
    futures = [executor.submit(function, *call) for call in calls]
    try:
        for future in futures:
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


@contextmanager
def pool(executor: Executor | None, workers: int = 1) -> Iterator[Executor]:
    """Give `executor`, or threads of our own."""
    if executor is not None:
        yield executor
        return
    own = ThreadPoolExecutor(workers)
    try:
        yield own
    finally:
        own.shutdown(wait=True, cancel_futures=True)
