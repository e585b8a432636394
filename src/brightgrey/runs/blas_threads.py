"""Linear algebra on one thread: sums over many are rounded differently, and results would depend on the cores."""

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
    """Keep linear algebra to one thread for good: the process is a worker."""
    threadpool_limits(1, user_api="blas")
