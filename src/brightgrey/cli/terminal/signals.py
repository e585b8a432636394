"""Ctrl-C and SIGTERM end a search with the best so far; a second one ends the program at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from brightgrey.runs import RunError, Stop

__all__ = ["Signals", "signals"]

_WATCHED = (signal.SIGINT, signal.SIGTERM)


class Signals(Stop):
    """Is told to stop by a signal, and keeps which."""

    number: int | None = None

    def leave(self) -> None:
        """End the program with the exit code of the signal, if there was one."""
        if self.number is not None:
            raise typer.Exit(128 + self.number)


@contextmanager
def signals() -> Iterator[Signals]:
    """Listen to the signals in this context. A run that they have kept from any result ends with their exit code."""
    stop = Signals()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def handle(number: int, frame: Any) -> None:
        for watched in _WATCHED:
            signal.signal(watched, signal.SIG_DFL)
        stop.number = number
        stop.tell()

    before = {watched: signal.signal(watched, handle) for watched in _WATCHED}
    try:
        yield stop
    except RunError as error:
        if stop.number is None:
            raise
        typer.echo(f"brightgrey: {error}", err=True)
        stop.leave()
    finally:
        for watched, handler in before.items():
            signal.signal(watched, handler)
