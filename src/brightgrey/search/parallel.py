"""Parallel calls of pure functions, with results in order.

Any :class:`concurrent.futures.Executor` makes the calls: threads, processes, a cluster, or one that memoises. A call is
a function of a module, or a frozen object, with all arguments that its result depends on. So it does not matter where
and how often it is made.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar, cast

from brightgrey.simulation.shared_cores import on_idle_cores, shared_cores

__all__ = ["InlineExecutor", "Stopped", "in_dependency_order", "in_order", "simultaneous", "thread_pool"]

Item = TypeVar("Item", bound=Hashable)
Returned = TypeVar("Returned")


class Stopped(Exception):  # noqa: N818 - no error: the user or a budget has ended a search before its time
    """Raised instead of a result by an executor that has been stopped."""


class InlineExecutor(Executor):
    """Executor that makes each call at once, in the caller's thread.

    Parameters
    ----------
    stopped : callable, optional
        Asked before each call; if it returns True, the result is `Stopped`.
    """

    def __init__(self, stopped: Callable[[], bool] = lambda: False) -> None:
        self._stopped = stopped

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Future that holds the result of ``fn(*args, **kwargs)`` already."""
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            if self._stopped():
                raise Stopped
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def in_order(
    executor: Executor, function: Callable[..., Returned], calls: Iterable[tuple[Any, ...]]
) -> Iterator[Returned]:
    """Yield results of ``function(*call)`` in the order of `calls`; waiting calls are cancelled if the caller stops."""
    futures = [executor.submit(function, *call) for call in calls]
    try:
        for future in futures:
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


def in_dependency_order(
    executor: Executor,
    items: Sequence[Item],
    needs: Callable[[Item], Iterable[Item]],
    call: Callable[[Item], tuple[Any, ...] | None],
    take: Callable[[Item, Any], None],
) -> None:
    """Make calls that depend on each other's results, always in the same order, and wait only where a result is needed.

    Parameters
    ----------
    executor : Executor
    items : sequence
        In the order of the calls.
    needs : callable
        Earlier items whose results have to be taken before the call of an item.
    call : callable
        Function and arguments of an item, or None if there is nothing to call.
    take : callable
        Called with every item and its result, in the order of the items.
    """
    position = {item: i for i, item in enumerate(items)}
    futures: list[Future[Any] | None] = []
    taken = 0
    try:
        for end, item in [*enumerate(items), (len(items), None)]:
            until = end if item is None else 1 + max((position[n] for n in needs(item)), default=-1)
            for i in range(taken, until):
                future = futures[i]
                if future is not None:
                    take(items[i], future.result())
            taken = max(taken, until)
            asked = None if item is None else call(item)
            futures.append(None if asked is None else executor.submit(*asked))
    finally:
        for future in futures:
            if future is not None:
                future.cancel()


def simultaneous(calls: Sequence[Callable[[], Returned]]) -> list[Returned]:
    """Results of `calls` in order, made here and on idle cores.

    For short calls with large results: an executor that memoises would keep them all.
    """
    results: list[Returned | None] = [None] * len(calls)

    def part(waiting: Iterator[int]) -> None:
        for i in waiting:
            results[i] = calls[i]()

    on_idle_cores(part, range(len(calls)), len(calls) - 1)
    return cast("list[Returned]", results)


@contextmanager
def thread_pool(executor: Executor | None, workers: int = 1) -> Iterator[Executor]:
    """Yield `executor`, or a pool of threads that ends with the context, and whose simulations share as many cores."""
    if executor is not None:
        yield executor
        return
    own = ThreadPoolExecutor(workers)
    try:
        with shared_cores(workers):
            yield own
    finally:
        own.shutdown(wait=True, cancel_futures=True)
