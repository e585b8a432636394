"""All structures of a grammar, simple to complex, and what has been missed sought in the end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from brightgrey.kit import Structure
from brightgrey.search.fits import Fits
from brightgrey.search.fitting import Fitted, Options
from brightgrey.search.missed import seek_missed
from brightgrey.search.parallel import thread_pool
from brightgrey.search.task import IdentificationTask

__all__ = ["fit_all"]


def fit_all(
    task: IdentificationTask,
    structures: Sequence[Structure],
    *,
    options: Options | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Fitted], None] | None = None,
    seeking: Callable[[Structure], None] | None = None,
) -> dict[Structure, Fitted]:
    """Fit all `structures` at the level of ``task.settings``.

    Parameters
    ----------
    task : IdentificationTask
    structures : sequence of Structure
    options : Options, optional
    seed : int
    executor : concurrent.futures.Executor, optional
        Fits structures at a time that do not contain each other; the result does not depend on it. One thread by
        default.
    progress : callable, optional
        Called with every structure that has been fitted for the first time, in the order of the result.
    seeking : callable, optional
        Called with every structure that is searched from everywhere afterwards, before that is done.

    Returns
    -------
    dict of Structure to Fitted
        Simple ones first.
    """
    fits = Fits(task, structures, options=options, seed=seed)
    with thread_pool(executor) as workers:
        fits.add(structures, workers, progress)
        seek_missed(fits, workers, seeking)
    return fits.done
