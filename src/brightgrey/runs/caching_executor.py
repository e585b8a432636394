"""Executor that memoises on disk: a call whose result is in the store is not made again.

A search is a deterministic sequence of pure calls. Repeated with this executor, it returns by itself to the point where
it was interrupted, with the same numbers, and goes on from there. So no search needs code for resuming.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from brightgrey.errors import SettingsError
from brightgrey.kit import Structure
from brightgrey.runs.serialisation import call_text, digest, name_of, text_of, value_of
from brightgrey.runs.store import RunError, Store
from brightgrey.search.parallel import Stopped

__all__ = ["Budget", "CachingExecutor", "Stop"]


@dataclass(frozen=True)
class Budget:
    """Limits of a run.

    Attributes
    ----------
    evaluations : int or None
        Evaluations in all. Those that an earlier part of the run has made count, so that the result does not depend on
        interruptions.
    seconds : float or None
        Wall time of this part of the run.

    Raises
    ------
    SettingsError
        For numbers that are not positive.
    """

    evaluations: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        if self.evaluations is not None and self.evaluations < 1:
            raise SettingsError(f"the budget is {self.evaluations} evaluations; at least 1 is needed")
        if self.seconds is not None and not 0.0 < self.seconds < threading.TIMEOUT_MAX:
            raise SettingsError(f"the budget is {self.seconds:g} s; it has to be above 0")


class Stop:
    """Request to end a run early, with the listeners that act on it.

    Attributes
    ----------
    requested : bool
    """

    def __init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []
        self.requested = False

    def add_listener(self, callback: Callable[[], None]) -> None:
        """Call `callback` when a stop is requested, or at once if it has been."""
        self._listeners.append(callback)
        if self.requested:
            callback()

    def request(self) -> None:
        """Request the stop. A signal handler may do so: the listeners are called on a thread of their own."""
        self.requested = True
        threading.Thread(target=lambda: [callback() for callback in tuple(self._listeners)], daemon=True).start()


_CallRecord = tuple[str, int, str, str]
"""Key, number, name of the function, and structure of a call."""


def _timed(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, float]:
    """Result of a call, and the seconds it took."""
    start = time.monotonic()
    result = function(*arguments)
    return result, time.monotonic() - start


def _worker_died(error: BrokenExecutor | str) -> RunError:
    return RunError(f"a worker has died ({error}); what is done is kept, and the same command goes on from there")


class CachingExecutor(Executor):
    """Executor that returns results from `store`, and stores the results of all other calls, made by `inner`.

    Parameters
    ----------
    inner : Executor
    store : Store
    budget : Budget, optional
    stop : Stop, optional
        Ends the run as :meth:`stop` does.
    """

    def __init__(self, inner: Executor, store: Store, budget: Budget | None = None, stop: Stop | None = None) -> None:
        self._inner, self._store, self._budget = inner, store, budget or Budget()
        self._mutex = threading.Lock()
        self._number = 0
        self._pending: dict[Future[Any], Future[Any]] = {}
        self._stopped = threading.Event()
        self._timer = threading.Timer(self._budget.seconds or 0.0, self.stop)
        self._timer.daemon = True
        if self._budget.seconds is not None:
            self._timer.start()
        if stop is not None:
            stop.add_listener(self.stop)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Result of ``fn(*args)``, as the store gives it back; keyword arguments are refused (TypeError)."""
        if kwargs:
            raise TypeError("evaluations are called without keywords")
        self._number += 1
        out: Future[Any] = Future()
        out.set_running_or_notify_cancel()
        limit = self._budget.evaluations
        if self._stopped.is_set() or (limit is not None and self._number > limit):
            out.set_exception(Stopped())
            return out
        key = digest(call_text(fn, args))
        known = self._store.result(key)
        if known is not None:
            out.set_result(value_of(known))
            return out
        subject = next((str(a) for a in args if isinstance(a, Structure)), "")
        self._forward(out, fn, args, (key, self._number, name_of(fn), subject))
        return out

    def _forward(self, out: Future[Any], fn: Callable[..., Any], args: tuple[Any, ...], record: _CallRecord) -> None:
        def done(inner: Future[Any]) -> None:
            with self._mutex:
                self._pending.pop(inner, None)
            try:
                result, seconds = inner.result()
                text = text_of(result)
                self._store.save_evaluation(*record, seconds, text)
                out.set_result(value_of(text))
            except CancelledError:
                out.set_exception(Stopped() if self.stopped else _worker_died("it cannot be reached"))
            except BrokenExecutor as error:
                out.set_exception(_worker_died(error))
            except BaseException as error:
                out.set_exception(error)

        try:
            inner = self._inner.submit(_timed, fn, args)
        except BrokenExecutor as error:
            out.set_exception(_worker_died(error))
            return
        with self._mutex:
            self._pending[inner] = out
        inner.add_done_callback(done)
        if self._stopped.is_set():
            inner.cancel()

    def stop(self) -> None:
        """Start no further call; calls that run come to their end. Any thread may call this."""
        self._stopped.set()
        with self._mutex:
            waiting = list(self._pending)
        for inner in waiting:
            inner.cancel()

    @property
    def stopped(self) -> bool:
        """True after :meth:`stop` was called."""
        return self._stopped.is_set()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait until the results of running calls are stored; `inner` stays open."""
        self._timer.cancel()
        with self._mutex:
            waiting = dict(self._pending)
        for inner, out in waiting.items():
            if cancel_futures:
                inner.cancel()
            if wait:
                with suppress(BaseException):
                    out.exception()
