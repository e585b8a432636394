"""Linear algebra on one thread: several threads round sums differently, and results would depend on their number."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import threadpool_limits

__all__ = ["limit_blas_threads", "one_blas_thread"]


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep linear algebra to one thread in this context, or in a function that it decorates."""
    with threadpool_limits(1, user_api="blas"):
        yield


@cache
def limit_blas_threads() -> None:
    """Keep linear algebra to one thread until the process, a worker, ends."""
    threadpool_limits(1, user_api="blas")
