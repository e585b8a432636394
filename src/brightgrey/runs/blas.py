"""Linear algebra on one thread: sums over many are rounded differently, and results would depend on the cores."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

__all__ = ["one_blas_thread"]


def one_blas_thread() -> threadpool_limits:
    """Keep linear algebra to one thread, from now on or, as a context, until its end."""
    return threadpool_limits(1, user_api="blas")
