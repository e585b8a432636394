"""Calls to other processes: a recording is sent to each worker once, and by its fingerprint from then on."""

from __future__ import annotations

import io
import pickle
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from dataclasses import dataclass, field
from typing import Any

from brightgrey.recordings import Recording
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.runs.serialisation import source_hash

__all__ = ["RECORDINGS", "RecordingCache", "RecordingTransferExecutor"]


@dataclass
class RecordingCache:
    """Recordings that a worker process holds, by fingerprint. No result depends on it."""

    capacity: int = 32  #: Recordings that are held; the oldest one makes place for the next.
    _recordings: OrderedDict[str, Recording] = field(default_factory=OrderedDict)

    def add(self, recordings: Mapping[str, Recording]) -> None:
        """Hold further recordings."""
        for fingerprint, recording in recordings.items():
            self._recordings[fingerprint] = recording
            while len(self._recordings) > self.capacity:
                self._recordings.popitem(last=False)

    def get(self, fingerprint: str) -> Recording | None:
        """Recording by its fingerprint, None if it is not held."""
        return self._recordings.get(fingerprint)

    def clear(self) -> None:
        """Hold no recording any more."""
        self._recordings.clear()


RECORDINGS = RecordingCache()
"""Recordings of this process, if it is a worker."""


class _MissingRecording(Exception):  # noqa: N818 - asks the sender for the recording
    """A worker does not hold a recording."""


class _Packer(pickle.Pickler):
    """Pickler that replaces recordings by their fingerprints, and collects them in `recordings`."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self.recordings: dict[str, Recording] = {}

    def persistent_id(self, obj: Any) -> str | None:
        if not isinstance(obj, Recording):
            return None
        self.recordings[obj.fingerprint] = obj
        return obj.fingerprint


class _Unpacker(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Recording:
        recording = RECORDINGS.get(pid)
        if recording is None:
            raise _MissingRecording
        return recording


def _call_in_worker(sender: str, packed: bytes, sent: Mapping[str, Recording] | None = None) -> tuple[bool, Any]:
    """Make a call in a worker; returns True and the result, or False if a recording is missing."""
    limit_blas_threads()
    if sender != source_hash():
        raise RuntimeError(
            f"the worker runs another brightgrey (code {source_hash()}, not {sender}): install the same one"
        )
    RECORDINGS.add(sent or {})
    try:
        function, arguments = _Unpacker(io.BytesIO(packed)).load()
    except _MissingRecording:
        return False, None
    return True, function(*arguments)


class RecordingTransferExecutor(Executor):
    """Executor that sends calls to the workers of `inner`, with recordings only where a worker lacks them."""

    def __init__(self, inner: Executor) -> None:
        self.inner = inner
        self._worker_lost = threading.Event()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Result of ``fn(*args)``; keyword arguments are refused (TypeError)."""
        if kwargs:
            raise TypeError("evaluations are called without keywords")
        file = io.BytesIO()
        packer = _Packer(file)
        packer.dump((fn, args))
        packed, out = file.getvalue(), _RemoteFuture(self._worker_lost)
        self._send(out, packed, packer.recordings, None)
        return out

    def _send(
        self,
        out: _RemoteFuture,
        packed: bytes,
        recordings: Mapping[str, Recording],
        sent: Mapping[str, Recording] | None,
    ) -> None:
        def receive(inner: Future[Any]) -> None:
            try:
                made, result = inner.result()
                if made:
                    out.set_result(result)
                else:
                    self._send(out, packed, recordings, recordings)
            except CancelledError:
                out.mark_cancelled()
            except BaseException as error:
                if isinstance(error, BrokenExecutor):
                    self._worker_lost.set()
                out.set_exception(error)

        try:
            out.inner = self.inner.submit(_call_in_worker, source_hash(), packed, *([sent] if sent else []))
        except BrokenExecutor:
            self._worker_lost.set()
            raise
        out.inner.add_done_callback(receive)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End `inner`."""
        self.inner.shutdown(wait=wait, cancel_futures=cancel_futures)


class _RemoteFuture(Future[Any]):
    """Future of a call in a worker; cancelling it cancels the call, unless a worker is lost.

    A pool that has lost a worker fails all its calls itself, one by one. A call that is cancelled meanwhile ends the
    thread that does so in Python 3.11, and the calls after it would wait for ever.
    """

    inner: Future[Any]

    def __init__(self, worker_lost: threading.Event) -> None:
        super().__init__()
        self._worker_lost = worker_lost

    def cancel(self) -> bool:
        """Cancel the call if it waits; a call that runs comes to its end."""
        return not self._worker_lost.is_set() and self.inner.cancel()

    def mark_cancelled(self) -> None:
        """Mark this future as cancelled, as the call has been."""
        super().cancel()
        self.set_running_or_notify_cancel()
