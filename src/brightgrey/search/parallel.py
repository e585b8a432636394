"""How a search hands out its work: pure functions of arguments that can be sent anywhere, results in order.

Any :class:`concurrent.futures.Executor` does: threads, processes, a cluster, or one that remembers what has been done.
What is submitted is a function of a module (or a frozen object that can be called) with all that its result depends on,
so that it does not matter where and how often it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

__all__ = ["Stopped", "in_dependency_order", "in_order", "thread_pool"]

Item = TypeVar("Item", bound=Hashable)
Returned = TypeVar("Returned")


class Stopped(Exception):  # noqa: N818 - no error: the user or a budget has ended a search before its time
    """Raised instead of a result by an executor that has been told to stop."""


def in_order(
    executor: Executor, function: Callable[..., Returned], calls: Iterable[tuple[Any, ...]]
) -> Iterator[Returned]:
    """Results of ``function(*call)`` for all calls, in their order; what waits is cancelled if the caller leaves."""
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
    """Hand out calls that need each other's results, always in the same order, without waiting for what none needs.

    Parameters
    ----------
    executor : Executor
    items : sequence
        In the order of the calls.
    needs : callable
        Earlier items that have to be taken before an item's call can be made.
    call : callable
        Function and arguments of an item, None if there is nothing to do.
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


@contextmanager
def thread_pool(executor: Executor | None, workers: int = 1) -> Iterator[Executor]:
    """Give `executor`, or threads of our own."""
    if executor is not None:
        yield executor
        return
    own = ThreadPoolExecutor(workers)
    try:
        yield own
    finally:
        own.shutdown(wait=True, cancel_futures=True)
