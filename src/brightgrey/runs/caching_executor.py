"""An executor that remembers: what a store knows is not computed again.

A search is a deterministic sequence of pure calls. Repeated with this executor it comes by itself to the point where it
was interrupted, with the same numbers, and goes on from there: nothing in a search knows that it was ever interrupted.
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
    """How far to go, and no further.

    Attributes
    ----------
    evaluations : int or None
        Those that an earlier part of the run has made count, so that the result does not depend on interruptions.
    seconds : float or None
        Of this part of the run.

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
    """Something to tell that all has to come to an end, and to be told so."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []
        self.told = False

    def listen(self, callback: Callable[[], None]) -> None:
        """Have `callback` called when it is told, at once if it has been."""
        self._listeners.append(callback)
        if self.told:
            callback()

    def tell(self) -> None:
        """Stop. May be called in a signal handler: the listeners are called on a thread of their own."""
        self.told = True
        threading.Thread(target=lambda: [callback() for callback in tuple(self._listeners)], daemon=True).start()


_About = tuple[str, int, str, str]  # key, number, function, subject


def _timed(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, float]:
    """Result, and the seconds it took."""
    began = time.monotonic()
    result = function(*arguments)
    return result, time.monotonic() - began


def _broken(error: BrokenExecutor | str) -> RunError:
    return RunError(f"a worker has died ({error}); what is done is kept, and the same command goes on from there")


class CachingExecutor(Executor):
    """Answers calls from `store`, has the others made by `inner` and keeps their results.

    Parameters
    ----------
    inner : Executor
    store : Store
    budget : Budget, optional
    stop : Stop, optional
        What it listens to.
    """

    def __init__(self, inner: Executor, store: Store, budget: Budget | None = None, stop: Stop | None = None) -> None:
        self._inner, self._store, self._budget = inner, store, budget or Budget()
        self._one = threading.Lock()
        self._number = 0
        self._pending: dict[Future[Any], Future[Any]] = {}
        self._stopped = threading.Event()
        self._timer = threading.Timer(self._budget.seconds or 0.0, self.stop)
        self._timer.daemon = True
        if self._budget.seconds is not None:
            self._timer.start()
        if stop is not None:
            stop.listen(self.stop)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Result of ``fn(*args)``, as the store gives it back; keyword arguments are refused (TypeError)."""
        if kwargs:
            raise TypeError("evaluations are called without keywords")
        self._number += 1
        out: Future[Any] = Future()
        out.set_running_or_notify_cancel()
        most = self._budget.evaluations
        if self._stopped.is_set() or (most is not None and self._number > most):
            out.set_exception(Stopped())
            return out
        key = digest(call_text(fn, args))
        known = self._store.result(key)
        if known is not None:
            out.set_result(value_of(known))
            return out
        subject = next((str(a) for a in args if isinstance(a, Structure)), "")
        self._hand_over(out, fn, args, (key, self._number, name_of(fn), subject))
        return out

    def _hand_over(self, out: Future[Any], fn: Callable[..., Any], args: tuple[Any, ...], about: _About) -> None:
        def done(inner: Future[Any]) -> None:
            with self._one:
                self._pending.pop(inner, None)
            try:
                result, seconds = inner.result()
                text = text_of(result)
                self._store.keep(*about, seconds, text)
                out.set_result(value_of(text))
            except CancelledError:
                out.set_exception(Stopped() if self.stopped else _broken("it is out of reach"))
            except BrokenExecutor as error:
                out.set_exception(_broken(error))
            except BaseException as error:
                out.set_exception(error)

        try:
            inner = self._inner.submit(_timed, fn, args)
        except BrokenExecutor as error:
            out.set_exception(_broken(error))
            return
        with self._one:
            self._pending[inner] = out
        inner.add_done_callback(done)
        if self._stopped.is_set():
            inner.cancel()

    def stop(self) -> None:
        """Let what is being computed come to its end, and nothing else begin. Callable from any thread."""
        self._stopped.set()
        with self._one:
            waiting = list(self._pending)
        for inner in waiting:
            inner.cancel()

    @property
    def stopped(self) -> bool:
        """Whether :meth:`stop` was called."""
        return self._stopped.is_set()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait until all that is being computed has been kept; `inner` stays open."""
        self._timer.cancel()
        with self._one:
            waiting = dict(self._pending)
        for inner, out in waiting.items():
            if cancel_futures:
                inner.cancel()
            if wait:
                with suppress(BaseException):
                    out.exception()
