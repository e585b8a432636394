"""Executors of evaluations: threads, processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from brightgrey.errors import SettingsError
from brightgrey.runs.recording_transfer import RecordingTransferExecutor
from brightgrey.runs.store import RunError
from brightgrey.search.parallel import thread_pool

__all__ = ["Workforce"]


@dataclass(frozen=True)
class Workforce:
    """Workers that make the evaluations; the results do not depend on them.

    Raises
    ------
    SettingsError
        For less than one worker, or both processes and Dask.
    """

    workers: int = 1  #: Number of threads, or of processes.
    processes: bool = False  #: Use processes.
    #: Address of a Dask scheduler, ``host:port``; its workers need the same version of brightgrey.
    dask: str | None = None
    connect_timeout: float = 10.0  #: Seconds after which a cluster counts as unreachable.

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise SettingsError(f"workers is {self.workers}; at least 1 is needed")
        if self.processes and self.dask:
            raise SettingsError("processes of this machine and a Dask cluster were asked for; take one of them")

    @contextmanager
    def executor(self) -> Iterator[Executor]:
        """Executor that is shut down with the context; calls that wait are cancelled then.

        Raises
        ------
        SettingsError
            If Dask is not installed.
        RunError
            If the cluster cannot be reached.
        """
        if self.dask:
            with _dask_client(self.dask, self.connect_timeout) as client:
                yield RecordingTransferExecutor(client.get_executor())
            return
        if not self.processes:
            with thread_pool(None, self.workers) as threads:
                yield threads
            return
        made = _process_pool(self.workers)
        try:
            yield made
        finally:
            made.shutdown(wait=True, cancel_futures=True)


def _process_pool(workers: int) -> Executor:
    spawned = multiprocessing.get_context("spawn")  # a fork would copy threads that hold locks, and the lock of the run
    return RecordingTransferExecutor(ProcessPoolExecutor(workers, spawned, _initialise_worker))


def _initialise_worker() -> None:
    """Prepare a worker process: it ignores Ctrl-C, which the parent handles, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _dask_client(address: str, timeout: float) -> Iterator[Any]:
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise SettingsError("--dask needs the package 'distributed': install brightgrey[dask]") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost worker is an event, not an error
    try:
        client: Any = Client(address, timeout=timeout, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise RunError(f"cannot reach a Dask scheduler at '{address}': {error}") from None
    try:
        yield client
    except KilledWorker as error:
        raise RunError(
            f"several workers of the cluster died of the same evaluation, the last of them {error.last_worker};"
            " give them more memory, or use --processes"
        ) from error
    finally:
        client.close()
