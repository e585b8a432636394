"""Ctrl-C and SIGTERM end a search with the best so far; a second one ends the program at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from brightgrey.runs import RunError, Stop

__all__ = ["SignalStop", "stop_on_signal"]

_SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGBREAK")
    if hasattr(signal, name)  # the last: Windows
)


class SignalStop(Stop):
    """Stop that a signal triggers; `number` is that of the signal."""

    number: int | None = None

    def exit_with_signal(self) -> None:
        """End the program with the exit code of the signal, if one has come."""
        if self.number is not None:
            raise typer.Exit(128 + self.number)


@contextmanager
def stop_on_signal(*, searching: bool = True) -> Iterator[SignalStop]:
    """Stop a search when SIGINT or SIGTERM comes; a search without any result then ends the program.

    Without a search there is no best result so far, and a signal ends the program at once.
    """
    stop = SignalStop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def handle(number: int, frame: Any) -> None:
        for name in caught:
            signal.signal(name, signal.SIG_DFL)
        stop.number = number
        stop.request()
        if not searching:  # Python drops it where a destructor runs; the request stays
            raise KeyboardInterrupt

    caught = _SIGNALS if searching else (signal.SIGINT,)
    before = {name: signal.signal(name, handle) for name in caught}
    try:
        yield stop
    except RunError as error:
        if stop.number is None:
            raise
        typer.echo(f"brightgrey: {error}", err=True)
        stop.exit_with_signal()
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
