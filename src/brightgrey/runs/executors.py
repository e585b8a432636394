"""Who makes the evaluations: threads, processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from brightgrey.errors import SettingsError
from brightgrey.runs.recording_transfer import RecordingTransferExecutor
from brightgrey.runs.store import RunError

__all__ = ["Workforce"]

_PATIENCE = 10  # s until a cluster counts as out of reach


@dataclass(frozen=True)
class Workforce:
    """Where evaluations are made; their results do not depend on it.

    Attributes
    ----------
    workers : int
        Threads, or processes.
    processes : bool
    dask : str or None
        Address of a Dask scheduler, ``host:port``; its workers need the same brightgrey.

    Raises
    ------
    SettingsError
        For less than one worker, or both processes and Dask.
    """

    workers: int = 1
    processes: bool = False
    dask: str | None = None

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise SettingsError(f"workers is {self.workers}; at least 1 is needed")
        if self.processes and self.dask:
            raise SettingsError("processes of this machine and a Dask cluster were asked for; take one of them")

    @contextmanager
    def executor(self) -> Iterator[Executor]:
        """Executor that ends with the context; what waits then is cancelled.

        Raises
        ------
        SettingsError
            If Dask is not installed.
        RunError
            If the cluster cannot be reached.
        """
        if self.dask:
            with _cluster(self.dask) as client:
                yield RecordingTransferExecutor(client.get_executor())
            return
        made = _processes(self.workers) if self.processes else ThreadPoolExecutor(self.workers)
        try:
            yield made
        finally:
            made.shutdown(wait=True, cancel_futures=True)


def _processes(workers: int) -> Executor:
    spawned = multiprocessing.get_context("spawn")  # a fork would copy threads that hold locks, and our own lock
    return RecordingTransferExecutor(ProcessPoolExecutor(workers, spawned, _settle))


def _settle() -> None:
    """Begin as a worker: the parent alone hears of Ctrl-C, and nobody survives it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_outlived, daemon=True).start()


def _outlived() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise SettingsError("--dask needs the package 'distributed': install brightgrey[dask]") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost worker is an event, not an error
    try:
        client: Any = Client(address, timeout=_PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise RunError(f"cannot reach a Dask scheduler at '{address}': {error}") from None
    try:
        yield client
    except KilledWorker as error:
        raise RunError(
            f"an evaluation has cost the cluster several workers, the last of them {error.last_worker}"
        ) from error
    finally:
        client.close()
